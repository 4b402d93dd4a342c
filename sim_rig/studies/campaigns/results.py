"""Writes the results of a study: table.csv and settings.yaml."""

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path

import yaml

from onboard.settings import Settings


def write_table(out_dir: Path, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Write a table into a folder, which is created if needed; floats have six digits."""
    out_dir.mkdir(parents=True, exist_ok=True)
    with (out_dir / "table.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(columns)
        table.writerows([_six_digits(value) for value in row] for row in rows)


def write_settings(out_dir: Path, settings: Settings) -> None:
    """Write settings into a folder, which is created if needed."""
    out_dir.mkdir(parents=True, exist_ok=True)
    tree = settings.model_dump(mode="json")
    (out_dir / "settings.yaml").write_text(yaml.safe_dump(tree, sort_keys=False), "utf-8")


def _six_digits(value: object) -> object:
    return f"{value:.6g}" if isinstance(value, float) else value
