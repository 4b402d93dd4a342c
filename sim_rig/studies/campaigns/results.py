"""Writes the results of a study: table.csv, figure.png, settings.yaml."""

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path

import yaml
from matplotlib.figure import Figure

from onboard.settings import Settings


def write_results(
    out_dir: Path,
    columns: Sequence[str],
    rows: Iterable[Sequence[object]],
    settings: Settings,
    figure: Figure | None = None,
) -> None:
    """Write the results; floats have six significant digits.

    Args:
        out_dir: folder, which is created if needed.
        columns: header of the table.
        rows: lines of the table.
        settings: of the study.
        figure: None for a study without a figure.
    """
    out_dir.mkdir(parents=True, exist_ok=True)
    with (out_dir / "table.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(columns)
        table.writerows([_six_digits(value) for value in row] for row in rows)
    tree = settings.model_dump(mode="json")
    (out_dir / "settings.yaml").write_text(yaml.safe_dump(tree, sort_keys=False), "utf-8")
    if figure is not None:
        figure.savefig(out_dir / "figure.png", dpi=110)


def _six_digits(value: object) -> object:
    return f"{value:.6g}" if isinstance(value, float) else value
