"""Scores of detection, reading and the lead, against ground truth."""

import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from statistics import median

from onboard.observations import Lead, Plate
from onboard.tools.see.annotated_frame import AnnotatedFrame
from onboard.tools.see.ground_truth import GroundTruth, TruePlate
from onboard.vision.vehicle_finder import overlap

FOUND_IOU = 0.5
"""Intersection over union from which a plate counts as found."""
SAME_GAP, SAME_TEXT = 0.25, 0.5
"""Relative error of a gap, and share of wrong characters, up to which both are of one vehicle."""


@dataclass(slots=True)
class Score:
    """Counts over some frames."""

    frames: int = 0
    plates: int = 0
    boxes: int = 0
    found: int = 0
    """Boxes that were found at `FOUND_IOU`."""
    texts: int = 0
    exact: int = 0
    """Texts with every character right."""
    characters: int = 0
    characters_right: int = 0
    false_texts: int = 0
    """Reported texts without a true plate."""
    certain: int = 0
    """Texts with a reading of the required confidence."""
    certain_wrong: int = 0
    """Certain readings that are wrong."""
    certain_false: int = 0
    """False texts with the required confidence."""
    leads: int = 0
    leads_right: int = 0
    """Leads that were reported as lead."""
    without_lead: int = 0
    """Frames without a true lead."""
    false_leads: int = 0
    """Frames without a true lead in which one was reported."""
    gap_errors: list[float] = field(default_factory=list)
    """Relative errors of the gap: of leads that were right, and of rows that state only a gap."""

    def as_row(self) -> dict[str, str]:
        """Values as text, for the terminal."""
        row = {
            "frames": str(self.frames),
            "plates": str(self.plates),
            "found": _share(self.found, self.boxes),
            "exact": _share(self.exact, self.texts),
            "characters": _share(self.characters_right, self.characters),
            "false texts a frame": f"{self.false_texts / max(self.frames, 1):.3f}",
            "certain": _share(self.certain, self.texts),
            "wrong if certain": _share(
                self.certain_wrong + self.certain_false, self.certain + self.certain_false
            ),
        }
        if self.leads:
            row["right lead"] = _share(self.leads_right, self.leads)
        if self.without_lead:
            row["false lead"] = _share(self.false_leads, self.without_lead)
        if self.gap_errors:
            row["gap error"] = f"{100 * median(abs(error) for error in self.gap_errors):.1f} %"
        return row


class Scores:
    """Sums over frames, by the folder of each, and in all."""

    def __init__(self, truth: GroundTruth, certain_from: float) -> None:
        """Start at zero; readings of a confidence `certain_from` or more are certain."""
        self.truth = truth
        self._certain_from = certain_from
        self._by_folder: defaultdict[str, Score] = defaultdict(Score)

    def add(self, frame: AnnotatedFrame) -> None:
        """Count one frame, if the ground truth has it."""
        truth = self.truth.of(frame)
        if truth is None:
            return
        folder = str(PurePosixPath(frame.frame.name).parent)
        for score in {"all": self._by_folder["all"], folder: self._by_folder[folder]}.values():
            self._count(score, frame, truth)

    def rows(self) -> Iterator[dict[str, str]]:
        """One row for each folder, then all."""
        names = [*sorted(set(self._by_folder) - {"all", "."}), "all"]
        for name in names:
            yield {"": name} | self._by_folder[name].as_row()

    @property
    def frames(self) -> int:
        """Frames that the ground truth has."""
        return self._by_folder["all"].frames

    def _count(self, score: Score, frame: AnnotatedFrame, truth: list[TruePlate]) -> None:
        unmatched = list(frame.plates)
        score.frames += 1
        for true in truth:
            if true.gap_m == math.inf:
                score.without_lead += 1
                score.false_leads += frame.lead is not None and frame.lead.gap_m is not None
                continue
            best = _best(unmatched, true)
            if best is not None:
                unmatched.remove(best)
            self._count_plate(score, best, true)
            if true.gap_m is not None:
                _count_lead(score, best, true, frame.lead)
        if not any(true.is_labelled for true in truth):
            return
        for plate in unmatched:
            if plate.text is not None:
                score.false_texts += 1
                score.certain_false += self._is_certain(plate)

    def _count_plate(self, score: Score, best: Plate | None, true: TruePlate) -> None:
        score.plates += true.is_labelled
        score.boxes += true.box is not None
        score.texts += bool(true.text)
        score.characters += len(true.text)
        if best is None:
            return
        score.found += true.box is not None and overlap(best.box, true.box) >= FOUND_IOU
        if true.text:
            text = best.text or ""
            score.exact += text == true.text
            score.characters_right += max(0, len(true.text) - edit_distance(text, true.text))
            if self._is_certain(best):
                score.certain += 1
                score.certain_wrong += text != true.text

    def _is_certain(self, plate: Plate) -> bool:
        return plate.text is not None and plate.confidence >= self._certain_from


def _best(plates: list[Plate], true: TruePlate) -> Plate | None:
    """The reported plate of a true one: by its position, else by its text, else the lead's."""
    if true.box is not None:
        place = true.box
        best = max(plates, key=lambda plate: overlap(plate.box, place), default=None)
        return best if best is not None and overlap(best.box, place) > 0.0 else None
    if true.text:
        text = true.text
        return min(plates, key=lambda plate: edit_distance(plate.text or "", text), default=None)
    return next((plate for plate in plates if plate.is_lead), None)


def _count_lead(score: Score, best: Plate | None, true: TruePlate, lead: Lead | None) -> None:
    """Count the lead; without a plate that is surely the true one, its gap decides."""
    score.leads += 1
    if lead is None or lead.gap_m is None or true.gap_m is None:
        return
    error = lead.gap_m / true.gap_m - 1.0
    is_right = (
        best.is_lead if best is not None and _is_surely(best, true) else abs(error) <= SAME_GAP
    )
    score.leads_right += is_right
    if is_right or not true.is_labelled:
        score.gap_errors.append(error)


def _is_surely(plate: Plate, true: TruePlate) -> bool:
    """Whether `plate`, the best match, is certainly the true one."""
    if true.box is not None:
        return True
    wrong = edit_distance(plate.text or "", true.text)
    return bool(true.text) and wrong <= SAME_TEXT * len(true.text)


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
