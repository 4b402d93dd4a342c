"""Writes the tables of LCCA messages and MVS footer into docs/wire.md, from their declarations."""

from itertools import takewhile
from pathlib import Path
from typing import Any

from onboard.messages.lcca import MESSAGES
from onboard.messages.mvs_footer import HEADER, MEASUREMENT, RUN, STATE
from onboard.messages.record import Record

PAGE = Path(__file__).parents[1] / "docs" / "wire.md"
END = "<!-- end -->\n"


def lcca_tables() -> str:
    """Return one table of the fields that begin every message, and one table a message."""
    names = zip(*(record.fields for record in MESSAGES.values()), strict=False)
    common = sum(1 for _ in takewhile(lambda each: len(set(each)) == 1, names))
    any_record = next(iter(MESSAGES.values()))
    return f"Every message begins with\n\n{any_record.table(end=common)}\n\n" + "\n".join(
        f"**{record.record.__name__}** (type {code}, user priority"
        f" {record.record.user_priority})\n\n{record.table(common)}\n"
        for code, record in MESSAGES.items()
    )


def footer_tables() -> str:
    """Return one table a part of the footer."""
    parts: dict[str, Record[Any]] = {
        "Header": HEADER,
        "Measurement": MEASUREMENT,
        "State": STATE,
        "Observer run": RUN,
    }
    return "\n".join(f"**{name}**\n\n{record.table()}\n" for name, record in parts.items())


def with_tables(page: str) -> str:
    """Return `page` with the tables of the present declarations."""
    for name, tables in (("lcca", lcca_tables), ("footer", footer_tables)):
        begin = f"<!-- {name} tables: python -m tools.wire_tables -->\n"
        before, _, rest = page.partition(begin)
        page = before + begin + tables() + END + rest.partition(END)[2]
    return page


if __name__ == "__main__":
    PAGE.write_text(with_tables(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
