"""Traces and captures on disk."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from onboard.trace.trace_file import TraceFile


@pytest.fixture(autouse=True)
def an_umask_that_hides_nothing() -> Iterator[None]:
    before = os.umask(0)
    yield
    os.umask(before)


def test_only_its_owner_may_read_a_trace_since_it_has_plates(tmp_path: Path) -> None:
    with TraceFile(tmp_path / "trace.jsonl", print) as trace:
        trace.write(b"{}\n")

    assert (tmp_path / "trace.jsonl").stat().st_mode & 0o777 == 0o600


def test_a_trace_that_others_could_read_is_theirs_no_more(tmp_path: Path) -> None:
    path = tmp_path / "trace.jsonl"
    path.write_text("of an earlier drive")
    path.chmod(0o644)

    with TraceFile(path, print) as trace:
        trace.write(b"{}\n")

    assert path.stat().st_mode & 0o777 == 0o600
    assert path.read_text() == "{}\n"


def test_a_full_disk_ends_the_file_and_is_reported_once() -> None:
    reasons: list[str] = []
    with TraceFile(Path("/dev/full"), reasons.append) as trace:
        for _ in range(2):
            trace.write(b"{}")
            trace.flush()

    assert reasons == ["/dev/full: No space left on device"]


def test_lines_gather_until_they_are_flushed_or_the_file_is_closed(tmp_path: Path) -> None:
    path = tmp_path / "trace.jsonl"
    with TraceFile(path, print) as trace:
        trace.write(b"1\n")
        trace.write(b"2\n")
        before = path.read_text()
        trace.flush()
        flushed = path.read_text()
        trace.write(b"3\n")

    assert (before, flushed, path.read_text()) == ("", "1\n2\n", "1\n2\n3\n")
