"""The option `--version` of both command lines."""

from typing import Annotated

import typer

from onboard.recorder.build import present_build


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"onboard {present_build().name}")
        raise typer.Exit


VersionOption = Annotated[
    bool,
    typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version."),
]
