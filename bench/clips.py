"""Answers on dashcam clips by the schedule of a car, beside what a person sees in them.

`python -m bench clips` prints the figures, `python -m bench.clips` writes the table into
`docs/vision.md`. The clips are not part of the repository (`RIG_DATA` names their folder).

`clip_labels.csv` was made by hand: every 8th, 12th, 4th and 14th frame of the clips was looked at,
enlarged two to four times, and the vehicles outlined, to some 3 px; those of other lanes, and far
or unsure ones ahead, in every second to fourth of these frames, and linearly in between. Distances
follow from the outlines' width and from the focal length that the lane's markings give. A row is a
vehicle; `lane` is `own`, `other` or `unsure` (on the line, or the lane's course is not seen), or
says that the own lane is `free` as far as one sees. Of `night-street` and `barrier-shadow`, where
ghosts are judged, six and sixteen frames were outlined coarsely, to some 10 px. `distance_m` is a
class, and given for the own lane only.
"""

import csv
import os
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2

from bench import Figure
from bench._tables import write_tables
from onboard.observations import ImageBox, Lead, LeadIdentity
from onboard.tools.see.annotated_frame import AnnotatedFrame, annotate_frames
from onboard.vision.networks import load_perception
from onboard.vision.perception import Perception
from onboard.vision.recordings import VideoFile
from onboard.vision.settings import VisionSettings
from onboard.vision.vehicle_finder import overlap

LABELS = Path(__file__).with_name("clip_labels.csv")
PAGE = Path(__file__).parents[1] / "docs" / "vision.md"
WITHIN_60_M = frozenset({"<30", "30-60"})
CAMERA_FPS = 15.0
"""Frames a second of a camera in a car."""
GHOST_M = 30.0
"""Gap below which a lead without a vehicle is counted as a ghost."""
ABSURD_S, ABSURD_M_S = 1.0, 40.0
"""Time to collision below which, and closing speed from which, a row is absurd: no clip has a
collision, or two vehicles that meet. In `barrier-shadow`, one is a second away when the driver
swerves around it."""


@dataclass(frozen=True, slots=True)
class LabelledFrame:
    """What a person sees in one frame."""

    own: ImageBox | None
    """The lead in the own lane within 60 m."""
    is_free: bool
    """Whether the own lane is free as far as one sees."""
    vehicles: tuple[ImageBox, ...]
    """All of any lane."""


@dataclass(slots=True)
class ClipTally:
    """Answers on one clip."""

    with_vehicle: int = 0
    """Labelled frames with a lead within 60 m; each is one of the next three."""
    found: int = 0
    """The lead is that vehicle."""
    unknown: int = 0
    """The answer is `unknown`, without a gap."""
    no_lead: int = 0
    free: int = 0
    """Labelled frames with a free lane."""
    said_free: int = 0
    """Of these, with `no_lead`."""
    ghosts_s: list[float] = field(default_factory=list)
    """Durations for which a lead nearer than `GHOST_M` was on no vehicle."""
    absurd: int = 0
    """Frames with an absurd gap or closing speed."""


def labels(file: Path = LABELS) -> dict[str, dict[int, LabelledFrame]]:
    """Labelled frames of each clip, by their number."""
    rows: defaultdict[tuple[str, int], list[dict[str, str]]] = defaultdict(list)
    with file.open(newline="", encoding="utf-8") as table:
        for row in csv.DictReader(table):
            rows[row["clip"], int(row["frame"])].append(row)
    clips: defaultdict[str, dict[int, LabelledFrame]] = defaultdict(dict)
    for (clip, frame), vehicles in rows.items():
        own = [v for v in vehicles if v["lane"] == "own" and v["distance_m"] in WITHIN_60_M]
        clips[clip][frame] = LabelledFrame(
            _box(own[0]) if own else None,
            any(each["lane"] == "free" for each in vehicles),
            tuple(_box(each) for each in vehicles if each["x_px"]),
        )
    return dict(clips)


def _box(row: Mapping[str, str]) -> ImageBox:
    return ImageBox(*(float(row[name]) for name in ("x_px", "y_px", "w_px", "h_px")))


def score(frames: Iterable[AnnotatedFrame], truth: Mapping[int, LabelledFrame]) -> ClipTally:
    """Score a clip's frames by its labelled ones, at least one."""
    tally, ghost_since = ClipTally(), None
    stamp_s = 0.0
    for frame in frames:
        lead, stamp_s = frame.lead, frame.frame.stamp_s
        if lead is None:
            continue
        if frame.index in truth:
            _count(tally, lead, truth[frame.index])
        tally.absurd += _is_absurd(lead)
        if _is_ghost(lead, frame.index, truth):
            ghost_since = stamp_s if ghost_since is None else ghost_since
        elif ghost_since is not None:
            tally.ghosts_s.append(stamp_s - ghost_since)
            ghost_since = None
    if ghost_since is not None:
        tally.ghosts_s.append(stamp_s - ghost_since)
    return tally


def _count(tally: ClipTally, lead: Lead, truth: LabelledFrame) -> None:
    is_no_lead = lead.identity is LeadIdentity.NO_LEAD
    tally.free += truth.is_free
    tally.said_free += truth.is_free and is_no_lead
    if truth.own is not None:
        tally.with_vehicle += 1
        tally.found += lead.box is not None and overlap(lead.box, truth.own) > 0.0
        tally.unknown += lead.gap_m is None and not is_no_lead
        tally.no_lead += is_no_lead


def _is_absurd(lead: Lead) -> bool:
    if lead.gap_m is None or lead.closing_speed_m_s is None:
        return False
    closing_m_s = lead.closing_speed_m_s
    return abs(closing_m_s) >= ABSURD_M_S or closing_m_s * ABSURD_S > lead.gap_m


def _is_ghost(lead: Lead, index: int, truth: Mapping[int, LabelledFrame]) -> bool:
    """Whether it is near, and on no vehicle of the labelled frames before and after it."""
    if lead.gap_m is None or lead.gap_m >= GHOST_M:
        return False
    if lead.box is None:
        return True
    numbers = sorted(truth)
    around = {max((n for n in numbers if n <= index), default=numbers[0])}
    around.add(min((n for n in numbers if n >= index), default=numbers[-1]))
    boxes = [box for number in around for box in truth[number].vehicles]
    return all(overlap(lead.box, box) == 0.0 for box in boxes)


def measured() -> dict[str, ClipTally]:
    """Run each labelled clip as the daemon does: some 15 pictures a second, its search schedule."""
    cv2.setNumThreads(1)
    folder = Path(os.environ.get("RIG_DATA", Path(__file__).parents[2] / "shared" / "data"))
    tallies = {}
    for clip, truth in labels().items():
        video = VideoFile(str(folder / "clips" / f"{clip}.mp4"), None)
        perception = load_perception(None, VisionSettings())
        tallies[clip] = score(_annotated(video, perception), truth)
    return tallies


def _annotated(video: VideoFile, perception: Perception) -> Iterator[AnnotatedFrame]:
    """Every second frame of 25 or 30 a second; the labelled ones are among them."""
    every = max(1, round(video.fps / CAMERA_FPS))
    for index, frame in enumerate(video):
        if index % every == 0:
            (annotated,) = annotate_frames([frame], perception)
            yield replace(annotated, index=index)


def measure() -> Iterator[Figure]:
    """Shares of frames with a lead in which it is found, and ghosts, by clip."""
    for clip, tally in measured().items():
        longest_s = max(tally.ghosts_s, default=0.0)
        yield Figure(f"clips.{clip}.longest_ghost", longest_s, "s", 1, "the longest allowed", 0.3)
        if tally.with_vehicle:
            for name in ("found", "unknown", "no_lead"):
                share = getattr(tally, name) / tally.with_vehicle
                yield Figure(
                    f"clips.{clip}.{name}", share, "per frame", tally.with_vehicle, "a person", 1.0
                )


def table(tallies: Mapping[str, ClipTally]) -> str:
    """One row a clip, as Markdown."""
    heads = "clip", "vehicle", "found", "unknown", "no lead", "ghosts", "absurd"
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for clip, tally in tallies.items():
        ghosts = f"{sum(tally.ghosts_s):.1f} s" if tally.ghosts_s else "none"
        cells = (
            clip,
            tally.with_vehicle,
            tally.found,
            tally.unknown,
            tally.no_lead,
            ghosts,
            tally.absurd,
        )
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write the table into the page, between its marks."""
    write_tables(PAGE, {"clips": table(measured())})


if __name__ == "__main__":
    main()
