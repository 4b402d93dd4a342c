"""The table of a run, for the terminal and for the docs."""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

from deploy.vm.drive import StatusRow


def table(
    rows: Sequence[StatusRow],
    failures: Sequence[str],
    took_s: Mapping[str, float],
    slowness: float,
) -> str:
    """Format the results in the guest, and the duration of each step on this machine, as Markdown.

    Args:
        rows: results.
        failures: messages of failed steps.
        took_s: duration of each step on this machine.
        slowness: run time of Python in the guest relative to this machine.
    """
    lines = [
        "| fault | detected after, s | recovered after, s (limit) |",
        "|---|---|---|",
        *map(_line, rows),
        "",
        *(f"FAILED: {failure}" for failure in failures),
        f"Python ran {slowness:.0f} times slower in the guest than on the host, where the test took"
        f" {sum(took_s.values()) / 60:.1f} min: "
        + ", ".join(f"{name} {taken:.0f} s" for name, taken in took_s.items())
        + ".",
    ]
    return "\n".join(lines)


def record(file: Path, rows: Sequence[StatusRow]) -> None:
    """Write the results as CSV."""
    with file.open("w", newline="", encoding="utf-8") as opened:
        writer = csv.writer(opened, lineterminator="\n")
        writer.writerow(("fault", "detected_s", "recovered_s", "limit_s", "remark"))
        for row in rows:
            times = (row.detected_s, row.recovered_s, row.limit_s)
            writer.writerow((row.fault, *map(_seconds, times), row.remark))


def _line(row: StatusRow) -> str:
    remark = row.remark if row.is_kept else "MISSED"
    cells = [
        f"{row.fault} ({remark})" if remark else row.fault,
        _seconds(row.detected_s),
        _seconds(row.recovered_s) + ("" if row.limit_s is None else f" ({_seconds(row.limit_s)})"),
    ]
    return f"| {' | '.join(cells)} |".replace("|  |", "| |").replace("|  |", "| |")


def _seconds(value: float | None) -> str:
    return "" if value is None else f"{value:.{2 if value > 0.1 else 3}f}"
