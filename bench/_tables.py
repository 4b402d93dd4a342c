"""Writes measured tables into the pages of `docs/`."""

from collections.abc import Mapping
from pathlib import Path


def write_tables(page: Path, tables: Mapping[str, str]) -> None:
    """Write each Markdown table into the page, between the two comments with its name."""
    text = page.read_text(encoding="utf-8")
    for name, rows in tables.items():
        begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->\n"
        before, rest = text.split(begin)
        _, after = rest.split(end)
        text = f"{before}{begin}{rows}{end}{after}"
    page.write_text(text, encoding="utf-8")
