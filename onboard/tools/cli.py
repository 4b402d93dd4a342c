"""The command line of `onboard`."""

import sys
from pathlib import Path

from onboard.errors import UserError
from onboard.tools.command_line import VersionOption, command_line, output_on_a_disk
from onboard.tools.commands import LazyGroup

_PACKAGE = Path(__file__).parents[1]


def first_page() -> Path:
    """Return the first page of the documentation: of a package (`setup.py`), or of a checkout."""
    packaged = _PACKAGE / "pages" / "README.md"
    return packaged if packaged.exists() else _PACKAGE.parent / "README.md"


app = command_line(
    "The in-car daemon that warns the driver, and its tools.",
    LazyGroup,
    epilog=f"\b\nDocumentation: {first_page()}",  # a path is not wrapped
)


@app.callback()
def options(version: VersionOption = False) -> None:
    """Take the options of the program itself; their callbacks act."""


def main() -> None:
    """Run the command line; a mistake of the user is one line on stderr and exit code 2."""
    try:
        with output_on_a_disk():
            app()
    except UserError as error:
        sys.exit(_complain(error))


def _complain(error: UserError) -> int:
    print(error, file=sys.stderr)  # noqa: T201 (for the user, not a log)
    return 2
