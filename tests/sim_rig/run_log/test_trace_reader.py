"""A trace is read while a daemon writes it."""

from pathlib import Path

import pytest

from sim_rig.run_log.run_log import read_trace
from sim_rig.run_log.trace_reader import TraceReader


def test_a_growing_trace_is_read_in_complete_lines(tmp_path: Path) -> None:
    path = tmp_path / "red.jsonl"
    reader = TraceReader(path)
    assert reader.records() == []

    path.write_text('{"kind":"speed","stamp_s":1}\n{"kind":"le')
    assert [record["kind"] for record in reader.records()] == ["speed"]
    assert reader.records() == []
    with path.open("a") as trace:
        trace.write('ad","stamp_s":2}\n')
    assert [record["kind"] for record in reader.records()] == ["lead"]


def test_the_trace_of_a_daemon_that_was_started_anew_is_read_from_its_beginning(
    tmp_path: Path,
) -> None:
    """Between two calls, the rig renames the one before a power cut, and another one begins."""
    path = tmp_path / "red.jsonl"
    reader = TraceReader(path)
    path.write_text('{"kind":"speed","stamp_s":1}\n')
    assert len(reader.records()) == 1

    path.rename(tmp_path / "red-1.jsonl")
    path.write_text('{"kind":"ready","stamp_s":2}\n{"kind":"speed","stamp_s":3}\n')
    assert [record["stamp_s"] for record in reader.records()] == [2, 3]


def test_a_line_that_is_no_object_is_a_mistake_in_both_ways_to_read_a_trace(
    tmp_path: Path,
) -> None:
    path = tmp_path / "red.jsonl"
    path.write_text("[]\n")

    with pytest.raises(ValueError, match="a line is no JSON object"):
        read_trace(path)
    with pytest.raises(ValueError, match="a line is no JSON object"):
        TraceReader(path).records()
