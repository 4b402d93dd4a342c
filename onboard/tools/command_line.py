"""What both command lines have in common: plain help and errors, and the option `--version`."""

from typing import Annotated

import typer
import typer.core

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


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"onboard {present_build().name}")
        raise typer.Exit


VersionOption = Annotated[
    bool,
    typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version."),
]
