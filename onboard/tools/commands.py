"""The commands of `onboard`, each imported when it runs.

To list or complete them, a shell asks often, and their imports take a second.
"""

import contextlib
import gc
from collections.abc import Iterator
from importlib import import_module
from typing import Any, NamedTuple

import typer
import typer.core
from typing_extensions import override

from onboard.tools.command_line import command_line


class Command(NamedTuple):
    """Where a command is, and what lists show of it."""

    module: str
    name: str
    """Of its function, or of the `Typer` of its own commands."""
    help: str


COMMANDS = {
    "run": Command(
        "onboard.tools.run_cli",
        "run",
        "Run the daemon until it is stopped. SIGHUP reloads its configuration.",
    ),
    "example": Command(
        "onboard.tools.example_cli",
        "example",
        "Write an example: a car at a desk, or a whole configuration.",
    ),
    "check": Command(
        "onboard.tools.check_cli",
        "check",
        "Check a configuration: print its mistakes, or what it uses. Opens no device.",
    ),
    "doctor": Command(
        "onboard.tools.doctor.cli",
        "doctor",
        "Test every connection; print what is missing and what to do. Exit with 1 if anything is.",
    ),
    "replay": Command(
        "onboard.tools.replay_cli",
        "replay",
        "Replay a recorded drive: print what was observed and decided. One JSON object a line.",
    ),
    "export": Command(
        "onboard.tools.recording_cli",
        "export",
        "Export a recording's radio and CAN frames, for other tools.",
    ),
    "schema": Command(
        "onboard.tools.schema_cli",
        "schema",
        "Print the JSON schema of the trace. The live interface sends its lines, too.",
    ),
    "decode": Command(
        "onboard.tools.decode.cli",
        "decode",
        "Print the radio messages in a capture or in lines of hex. One JSON object each.",
    ),
    "see": Command(
        "onboard.tools.see.cli",
        "see",
        "Find vehicles and plates in a video or in images, as a car does.",
    ),
    "calibrate": Command(
        "onboard.tools.calibrate.cli",
        "calibrate",
        "Find the camera's lens and mounting. Images show a chessboard or a plate.",
    ),
    "keys": Command(
        "onboard.tools.test_ca.cli",
        "keys",
        "Make and show IEEE 1609.2 certificates. A root's, an authority's, and each vehicle's.",
    ),
}


@contextlib.contextmanager
def without_collection() -> Iterator[None]:
    """For imports: what they make stays, and to search it for garbage is a tenth of a start."""
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


class LazyGroup(typer.core.TyperGroup):
    """Lists all commands, and imports the one that is used."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands = {
            name: typer.core.TyperCommand(name, help=command.help)
            for name, command in COMMANDS.items()
        }

    @override
    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        name, command, rest = super().resolve_command(ctx, args)
        return name, command if name is None else imported(name), rest


def imported(name: str) -> Any:
    """Import a command of `COMMANDS`, one of Click's: Typer has its own copy of these."""
    module, attribute, _ = COMMANDS[name]
    with without_collection():
        command = getattr(import_module(module), attribute)
    if not isinstance(command, typer.Typer):
        app = command_line(add_completion=False)
        app.command(name)(command)
        command = app
    return typer.main.get_command(command)
