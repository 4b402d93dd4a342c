"""`onboard example`: the files of the folder `examples`, for who has no checkout."""

from pathlib import Path
from typing import Annotated

import typer

from onboard.errors import UserError

EXAMPLES = {
    "desk": ("desk.yaml", "desk.log"),
    "car": ("car.yaml",),
    "lesson": ("lesson/lesson.yaml", "lesson/make_clip.py", "desk.log"),
    "red": ("box/red.yaml",),
    "foxglove-layout": ("foxglove-layout.json",),
    "ros2-bridge": ("ros2_bridge.py",),
}
"""By name, its files in the folder."""
_PACKAGE = Path(__file__).parents[1]


def folder() -> Path:
    """Return the folder of the examples: of a checkout, or its copy in a package (`setup.py`)."""
    packaged = _PACKAGE / "examples"
    return packaged if packaged.is_dir() else _PACKAGE.parent / "examples"


def example(
    name: Annotated[
        str,
        typer.Argument(
            help=f"One of {', '.join(EXAMPLES)}; the ending may be written, too.",
            autocompletion=lambda incomplete: [e for e in EXAMPLES if e.startswith(incomplete)],
        ),
    ],
    out: Annotated[Path, typer.Option(help="The folder to write to; made if missing.")] = Path(),
) -> None:
    """Write an example: a car at a desk, or a whole configuration.

    No file is replaced: one that is there already, as another example wrote it, stays.
    """
    files = EXAMPLES.get(Path(name).stem)
    if files is None:
        raise UserError(f"{name}: no such example; there are: {', '.join(EXAMPLES)}")
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{out}: cannot be made: {error.strerror}") from error
    for file in files:
        written = out / Path(file).name
        # Beside each other, and not in `examples`, are the files that one of them names.
        text = (folder() / file).read_text("utf-8").replace("examples/", "")
        try:
            with written.open("x", encoding="utf-8") as new:
                new.write(text)
        except FileExistsError:
            if not _is(written, text):
                raise UserError(f"{written}: exists; remove it, or give --out FOLDER") from None
        except OSError as error:
            raise UserError(f"{written}: cannot be written: {error.strerror}") from error
        typer.echo(f"{written}")


def _is(file: Path, text: str) -> bool:
    """Whether a file has this text."""
    try:
        return file.read_text("utf-8") == text
    except (OSError, UnicodeDecodeError):
        return False
