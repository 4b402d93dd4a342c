"""A trace is read while a daemon writes it."""

from pathlib import Path

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
