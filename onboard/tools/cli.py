"""The command line of `onboard`."""

import sys

import typer

from onboard.errors import UserError
from onboard.tools.commands import LazyGroup
from onboard.tools.version import VersionOption

app = typer.Typer(
    cls=LazyGroup,
    help="The in-car daemon that warns the driver, and its tools.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


@app.callback()
def options(version: VersionOption = False) -> None:
    """Take the options of the program itself; their callbacks act."""


def main() -> None:
    """Run the command line; a mistake of the user is one line on stderr and exit code 2."""
    try:
        app()
    except UserError as error:
        sys.exit(_complain(error))


def _complain(error: UserError) -> int:
    print(error, file=sys.stderr)  # noqa: T201 (for the user, not a log)
    return 2
