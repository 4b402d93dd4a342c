"""Recordings of older builds are read, and inputs do not change without a new format."""

import json
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from types import UnionType
from typing import Any, get_args, get_type_hints

import pytest

from onboard.recorder.header import FORMAT
from onboard.recorder.inputs import RecordedInput
from onboard.recorder.reader import RecordedDrive
from onboard.replay.replay import OTHER_PROCESSOR, play
from onboard.tools.recording_cli import expect

OLD = sorted((Path(__file__).parents[1] / "drives" / "old").glob("*.mcap"))
COMMITTED = Path(__file__).with_name("inputs.json")


def schema(hint: Any) -> object:
    if is_dataclass(hint) and isinstance(hint, type):
        hints = get_type_hints(hint)
        return {each.name: schema(hints[each.name]) for each in fields(hint)}
    if isinstance(hint, type) and issubclass(hint, Enum):
        return [each.value for each in hint]
    if get_args(hint):
        name = "UnionType" if isinstance(hint, UnionType) else type(hint).__name__  # since 3.14 one
        return [name, *map(schema, get_args(hint))]
    return getattr(hint, "__name__", str(hint))


def present() -> dict[str, object]:
    inputs = {each.kind: schema(each) for each in get_args(RecordedInput)}
    return {"format": FORMAT, "inputs": dict(sorted(inputs.items()))}


def test_the_format_is_raised_when_an_input_changes() -> None:
    """Raise `FORMAT`, add a migration, keep a drive in `drives/old`, then write inputs.json."""
    assert json.loads(json.dumps(present(), default=str)) == json.loads(COMMITTED.read_text())


@pytest.mark.parametrize("path", OLD, ids=lambda path: str(path.stem))
def test_a_drive_of_an_older_build_is_replayed(path: Path) -> None:
    drive = RecordedDrive([path])

    steps = list(play(drive))

    assert drive.format == 1
    assert "written by onboard 0.1.0 in format 1; this is onboard" in drive.origin()
    assert len(steps) > 500
    assert any(event.kind == "speed" for step in steps for event in step.events)
    assert {event.kind for step in steps for event in step.events} & {"lead", "sensor_lost"}


def test_a_difference_names_the_build_that_wrote_and_the_one_that_reads(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Its decisions are those of five hundred commits ago."""
    assert not expect([OLD[0]], OTHER_PROCESSOR)

    assert "written by onboard 0.1.0 in format 1; this is onboard" in capsys.readouterr().out
