"""Frames to observations, on rendered drives with AR tags and on invalid frames."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from onboard.observations import (
    Discarded,
    Lead,
    LeadIdentity,
    Sensor,
    SensorLost,
    SensorRecovered,
    VehicleDetection,
)
from onboard.vision.networks import load_perception
from onboard.vision.parameters import DEFAULT_PARAMETERS
from onboard.vision.settings import CameraSettings, VisionSettings
from onboard.vision.sized_camera import GUESSED_LENS_SIGMA
from sim_rig.rendering.scene import Scene, SceneCar
from tests.typed import a, every
from tests.vision.drive import CAMERA, TAGS, frames, observe

TAG_SIDE_M = 0.4
SETTINGS = VisionSettings(plates=False, tag_side_m=TAG_SIDE_M)


def tagged(ahead_m: float, lateral_m: float, tag_id: int) -> SceneCar:
    return SceneCar(ahead_m, lateral_m, tag_id=tag_id, tag_side_m=TAG_SIDE_M)


def road(*cars: SceneCar) -> Scene:
    return Scene(cars=cars)


def test_there_is_exactly_one_lead_event_for_each_frame() -> None:
    observed = observe(
        load_perception(CAMERA, SETTINGS), frames(lambda _: road(tagged(15, 0, 1)), 2.0)
    )

    assert [lead.stamp_s for lead in observed.leads] == pytest.approx(np.arange(20) / 10)


def test_no_lead_unknown_lead_and_known_lead_are_distinct() -> None:
    without_lead = observe(load_perception(CAMERA, SETTINGS), frames(lambda _: road(), 1.0))
    with_lead = observe(
        load_perception(CAMERA, SETTINGS), frames(lambda _: road(tagged(15, 0, 1)), 1.0)
    )

    assert {lead.identity for lead in without_lead.leads} == {LeadIdentity.NO_LEAD}
    assert {(lead.text, lead.gap_m) for lead in without_lead.leads} == {(None, None)}
    assert with_lead.leads[-1].identity is LeadIdentity.KNOWN
    assert with_lead.leads[-1].text == "TAG1"


def test_a_lamp_in_a_dark_window_is_no_tag() -> None:
    observed = observe(
        load_perception(CAMERA, SETTINGS), frames(lambda _: road(tagged(10, 0, 17)), 1.0)
    )

    assert observed.plates == []
    assert {lead.gap_m for lead in observed.leads} == {None}
    assert {lead.identity for lead in observed.leads} == {LeadIdentity.UNKNOWN}


@pytest.mark.parametrize("gap_m", [5.0, 10.0, 15.0, 20.0])
def test_the_gap_follows_from_the_size_of_the_tag(gap_m: float) -> None:
    observed = observe(
        load_perception(CAMERA, SETTINGS), frames(lambda _: road(tagged(gap_m, 0, 1)), 1.0)
    )

    lead = observed.leads[-1]
    assert lead.gap_m == pytest.approx(gap_m, rel=0.04)
    assert abs(a(float, lead.gap_m) - gap_m) < 3 * a(float, lead.gap_sigma_m)


def test_closing_speed_is_positive_while_the_gap_shrinks() -> None:
    observed = observe(
        load_perception(CAMERA, SETTINGS), frames(lambda t: road(tagged(25 - 4 * t, 0, 1)), 3.0)
    )

    lead = observed.leads[-1]
    assert lead.closing_speed_m_s == pytest.approx(4.0, abs=0.5)
    assert lead.gap_m == pytest.approx(25 - 4 * 2.9, rel=0.03)


def test_a_nearer_vehicle_in_the_next_lane_is_detected_and_is_no_lead() -> None:
    scene = road(tagged(10, 3.5, 3), tagged(20, 0, 1))
    observed = observe(load_perception(CAMERA, SETTINGS), frames(lambda _: scene, 1.0))

    assert {lead.text for lead in observed.leads[3:]} == {"TAG1"}
    assert {plate.text for plate in observed.plates if plate.is_lead} == {"TAG1"}
    assert {plate.text for plate in observed.plates if not plate.is_lead} >= {"TAG3"}
    neighbour = next(car for car in reversed(observed.cars) if car.text == "TAG3")
    assert neighbour.range_m == pytest.approx(np.hypot(10, 3.5), rel=0.03)
    assert neighbour.bearing_rad == pytest.approx(np.arctan2(3.5, 10), abs=0.01)


def test_a_track_keeps_its_number() -> None:
    observed = observe(
        load_perception(CAMERA, SETTINGS),
        frames(lambda t: road(tagged(10 + t, -3.5 + 0.7 * t, 2)), 5.0),
    )

    assert len({car.track_id for car in observed.cars}) == 1
    assert len(observed.cars) > 40


def test_a_vehicle_that_cuts_in_becomes_the_lead() -> None:
    def scene(stamp_s: float) -> Scene:
        return road(tagged(25, 0, 1), tagged(12, max(0.0, 3.5 - 1.2 * stamp_s), 2))

    observed = observe(load_perception(CAMERA, SETTINGS), frames(scene, 5.0))

    texts = [lead.text for lead in observed.leads]
    assert texts[12] == "TAG1"
    assert texts[-1] == "TAG2"
    # Once, and not back and forth.
    assert sum(a != b for a, b in itertools.pairwise(texts[5:])) == 1


def test_a_lead_that_changes_in_a_repeated_frame_does_not_get_the_old_ones_speed() -> None:
    """The reference of the old lead's rear must not give a closing speed of the new one."""

    def scene(stamp_s: float) -> Scene:
        aside_m = 0.2 + 1.5 * max(0.0, stamp_s - 1.0)
        return road(tagged(8, -aside_m, 1), tagged(18 - 2 * stamp_s, 0.6, 2))

    drive = list(frames(scene, 3.0))
    leads = observe(load_perception(CAMERA, SETTINGS), iter(drive)).leads
    changed = next(index for index, lead in enumerate(leads) if lead.text == "TAG2")
    drive[changed] = (drive[changed][0], drive[changed - 1][1])

    leads = observe(load_perception(CAMERA, SETTINGS), iter(drive)).leads

    assert [lead.text for lead in leads[changed - 1 : changed + 1]] == ["TAG1", "TAG2"]
    for lead in leads[changed:]:
        assert lead.closing_speed_m_s == pytest.approx(2.0, abs=0.7)


def test_tags_at_half_the_resolution_have_the_same_distance() -> None:
    half = frames(lambda _: road(tagged(8, 0, 1)), 1.0, camera=CAMERA.model_copy(update=_half()))

    assert observe(load_perception(CAMERA, SETTINGS), half).leads[-1].gap_m == pytest.approx(
        8.0, rel=0.03
    )


def _half() -> dict[str, float]:
    names = ("focal_x_px", "focal_y_px", "principal_x_px", "principal_y_px")
    halved: dict[str, float] = {name: getattr(CAMERA, name) / 2 for name in names}
    return halved | {"width_px": CAMERA.width_px // 2, "height_px": CAMERA.height_px // 2}


def test_a_repeated_frame_is_a_lost_camera_after_a_while() -> None:
    drive = list(frames(lambda _: road(tagged(15, 0, 1)), 1.0))
    frozen = [(1.0 + 0.1 * index, drive[-1][1]) for index in range(20)]
    after = [(3.0 + stamp_s, image) for stamp_s, image in drive]

    observed = observe(load_perception(CAMERA, SETTINGS), iter(drive + frozen + after))

    lost, back = observed.health
    assert isinstance(lost, SensorLost)
    assert (lost.sensor, lost.reason) == (Sensor.CAMERA, "frozen")
    assert 0.9 + DEFAULT_PARAMETERS.frozen_after_s < lost.stamp_s <= 1.9 + 1e-9
    assert back == SensorRecovered(3.0, Sensor.CAMERA)
    assert not any(lost.stamp_s <= lead.stamp_s < 3.0 for lead in observed.leads)
    assert observed.leads[-1].text == "TAG1"


def test_one_or_two_repeated_frames_are_a_slow_camera() -> None:
    drive = list(frames(lambda t: road(tagged(20 - 2 * t, 0, 1)), 2.0))
    twice = [(0.05 * index, drive[index // 2][1]) for index in range(40)]

    observed = observe(load_perception(CAMERA, SETTINGS), iter(twice))

    assert observed.health == []
    assert len(observed.leads) == 40
    assert len(observed.plates) == 20


@pytest.mark.parametrize("level", [0, 128, 255])
def test_a_blank_frame_is_discarded(level: int) -> None:
    blank = np.full((540, 960, 3), level, np.uint8)
    observed = observe(load_perception(CAMERA, SETTINGS), iter([(0.0, blank)]))

    (event,) = every(Discarded, observed.events)
    assert (event.component, event.reason) == ("vision", "blank_frame")


@pytest.mark.parametrize("shape", [(0, 0, 3), (540, 960), (540, 960, 4), (540, 0, 3)])
def test_a_frame_that_did_not_decode_is_discarded(shape: tuple[int, ...]) -> None:
    observed = observe(load_perception(CAMERA, SETTINGS), iter([(0.0, np.zeros(shape, np.uint8))]))

    assert [event.reason for event in observed.discarded] == ["corrupt_frame"]


def test_a_rotated_frame_is_discarded_and_the_next_valid_one_is_not() -> None:
    drive = list(frames(lambda _: road(tagged(15, 0, 1)), 1.0))
    drive[5] = (0.5, np.rot90(drive[5][1]).copy())

    observed = observe(load_perception(CAMERA, SETTINGS), iter(drive))

    assert [event.reason for event in observed.discarded] == ["frame_size"]
    assert observed.leads[-1].text == "TAG1"


def test_an_old_frame_is_discarded() -> None:
    drive = list(frames(lambda _: road(), 0.3))

    observed = observe(load_perception(CAMERA, SETTINGS), iter([drive[1], drive[0], drive[2]]))

    assert [event.reason for event in observed.discarded] == ["old_frame"]
    assert [lead.stamp_s for lead in observed.leads] == pytest.approx([0.1, 0.2])


def test_truncated_frames_lose_no_lead() -> None:
    rng = np.random.default_rng(2)
    drive = []
    for stamp_s, image in frames(lambda _: road(tagged(15, 0, 1)), 3.0):
        if rng.random() < 0.4:
            row = int(rng.integers(100, 500))
            image[row:] = np.roll(image[row:], int(rng.integers(50, 900)), axis=1)
        drive.append((stamp_s, image))

    observed = observe(load_perception(CAMERA, SETTINGS), iter(drive))

    assert {lead.text for lead in observed.leads[10:]} == {"TAG1"}


def test_sudden_exposure_changes_lose_no_lead() -> None:
    drive = [
        (stamp_s, (image * (1.0, 0.35, 1.0, 0.6)[int(3 * stamp_s) % 4]).astype(np.uint8))
        for stamp_s, image in frames(lambda _: road(tagged(15, 0, 1)), 4.0)
    ]

    observed = observe(load_perception(CAMERA, SETTINGS), iter(drive))

    assert {lead.text for lead in observed.leads[4:]} == {"TAG1"}


@settings(max_examples=30)
@given(
    hnp.arrays(
        np.uint8,
        st.tuples(st.integers(0, 40), st.integers(0, 40), st.integers(1, 4)),
    )
)
def test_no_image_raises(image: np.ndarray[tuple[int, int, int], np.dtype[np.uint8]]) -> None:
    perception = load_perception(None, TAGS)
    for index in range(3):
        perception.receive_frame(image, 0.1 * index)
    assert perception.next_event() is not None


def test_without_a_calibration_the_sigma_of_distances_is_large() -> None:
    rest = CAMERA.model_dump(exclude={"focal_x_px"})
    guessed, calibrated = CameraSettings(**rest), CameraSettings(**rest, focal_x_px=1100.0)
    assert guessed == calibrated

    def lead_and_car(camera: CameraSettings) -> tuple[Lead, VehicleDetection]:
        observed = observe(
            load_perception(camera, SETTINGS), frames(lambda t: road(tagged(15 - 2 * t, 0, 1)), 1.0)
        )
        return observed.leads[-1], observed.cars[-1]

    (unsure, unsure_car), (sure, sure_car) = lead_and_car(guessed), lead_and_car(calibrated)
    assert sure.gap_m is not None
    assert sure.closing_speed_m_s is not None
    assert unsure.gap_m == sure.gap_m
    assert (sure.gap_sigma_m or 0.0) < 0.05 * sure.gap_m
    assert unsure.gap_sigma_m == pytest.approx(GUESSED_LENS_SIGMA * sure.gap_m, rel=0.01)
    assert unsure.closing_speed_sigma_m_s == sure.closing_speed_sigma_m_s  # alarms are as early
    assert unsure_car.range_sigma_m > GUESSED_LENS_SIGMA * sure_car.range_m


def test_without_a_calibration_any_size_is_processed() -> None:
    perception = load_perception(None, SETTINGS)
    drive = list(frames(lambda _: road(tagged(15, 0, 1)), 0.2))
    perception.receive_frame(drive[0][1], 0.0)
    perception.receive_frame(drive[1][1][:, 200:800].copy(), 0.1)

    formats = []
    while (event := perception.next_event()) is not None:
        formats.append(event.kind)
    assert formats == ["plate", "lead", "plate", "lead"]
