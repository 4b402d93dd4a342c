"""What a study leaves behind: table.csv, figure.png, settings.yaml."""

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
    """Write all three; numbers with six digits."""
    out_dir.mkdir(parents=True, exist_ok=True)
    with (out_dir / "table.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(columns)
        table.writerows([_short(value) for value in row] for row in rows)
    tree = settings.model_dump(mode="json")
    (out_dir / "settings.yaml").write_text(yaml.safe_dump(tree, sort_keys=False), "utf-8")
    if figure is not None:
        figure.savefig(out_dir / "figure.png", dpi=110)


def _short(value: object) -> object:
    return f"{value:.6g}" if isinstance(value, float) else value
