"""The results of a run, for the terminal and for the docs."""

from collections.abc import Iterator, Mapping, Sequence

from deploy.box_tests import BoxFigure
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


def figures(rows: Sequence[StatusRow]) -> Iterator[BoxFigure]:
    """Yield the results for the table of the docs; a row without times has its remark."""
    for row in rows:
        if row.detected_s is not None:
            yield BoxFigure(f"{row.fault}: detected", _seconds(row.detected_s), "s", "")
        if row.recovered_s is not None:
            yield BoxFigure(row.fault, _seconds(row.recovered_s), "s", _seconds(row.limit_s))
        elif row.detected_s is None:
            yield BoxFigure(row.fault, row.remark, "", "")


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
