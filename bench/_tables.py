"""Measured tables, put into the pages of `docs/`."""

from collections.abc import Mapping
from pathlib import Path


def write_tables(page: Path, tables: Mapping[str, str]) -> None:
    """Put each table (Markdown) into the page, between the two marks of its name."""
    text = page.read_text(encoding="utf-8")
    for name, rows in tables.items():
        begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->\n"
        before, rest = text.split(begin)
        _, after = rest.split(end)
        text = f"{before}{begin}{rows}{end}{after}"
    page.write_text(text, encoding="utf-8")
