"""What both command lines have in common: plain help and errors, and the option `--version`."""

import errno
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated

import typer
import typer.core

from onboard.errors import UserError
from onboard.recorder.build import present_build


def command_line(
    summary: str | None = None,
    group: type[typer.core.TyperGroup] | None = None,
    *,
    epilog: str | None = None,
    add_completion: bool = True,
) -> typer.Typer:
    """Return a command line whose help also fits narrow terminals, logs and screen readers.

    Args:
        summary: first paragraph of its help.
        group: the class of the group of its commands.
        epilog: last paragraph of its help.
        add_completion: add the options that install completion in the shell.
    """
    return typer.Typer(
        cls=group,
        help=summary,
        epilog=epilog,
        no_args_is_help=True,
        add_completion=add_completion,
        context_settings={"help_option_names": ["-h", "--help"]},
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
    )


@contextmanager
def output_on_a_disk() -> Iterator[None]:
    """Let a command print into a file.

    Raises:
        UserError: the disk under the standard output is full.
    """
    try:
        yield
    except OSError as error:
        if error.errno != errno.ENOSPC or error.filename is not None:
            raise
        # What is left in its buffer would be tried again as the program ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise UserError(f"the output cannot be written: {error.strerror}") from error


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"onboard {present_build().name}")
        raise typer.Exit


VersionOption = Annotated[
    bool,
    typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version."),
]
