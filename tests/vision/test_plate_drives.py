"""Plates on rendered drives and real clips, with both networks."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pytest

from onboard.observations import Lead, LeadIdentity
from onboard.tools.see.annotated_frame import annotate_frames
from onboard.vision.camera import open_frames
from onboard.vision.perception import Perception
from onboard.vision.plate_detector import Image, PlateDetector
from onboard.vision.plate_reader import PlateReader, Plates, PlateText
from onboard.vision.settings import CameraSettings, VisionSettings
from onboard.vision.sized_camera import Networks
from sim_rig.rendering.plate_art import EU, FORMATS, PlateFormat, draw_plate
from sim_rig.rendering.scene import CameraRenderer, Light, Scene, SceneCar, opaque, warp_onto
from tests.typed import a
from tests.vision.drive import Observed, frames, observe

CAMERA = CameraSettings(source="rendered", focal_x_px=2000.0, focal_y_px=2000.0, pitch_rad=0.02)
RENDERER = CameraRenderer(CAMERA)
FINDER, READER = PlateDetector(), PlateReader()
OURS, THEIRS = "GN417KB", "YW903MS"


def perception(settings: VisionSettings | None = None) -> Perception:
    return Perception(CAMERA, settings or VisionSettings(), Networks(FINDER, READER))


def drive(*cars: SceneCar, light: Light = Light.DAY, duration_s: float = 1.5) -> Observed:
    def scene(stamp_s: float) -> Scene:
        return Scene(cars, light=light, travelled_m=15 * stamp_s)

    return observe(perception(), frames(scene, duration_s, camera=CAMERA))


@pytest.mark.long
@pytest.mark.parametrize("light", Light)
def test_the_lead_is_identified_within_a_second_in_any_light(light: Light) -> None:
    observed = drive(SceneCar(10.0, 0.2, plate=OURS), light=light)

    after_a_second = [lead for lead in observed.leads if lead.stamp_s >= 1.0]
    assert {lead.text for lead in after_a_second} == {OURS}
    assert {lead.text for lead in observed.leads} <= {None, OURS}
    assert all(lead.gap_m == pytest.approx(10.0, rel=0.1) for lead in after_a_second)


@pytest.mark.parametrize("plate_format", FORMATS.values(), ids=FORMATS)
def test_the_width_of_a_plate_follows_from_its_shape(plate_format: PlateFormat) -> None:
    observed = drive(SceneCar(8.0, plate=OURS, plate_format=plate_format))

    assert observed.leads[-1].gap_m == pytest.approx(8.0, rel=0.1)


@pytest.mark.parametrize("closing_m_s", [-4.0, 0.0, 6.0])
def test_the_first_closing_speeds_are_within_their_sigmas(closing_m_s: float) -> None:
    def scene(stamp_s: float) -> Scene:
        return Scene((SceneCar(14.0 - closing_m_s * stamp_s, plate=OURS),))

    observed = observe(perception(), frames(scene, 1.0, camera=CAMERA))

    leads = [lead for lead in observed.leads if lead.gap_m is not None]
    assert len(leads) >= 6
    for lead in leads:
        sigma_m_s = a(float, lead.closing_speed_sigma_m_s)
        assert sigma_m_s <= 3.0
        assert abs(a(float, lead.closing_speed_m_s) - closing_m_s) < 3 * sigma_m_s


@pytest.mark.long
def test_the_gaps_sigma_is_larger_while_the_plate_width_is_unknown() -> None:
    scene, sigmas_m = Scene((SceneCar(28.0, plate=OURS, plate_format=FORMATS["br"]),)), []
    for width_m in (None, 0.4):
        given = VisionSettings(plate_width_m=width_m)
        observed = observe(perception(given), frames(lambda _: scene, 1.5, camera=CAMERA))
        sigmas_m.append(observed.leads[-1].gap_sigma_m or 0.0)

    assert sigmas_m[0] > 1.1 * sigmas_m[1] > 0.0


@pytest.mark.long
def test_a_sharper_plate_in_the_next_lane_is_no_lead() -> None:
    observed = drive(SceneCar(14.0, plate=OURS), SceneCar(8.5, 2.4, plate=THEIRS), duration_s=2.0)

    assert {lead.text for lead in observed.leads} <= {None, OURS}
    assert observed.leads[-1].text == OURS
    assert THEIRS in {plate.text for plate in observed.plates if not plate.is_lead}


def test_a_plate_too_small_to_be_read_is_a_lead_without_identity() -> None:
    observed = drive(SceneCar(28.0, plate=OURS), duration_s=3.0)

    assert {lead.text for lead in observed.leads} <= {None, OURS}
    assert LeadIdentity.UNKNOWN in {lead.identity for lead in observed.leads}


class CountingReader:
    """Counts the plates that it reads."""

    def __init__(self) -> None:
        self.plates = 0

    def read_many(self, image: Image, plates: Plates) -> list[PlateText]:
        self.plates += len(plates)
        return READER.read_many(image, plates)


def test_identified_plates_are_read_once_a_second() -> None:
    cars = SceneCar(9.0, plate=OURS), SceneCar(12.0, 3.5, plate=THEIRS)
    counting = CountingReader()
    watching = Perception(CAMERA, VisionSettings(), Networks(FINDER, counting))
    images = list(frames(lambda _: Scene(cars), 3.0, camera=CAMERA))
    first = observe(watching, iter(images[:10]))
    counting.plates = 0

    observe(watching, iter(images[10:]))

    assert first.leads[-1].text == OURS
    assert counting.plates <= 2 * 1 * 2.0 + 2  # cars, times a second, seconds


def with_a_plate(
    drive: Iterable[tuple[float, Image]],
    text: str,
    place: tuple[float, float, float, float],
    ahead_m: float,
    since_s: float = 0.0,
) -> Iterator[tuple[float, Image]]:
    """A further plate, between left, top, right and bottom, to the right and over the road."""
    left, top, right, bottom = place
    art = opaque(draw_plate(text, EU, px_per_mm=1.0))
    corners = [(left, top), (right, top), (right, bottom), (left, bottom)]
    quad = np.array([RENDERER.project(ahead_m, x, y) for x, y in corners], np.float32)
    for stamp_s, image in drive:
        if stamp_s >= since_s:
            warp_onto(image, art, quad)
        yield stamp_s, image


def test_a_tag_and_a_plate_on_one_vehicle_are_one_track() -> None:
    car = SceneCar(8.0, tag_id=3, tag_side_m=0.2)
    drive = frames(lambda _: Scene((car,)), 1.0, camera=CAMERA)

    observed = observe(
        perception(), with_a_plate(drive, OURS, (-0.26, 0.96, 0.26, 0.85), ahead_m=8.0)
    )

    assert observed.leads[-1].text == "TAG3"
    assert {"TAG3", OURS} <= {plate.text for plate in observed.plates}
    assert len({car.track_id for car in observed.cars}) == 1


@pytest.mark.long
def test_a_second_plate_on_a_vehicle_does_not_change_its_identity() -> None:
    """A load of a transporter, or a plate in the window, from the second second on."""
    drive = frames(lambda _: Scene((SceneCar(8.0, plate=OURS),)), 2.5, camera=CAMERA)

    observed = observe(
        perception(), with_a_plate(drive, THEIRS, (-0.26, 1.21, 0.26, 1.1), 8.0, since_s=1.0)
    )

    assert THEIRS in {plate.text for plate in observed.plates}
    assert {lead.text for lead in observed.leads} == {None, OURS}
    assert observed.leads[-1].text == OURS


def test_a_plate_on_a_billboard_is_read_and_is_no_lead() -> None:
    """Two metres wide and 30 m ahead: as large as a plate 7.8 m away."""
    drive = frames(lambda _: Scene(), 1.5, camera=CAMERA)

    observed = observe(
        perception(), with_a_plate(drive, OURS, (-1.0, 3.8, 1.0, 3.38), ahead_m=30.0)
    )

    assert {lead.identity for lead in observed.leads} == {LeadIdentity.NO_LEAD}


def test_an_empty_road_has_neither_plates_nor_a_lead() -> None:
    observed = drive(duration_s=1.0)

    assert observed.plates == []
    assert {lead.identity for lead in observed.leads} == {LeadIdentity.NO_LEAD}


def test_patterns_of_a_country_exclude_other_texts() -> None:
    def scene(_: float) -> Scene:
        return Scene((SceneCar(8.0, plate=OURS),))

    settings = VisionSettings(plate_patterns=("[0-9]{4}[A-Z]{3}",))
    observed = observe(perception(settings), frames(scene, 1.0, camera=CAMERA))

    assert {plate.text for plate in observed.plates} == {None}
    assert observed.leads[-1].identity is LeadIdentity.UNKNOWN


@pytest.mark.long
@pytest.mark.realdata
@pytest.mark.parametrize(("clip", "every"), [("motorway-720p", 3), ("empty-lane-540p", 10)])
def test_real_clips_without_a_legible_plate_have_none(
    rig_data: Path, clip: str, every: int
) -> None:
    source = open_frames(CameraSettings(source=str(rig_data / "clips" / f"{clip}.mp4")))
    chosen = [frame for index, frame in enumerate(source) if index % every == 0]

    observed = list(
        annotate_frames(chosen, Perception(None, VisionSettings(), Networks(FINDER, READER)))
    )

    assert len(observed) == len(chosen) >= 12
    assert [plate for frame in observed for plate in frame.plates] == []
    leads = [a(Lead, frame.lead) for frame in observed]
    assert {lead.gap_m for lead in leads} == {None}
    # Where the camera points is not known, so neither is whether the lane is free.
    assert {lead.identity for lead in leads} == {LeadIdentity.UNKNOWN}
