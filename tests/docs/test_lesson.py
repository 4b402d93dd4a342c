"""The lesson: its commands work as they stand there, and show what it says."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.docs.test_pages import ROOT

PAGE = (ROOT / "docs" / "lesson.md").read_text(encoding="utf-8")


def at_s(drive: Path, level: str) -> float:
    """When the alarm of a level begins, from the start of the drive."""
    records = [json.loads(line) for line in drive.read_text("utf-8").splitlines()]
    alarms = [each for each in records if each["kind"] == "alarm" and each["level"] == level]
    return round(float(alarms[0]["stamp_s"]) - 1_750_000_000, 1)


@pytest.mark.long
def test_the_commands_of_the_lesson_lead_to_a_warning_and_to_a_later_one(tmp_path: Path) -> None:
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    commands = re.findall(r"(?m)^    (.*)$", PAGE)
    printed = [
        subprocess.run(
            ["sh", "-c", command],
            cwd=tmp_path,
            env=os.environ | {"PATH": path, "PYTHONPATH": str(ROOT)},
            capture_output=True,
            text=True,
            check=True,
            timeout=300,
        ).stdout
        for command in commands
    ]

    assert len(commands) == 9
    assert printed[2].startswith("RD288HX (")
    first, later = tmp_path / "drive.jsonl", tmp_path / "later.jsonl"
    caution_s, warning_s = at_s(first, "caution"), at_s(first, "warning")
    assert f"comes {caution_s:.1f} s after the start" in " ".join(PAGE.split())
    assert f"a warning {warning_s - caution_s:.1f} s later" in PAGE
    assert f"comes {at_s(later, 'warning') - warning_s:.1f} s later" in PAGE
