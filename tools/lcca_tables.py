"""Writes the tables of the LCCA messages into docs/wire.md, from their declarations."""

from pathlib import Path

from onboard.messages.lcca import MESSAGES

PAGE = Path(__file__).parents[1] / "docs" / "wire.md"
BEGIN, END = "<!-- lcca tables: python tools/lcca_tables.py -->\n", "<!-- end -->\n"


def tables() -> str:
    """Return one table a message."""
    return "\n".join(
        f"**{record.record.__name__}** (type {code}, user priority"
        f" {record.record.user_priority})\n\n{record.table()}\n"
        for code, record in MESSAGES.items()
    )


def with_tables(page: str) -> str:
    """Return `page` with the tables of today."""
    before, _, rest = page.partition(BEGIN)
    return before + BEGIN + tables() + END + rest.partition(END)[2]


if __name__ == "__main__":
    PAGE.write_text(with_tables(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
