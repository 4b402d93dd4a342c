"""The table of ground truth of a recording.

A CSV with one row for each plate and frame. `file` names an image or video, `frame` is an index if
a file has several; either is enough. Unknown values are empty, or their columns are left out:
`x_px, y_px, w_px, h_px`, `text`, and `gap_m`, which marks the lead's plate. A row with a `gap_m` of
`inf` states that there is no lead.
"""

import csv
import math
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from onboard.errors import UserError
from onboard.observations import ImageBox
from onboard.tools.see.annotated_frame import AnnotatedFrame
from onboard.vision.recordings import IMAGE_SUFFIXES

_BOX = ("x_px", "y_px", "w_px", "h_px")
_ALLOWED = (
    "allowed are file or frame or both, and any of x_px, y_px, w_px, h_px (all four), "
    "text, gap_m (inf, and nothing else, if there is no lead)"
)


@dataclass(frozen=True, slots=True)
class TruePlate:
    """A true plate, or the statement that there is no lead."""

    box: ImageBox | None
    """`None` if unknown."""
    text: str
    """Upper case and without separators; empty if unknown."""
    gap_m: float | None
    """Gap of the lead's plate; infinite if there is no lead."""

    @property
    def is_labelled(self) -> bool:
        """Whether its box or text is known."""
        return self.box is not None or bool(self.text)


_Frames = defaultdict[int | None, list[TruePlate]]


class GroundTruth:
    """Ground truth of a recording."""

    def __init__(self, files: dict[str, _Frames]) -> None:
        """Take the plates of each file by frame.

        The frame `None` is that of an image file, the name "" stands for any file.
        """
        self._files = files
        self._by_short_name: defaultdict[str, list[str]] = defaultdict(list)
        for name in files:
            path = PurePosixPath(name)
            for short in {path.name, path.stem}:
                self._by_short_name[short].append(name)

    @classmethod
    def read(cls, path: Path) -> "GroundTruth":
        """Read the table.

        Raises:
            UserError: it is missing or has other columns, or a line is invalid.
        """
        files: dict[str, _Frames] = {}
        line = 1
        try:
            with path.open(newline="", encoding="utf-8-sig") as table:
                rows = csv.DictReader(table, skipinitialspace=True)
                names = rows.fieldnames or ()
                if not {"file", "frame"} & set(names) or not {*_BOX, "text", "gap_m"} & set(names):
                    raise UserError(f"{path}: has the columns {', '.join(names)}; {_ALLOWED}")
                for row in rows:
                    line += 1
                    cells = {name: (cell or "").strip() for name, cell in row.items() if name}
                    frame = int(cells["frame"]) if cells.get("frame") else None
                    frames = files.setdefault(cells.get("file", ""), defaultdict(list))
                    frames[frame].append(_true_plate(cells))
        except OSError as error:
            raise UserError(f"{path}: cannot be read: {error.strerror}") from error
        except (csv.Error, AttributeError, ValueError) as error:
            raise UserError(f"{path}:{line}: {error}; {_ALLOWED}") from error
        return cls(files)

    @property
    def example(self) -> str:
        """One of its files and frames, for messages."""
        for name, frames in self._files.items():
            for frame in frames:
                return f"{name or 'any file'}{'' if frame is None else f', frame {frame}'}"
        return "nothing"

    def of(self, frame: AnnotatedFrame) -> list[TruePlate] | None:
        """The plates of a frame; `None` if the table has no row for it.

        Raises:
            UserError: two files of the table match.
        """
        path = PurePosixPath(frame.frame.name)
        frames = self._files.get(frame.frame.name) or self._by(path.name) or self._by(path.stem)
        if frames is None:
            any_file = self._files.get("")
            return None if any_file is None else any_file.get(frame.index)
        if path.suffix.lower() in IMAGE_SUFFIXES and len(frames) == 1:
            return next(iter(frames.values()))  # its name identifies it
        return frames.get(frame.index) or frames.get(None)

    def _by(self, short_name: str) -> _Frames | None:
        names = self._by_short_name.get(short_name, [])
        if len(names) > 1:
            raise UserError(
                f"{short_name}: the ground truth has {' and '.join(names[:2])}; "
                f"give the folder above them to tell them apart"
            )
        return self._files[names[0]] if names else None


def _true_plate(cells: dict[str, str]) -> TruePlate:
    sides = [float(cells[name]) for name in _BOX if cells.get(name)]
    if len(sides) not in {0, len(_BOX)}:
        raise ValueError("a box needs four numbers")
    if sides and not (all(map(math.isfinite, sides)) and min(sides[2:]) > 0.0):
        raise ValueError(f"invalid box {', '.join(f'{side:g}' for side in sides)}")
    gap_m = float(cells["gap_m"]) if cells.get("gap_m") else None
    text = "".join(filter(str.isalnum, cells.get("text", "").upper()))
    if gap_m is not None and (not gap_m > 0.0 or (math.isinf(gap_m) and (sides or text))):
        raise ValueError(f"gap_m is {gap_m:g}")
    return TruePlate(ImageBox(*sides) if sides else None, text, gap_m)
