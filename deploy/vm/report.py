"""The table of a run, for people and for the docs."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from deploy.vm.drive import StatusRow


def table(
    rows: Sequence[StatusRow],
    failures: Sequence[str],
    took_s: Mapping[str, float],
    slowness: float,
) -> str:
    """Markdown: what happened in the guest, and how long each step took on this machine."""
    lines = [
        "| what happened | noticed after | whole again after | limit | |",
        "|---|---|---|---|---|",
        *(
            f"| {row.what} | {_seconds(row.noticed_s)} | {_seconds(row.whole_s)}"
            f" | {_seconds(row.limit_s)} | {row.remark if row.is_kept else 'MISSED'} |"
            for row in rows
        ),
        "",
        *(f"FAILED: {failure}" for failure in failures),
        f"Python ran {slowness:.0f} times slower in there than on the machine under it, where the"
        f" test took {sum(took_s.values()) / 60:.1f} min: "
        + ", ".join(f"{name} {taken:.0f} s" for name, taken in took_s.items())
        + ".",
    ]
    return "\n".join(lines)


def record(docs: Path, name: str, text: str) -> None:
    """Put the table into the page between the marks of `name`, in the place of the last."""
    begin, end = f"<!-- {name} -->", f"<!-- end of {name} -->"
    page = docs.read_text(encoding="utf-8")
    marked = f"{begin}\n{text}\n{end}"
    docs.write_text(re.sub(f"{begin}.*{end}", lambda _: marked, page, flags=re.DOTALL))


def _seconds(value: float | None) -> str:
    return "" if value is None else f"{value:.{2 if value > 0.1 else 3}f} s"
