"""How well plates were found and read, against a table of what is true.

The table is a CSV with the columns `file, x_px, y_px, w_px, h_px, text`; with `frame` (an index)
where one file has many frames, with `gap_m` where the distance to the lead is known.
"""

import csv
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from statistics import median

from onboard.errors import UserError
from onboard.observations import Box, Plate
from onboard.vision.seen_frame import SeenFrame

FOUND_IOU = 0.5
"""Intersection over union from which a plate counts as found."""


@dataclass(frozen=True, slots=True)
class TruePlate:
    """A plate that is there."""

    box: Box
    text: str
    gap_m: float | None


@dataclass(slots=True)
class Score:
    """Counts over some frames."""

    frames: int = 0
    plates: int = 0
    found: int = 0
    """At `FOUND_IOU`."""
    exact: int = 0
    """Found and every character right."""
    characters: int = 0
    characters_right: int = 0
    false_texts: int = 0
    """Texts where the table has no plate."""
    certain: int = 0
    """Texts said with at least the confidence asked for."""
    certain_wrong: int = 0
    gap_errors: list[float] = field(default_factory=list)
    """Of the lead's gap, as shares of the truth."""

    def as_row(self) -> dict[str, str]:
        """For people."""
        row = {
            "frames": str(self.frames),
            "plates": str(self.plates),
            "found": _share(self.found, self.plates),
            "exact": _share(self.exact, self.plates),
            "characters": _share(self.characters_right, self.characters),
            "false texts a frame": f"{self.false_texts / max(self.frames, 1):.3f}",
            "certain": _share(self.certain, self.plates),
            "wrong if certain": _share(self.certain_wrong, self.certain),
        }
        if self.gap_errors:
            row["gap error"] = f"{100 * median(abs(error) for error in self.gap_errors):.1f} %"
        return row


class Truth:
    """What is true of a recording."""

    def __init__(self, plates: dict[tuple[str, int | None], list[TruePlate]]) -> None:
        """`plates`: by file and frame; frame `None` where a file is one picture."""
        self._plates = plates

    @classmethod
    def read(cls, path: Path) -> "Truth":
        """Read the table.

        Raises:
            UserError: it is missing or has other columns; names the line.
        """
        plates: defaultdict[tuple[str, int | None], list[TruePlate]] = defaultdict(list)
        line = 1
        try:
            with path.open(newline="", encoding="utf-8") as table:
                for row in csv.DictReader(table):
                    line += 1
                    frame = int(row["frame"]) if row.get("frame") else None
                    box = Box(*(float(row[name]) for name in ("x_px", "y_px", "w_px", "h_px")))
                    gap_m = float(row["gap_m"]) if row.get("gap_m") else None
                    plates[row["file"], frame].append(TruePlate(box, row["text"], gap_m))
        except OSError as error:
            raise UserError(f"{path}: cannot be read: {error.strerror}") from error
        except (KeyError, TypeError, ValueError) as error:
            raise UserError(
                f"{path}:{line}: {error!r}; columns: file, x_px, y_px, w_px, h_px, text, and "
                "where they apply frame and gap_m"
            ) from error
        return cls(dict(plates))

    def of(self, seen: SeenFrame) -> list[TruePlate] | None:
        """The plates of a frame; `None` where the table does not speak of it."""
        for frame in (None, seen.index):
            exact = self._plates.get((seen.frame.name, frame))
            if exact is not None:
                return exact
        name = PurePosixPath(seen.frame.name).name
        return next(
            (
                plates
                for (file, frame), plates in self._plates.items()
                if frame in {None, seen.index} and PurePosixPath(file).name == name
            ),
            None,
        )


class Scores:
    """Adds up over frames, by the folder that each came from, and over all."""

    def __init__(self, truth: Truth, certain_from: float) -> None:
        self._truth = truth
        self._certain_from = certain_from
        self._by_folder: defaultdict[str, Score] = defaultdict(Score)

    def add(self, seen: SeenFrame) -> None:
        """Count one frame; one that the table does not speak of is left out."""
        truth = self._truth.of(seen)
        if truth is None:
            return
        folder = str(PurePosixPath(seen.frame.name).parent)
        for score in {"all": self._by_folder["all"], folder: self._by_folder[folder]}.values():
            self._count(score, seen, truth)

    def rows(self) -> Iterator[dict[str, str]]:
        """One for each folder, then all."""
        names = [*sorted(set(self._by_folder) - {"all", "."}), "all"]
        for name in names:
            yield {"": name} | self._by_folder[name].as_row()

    def _count(self, score: Score, seen: SeenFrame, truth: Iterable[TruePlate]) -> None:
        free = list(seen.plates)
        score.frames += 1
        for true in truth:
            score.plates += 1
            score.characters += len(true.text)
            best = max(free, key=lambda plate: overlap(plate.box, true.box), default=None)
            if best is None or overlap(best.box, true.box) <= 0.0:
                continue
            free.remove(best)
            score.found += overlap(best.box, true.box) >= FOUND_IOU
            text = best.text or ""
            score.exact += text == true.text
            score.characters_right += max(0, len(true.text) - edit_distance(text, true.text))
            self._count_certain(score, best, wrong=text != true.text)
            lead = seen.lead
            if true.gap_m is not None and best.is_lead and lead is not None and lead.gap_m:
                score.gap_errors.append(lead.gap_m / true.gap_m - 1.0)
        for plate in free:
            if plate.text is not None:
                score.false_texts += 1
                self._count_certain(score, plate, wrong=True)

    def _count_certain(self, score: Score, plate: Plate, *, wrong: bool) -> None:
        if plate.text is not None and plate.confidence >= self._certain_from:
            score.certain += 1
            score.certain_wrong += wrong


def overlap(one: Box, other: Box) -> float:
    """Intersection over union."""
    width = min(one.x_px + one.w_px, other.x_px + other.w_px) - max(one.x_px, other.x_px)
    height = min(one.y_px + one.h_px, other.y_px + other.h_px) - max(one.y_px, other.y_px)
    if width <= 0.0 or height <= 0.0:
        return 0.0
    both = width * height
    return both / (one.w_px * one.h_px + other.w_px * other.h_px - both)


def edit_distance(one: str, other: str) -> int:
    """Fewest insertions, deletions and substitutions (Levenshtein 1966)."""
    row = list(range(len(other) + 1))
    for index, character in enumerate(one, start=1):
        above_left, row[0] = row[0], index
        for column, wanted in enumerate(other, start=1):
            substituted = above_left + (character != wanted)
            above_left = row[column]
            row[column] = min(substituted, row[column] + 1, row[column - 1] + 1)
    return row[-1]


def _share(count: int, of: int) -> str:
    return f"{100 * count / of:.1f} %" if of else "-"
