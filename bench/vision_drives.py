"""Identity, gap and selection of the lead, on rendered drives in different light.

`python -m bench vision_drives` prints the figures, `python -m bench.vision_drives` writes them into
`docs/vision.md`. The reference is an AR tag of 0.3 m on the same vehicle and drive: its code
detects errors, and its sides are measured to a twentieth of a pixel.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np

from bench import Figure
from bench._named_lead import SPEED_M_S, named_after_s
from bench._tables import write_tables
from onboard.observations import Lead
from onboard.security.plate_digest import normalised
from onboard.tools.see.annotated_frame import AnnotatedFrame, annotate_frames
from onboard.vision.frames import Frame
from onboard.vision.perception import Perception
from onboard.vision.plate_detector import PlateDetector
from onboard.vision.plate_reader import PlateReader
from onboard.vision.settings import CameraSettings, VisionSettings
from onboard.vision.sized_camera import Networks
from onboard.vision.syntax import PlateSyntax
from onboard.vision.vehicle_finder import VehicleFinder
from sim_rig.rendering.plate_art import FORMATS
from sim_rig.rendering.plate_texts import text_of
from sim_rig.rendering.scene import CameraRenderer, Light, Scene, SceneCar

CAMERA = CameraSettings(source="rendered", focal_x_px=2000.0, focal_y_px=2000.0, pitch_rad=0.02)
WIDE_CAMERA = CAMERA.model_copy(update={"focal_x_px": 721.0, "focal_y_px": 721.0})
FPS, SECONDS, DRIVES = 10.0, 1.5, 6
GAPS_M = {
    CAMERA.focal_x_px: (14.0, 20.0, 25.0, 30.0),
    WIDE_CAMERA.focal_x_px: (5.0, 8.0, 11.0),
}
DRIVES_A_GAP = 30
"""Two in each light and format."""
PITCHES_RAD, SWAY_M = (-0.002, -0.0013, -0.0007, 0.0, 0.0007, 0.0013, 0.002), 0.08
"""By which the camera pitches from frame to frame, and how far the lead sways in its lane: on a
real road, a plate does not lie on the same pixels in every frame."""
PAGE = Path(__file__).parents[1] / "docs" / "vision.md"
IMAGE = PAGE.parent / "pictures" / "vision-seen.png"
SERIES, PATTERN = "LL###LL", "[A-Z]{2}[0-9]{3}[A-Z]{2}"
"""Series of all plates, and its pattern for `vision.plate_patterns`."""
_TAG_SIDE_M = 0.3


@dataclass(frozen=True, slots=True)
class RenderedDrive:
    """A lead at a constant gap, with a nearer vehicle in the next lane, in one light."""

    camera: CameraSettings
    light: Light
    gap_m: float
    cars: tuple[SceneCar, ...]
    """The lead first."""
    seed: int

    @property
    def text(self) -> str:
        """The lead's plate, or its tag."""
        lead = self.cars[0]
        return lead.plate if lead.plate is not None else f"TAG{lead.tag_id}"

    def with_tags(self) -> "RenderedDrive":
        """The same drive with AR tags instead of plates."""
        tagged = (
            replace(car, plate=None, tag_id=number, tag_side_m=_TAG_SIDE_M)
            for number, car in enumerate(self.cars)
        )
        return replace(self, cars=tuple(tagged))


@dataclass(slots=True)
class DriveTally:
    """Results of some drives."""

    drives: int = 0
    named_in_time: int = 0
    """Drives whose lead is identified within a second, if it answers over the radio."""
    named_with_series: int = 0
    """The same if perception is told the series."""
    known_in_time: int = 0
    """Drives whose lead the camera alone identifies within a second."""
    wrong_identities: int = 0
    """Frames with another identity (O and 0 are one there, as are I and 1)."""
    frames: int = 0
    """Frames from one second on."""
    right_lead: int = 0
    """Of these, frames with the right lead."""
    gap_errors: list[float] = field(default_factory=list)
    """Relative errors of the gap."""
    in_sigmas: list[float] = field(default_factory=list)

    def add(self, drive: RenderedDrive, leads: list[Lead]) -> None:
        """Count one drive."""
        self.drives += 1
        read = [(lead, normalised(lead.text)) for lead in leads if lead.text is not None]
        identity = normalised(drive.text)
        named_s = named_after_s(drive.text, leads)
        self.named_in_time += named_s is not None and named_s <= 1.0
        self.known_in_time += any(text == identity for lead, text in read if lead.stamp_s <= 1.0)
        self.wrong_identities += sum(text != identity for _, text in read)
        for lead in leads:
            if lead.stamp_s < 1.0:
                continue
            self.frames += 1
            if lead.gap_m is None or lead.gap_sigma_m is None:
                continue
            error_m = lead.gap_m - drive.gap_m
            # The vehicle in the next lane is a third nearer.
            self.right_lead += abs(error_m) < 0.2 * drive.gap_m
            self.gap_errors.append(abs(error_m) / drive.gap_m)
            self.in_sigmas.append(abs(error_m) / lead.gap_sigma_m)


def measure() -> Iterator[Figure]:
    """Identity and lead by light; gap error by distance."""
    cv2.setNumThreads(1)
    plates, tags = by_light(tags=False), by_light(tags=True)
    for light in Light:
        mine, theirs = plates[light], tags[light]
        for name in ("named_in_time", "known_in_time", "right_lead"):
            of = "frames" if name == "right_lead" else "drives"
            yield Figure(
                f"vision_drives.{light}.{name}",
                getattr(mine, name) / getattr(mine, of),
                f"per {of.rstrip('s')}",
                getattr(mine, of),
                "AR tags in the same drives",
                getattr(theirs, name) / getattr(theirs, of),
            )
    plates_by_gap, tags_by_gap = by_gap(CAMERA, tags=False), by_gap(CAMERA, tags=True)
    for gap_m in plates_by_gap:
        mine, theirs = plates_by_gap[gap_m], tags_by_gap[gap_m]
        if mine.gap_errors and theirs.gap_errors:
            yield Figure(
                f"vision_drives.gap_error.{gap_m:.0f}_m",
                float(np.median(mine.gap_errors)),
                "share of the gap",
                len(mine.gap_errors),
                "AR tags in the same drives",
                float(np.median(theirs.gap_errors)),
            )


def by_light(*, tags: bool) -> dict[Light, DriveTally]:
    """Drives at the gaps of dense traffic, in each light."""
    tallies = {light: DriveTally() for light in Light}
    rng = np.random.default_rng(11)
    for light in Light:
        for seed in range(DRIVES):
            drive = rendered_drive(CAMERA, light, float(rng.uniform(7.0, 15.0)), seed, rng)
            _add_drive(tallies[light], drive, tags=tags)
    return tallies


def by_gap(camera: CameraSettings, *, tags: bool) -> dict[float, DriveTally]:
    """Drives at each gap, in alternating light."""
    return {gap_m: at_gap(camera, gap_m, tags=tags) for gap_m in GAPS_M[camera.focal_x_px]}


def at_gap(camera: CameraSettings, gap_m: float, *, tags: bool = False) -> DriveTally:
    """Drives at one gap."""
    tally, rng = DriveTally(), np.random.default_rng([12, round(camera.focal_x_px), round(gap_m)])
    for seed in range(DRIVES_A_GAP):
        light = list(Light)[seed // len(FORMATS) % len(Light)]
        _add_drive(tally, rendered_drive(camera, light, gap_m, seed, rng), tags=tags)
    return tally


def annotated_frames(
    drive: RenderedDrive, patterns: tuple[str, ...] = ()
) -> Iterator[AnnotatedFrame]:
    """Frames of a drive with the events of perception, which may be told the series."""
    rng = np.random.default_rng(drive.seed)

    def frames() -> Iterator[Frame]:
        for index in range(round(SECONDS * FPS)):
            sway_m = SWAY_M * float(np.sin(2.5 * index / FPS + drive.seed))
            lead = replace(drive.cars[0], lateral_m=drive.cars[0].lateral_m + sway_m)
            travelled_m = SPEED_M_S * index / FPS
            scene = Scene((lead, *drive.cars[1:]), light=drive.light, travelled_m=travelled_m)
            renderer = _renderer(drive.camera.focal_x_px, float(rng.choice(PITCHES_RAD)))
            yield Frame(index / FPS, renderer.draw(scene, rng))

    settings = VisionSettings(tag_side_m=_TAG_SIDE_M, plate_patterns=patterns)
    networks = Networks(_FINDER, _reader(patterns), _VEHICLES)
    perception = Perception(drive.camera, settings, networks)
    yield from annotate_frames(frames(), perception)


@cache
def _renderer(focal_px: float, pitch_rad: float) -> CameraRenderer:
    focal = {"focal_x_px": focal_px, "focal_y_px": focal_px}
    pitch = {"pitch_rad": CAMERA.pitch_rad + pitch_rad}
    return CameraRenderer(CAMERA.model_copy(update=focal | pitch))


_FINDER = PlateDetector()
_VEHICLES = VehicleFinder()


@cache
def _reader(patterns: tuple[str, ...]) -> PlateReader:
    return PlateReader(syntax=PlateSyntax(patterns))


def rendered_drive(
    camera: CameraSettings, light: Light, gap_m: float, seed: int, rng: np.random.Generator
) -> RenderedDrive:
    """Return a drive behind a vehicle with a random plate, and another in the next lane.

    Args:
        camera: that sees it.
        light: of all its frames.
        gap_m: to the lead.
        seed: of the noise of its frames; chooses the format of the plates.
        rng: draws vehicles and plates.
    """
    formats = list(FORMATS.values())

    def car(ahead_m: float, lateral_m: float) -> SceneCar:
        blue, green, red = (int(channel) for channel in rng.integers(20, 220, 3))
        return SceneCar(
            ahead_m,
            lateral_m,
            plate=text_of(SERIES, rng, rare=0.0),
            plate_format=formats[seed % len(formats)],
            colour_bgr=(blue, green, red),
        )

    lead = car(gap_m, float(rng.uniform(-0.4, 0.4)))
    # Nearer, and as far to the side as the frame shows.
    shown_m = 0.28 * 0.67 * gap_m * CAMERA.focal_x_px / camera.focal_x_px
    side_m = float(rng.choice([-1.0, 1.0])) * min(3.5, shown_m)
    cars = (lead, car(0.67 * gap_m, side_m)) if abs(side_m) > 2.2 else (lead,)
    return RenderedDrive(camera, light, gap_m, cars, seed)


def _add_drive(tally: DriveTally, drive: RenderedDrive, *, tags: bool) -> None:
    shown = drive.with_tags() if tags else drive
    tally.add(shown, _leads(shown))
    if not tags:
        named_s = named_after_s(shown.text, _leads(shown, (PATTERN,)))
        tally.named_with_series += named_s is not None and named_s <= 1.0


def _leads(drive: RenderedDrive, patterns: tuple[str, ...] = ()) -> list[Lead]:
    return [frame.lead for frame in annotated_frames(drive, patterns) if frame.lead is not None]


def table() -> str:
    """Both tables, as Markdown."""
    lines = [
        "| light | named | with series | alone | right lead | wrong texts |",
        "|---|---|---|---|---|---|",
    ]
    for light, tally in by_light(tags=False).items():
        lines.append(
            f"| {light} | {tally.named_in_time}/{tally.drives} | {tally.named_with_series} "
            f"| {tally.known_in_time} "
            f"| {tally.right_lead / tally.frames:.0%} | {tally.wrong_identities} |"
        )
    heads = (
        "lens, gap",
        "named",
        "with series",
        "alone",
        "wrong texts",
        "gap error, 90 %, by sigma",
    )
    lines += ["", f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for camera in (CAMERA, WIDE_CAMERA):
        for gap_m, tally in by_gap(camera, tags=False).items():
            lines.append(f"| {camera.focal_x_px:.0f}px, {gap_m:.0f}m {_row(tally)}")
    return "\n".join(lines) + "\n"


def _row(tally: DriveTally) -> str:
    errors = tally.gap_errors or [float("nan")]
    sigmas = tally.in_sigmas or [float("nan")]
    return (
        f"| {tally.named_in_time}/{tally.drives} | {tally.named_with_series} "
        f"| {tally.known_in_time} | {tally.wrong_identities} "
        f"| {np.median(errors):.1%}, {np.quantile(errors, 0.9):.1%}, "
        f"{np.sqrt(np.mean(np.square(sigmas))):.1f} |"
    )


def main() -> None:
    """Write the tables into the page, between its marks, and one annotated frame beside it."""
    write_tables(PAGE, {"drives": table()})
    drive = rendered_drive(CAMERA, Light.DUSK, 13.0, 0, np.random.default_rng(3))
    *_, last = annotated_frames(drive)
    cv2.imwrite(str(IMAGE), cv2.resize(last.annotated(), None, fx=0.5, fy=0.5))


if __name__ == "__main__":
    main()
