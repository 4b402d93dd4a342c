"""The schema of the trace: every line fits it, and lines that are changed do not."""

import json
import re
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from typer.testing import CliRunner

from onboard.recorder.reader import RecordedDrive
from onboard.replay.replay import play
from onboard.tools.cli import app
from onboard.tools.schema_cli import TRACED, schema_of
from onboard.trace.trace_line import as_json, as_trace_record
from tests.architecture.syntax import ROOT

MESSAGES = {
    "answer", "bsm", "cam", "cpm", "denm", "inquiry", "join", "leave", "map", "psm", "reply",
    "sdsm", "spat", "update", "vam", "warn",
}  # fmt: skip
"""Traced as the content of `received` and `sent`."""
NOT_TRACED = MESSAGES | {
    "brake_button", "camera_image", "can", "driver_view", "entropy_input", "identity",
    "program_message", "recording_gap", "step", "wsm",
}  # fmt: skip
"""Inputs, and what recordings alone or the driver's page have."""
DRIVES = sorted((ROOT / "tests/drives").glob("*.mcap"))


def lines(path: Path) -> list[dict[str, Any]]:
    """Return the events that the present cores put out in a drive, as in a trace."""
    return [
        json.loads(as_json(as_trace_record(event) | {"traced_s": 0.0}))
        for step in play(RecordedDrive([path]))
        for event in step.events
    ]


def of(schema: dict[str, Any], kind: str) -> Draft202012Validator:
    return Draft202012Validator({"$ref": f"#/$defs/{kind}", "$defs": schema["$defs"]})


@pytest.fixture(scope="module")
def schema() -> dict[str, Any]:
    made = schema_of()
    Draft202012Validator.check_schema(made)
    return made


@pytest.mark.long
@pytest.mark.parametrize("path", DRIVES, ids=lambda path: str(path.stem))
def test_every_line_of_a_drive_fits(schema: dict[str, Any], path: Path) -> None:
    validators = {event.kind: of(schema, event.kind) for event in TRACED}
    shown = Counter[str]()
    for line in lines(path):
        shown[line["kind"]] += 1
        if shown[line["kind"]] <= 20:
            assert list(validators[line["kind"]].iter_errors(line)) == []

    assert len(shown) >= 8


def test_a_line_that_was_changed_does_not_fit(schema: dict[str, Any]) -> None:
    line = {
        "stamp_s": 1.0, "kind": "speed", "speed_m_s": 3.0, "resolution_m_s": 0.3, "source": "dbc",
        "traced_s": 1.1,
    }  # fmt: skip
    whole = Draft202012Validator(schema)

    assert whole.is_valid(line)
    assert whole.is_valid(line | {"resolution_m_s": "inf"})
    for changed in ({"kind": "sped"}, {"speed_m_s": "3"}, {"speed": 3.0}):
        assert not whole.is_valid(line | changed)
    assert not whole.is_valid({key: line[key] for key in line if key != "source"})


def test_the_command_prints_it(schema: dict[str, Any]) -> None:
    printed = CliRunner().invoke(app, ["schema"])

    assert json.loads(printed.stdout) == schema


def test_every_event_of_the_code_is_in_it() -> None:
    declared = re.compile(r'^    kind: ClassVar\[str\] = "(\w+)"$', re.MULTILINE)
    kinds = {
        kind
        for path in (ROOT / "onboard").rglob("*.py")
        for kind in declared.findall(path.read_text("utf-8"))
    }

    assert {event.kind for event in TRACED} == kinds - NOT_TRACED
