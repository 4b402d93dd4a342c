"""The rear's change of scale gives the closing speed, and keeps the lead."""

import cv2
import numpy as np
import pytest

from onboard.observations import ImageBox, Lead, LeadIdentity
from onboard.vision.networks import load_perception
from onboard.vision.rear import RearTracker
from onboard.vision.settings import CameraSettings, VisionSettings
from onboard.vision.tracker import KEEP_S
from sim_rig.cars.camera_view import LENS
from sim_rig.rendering.scene import Scene, SceneCar
from tests.vision.drive import CAMERA, RENDERER, frames, observe

PLATE = ImageBox(300, 190, 40, 10)
TAGS = VisionSettings(plates=False, tag_side_m=0.4)


def textured(seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    rough = rng.integers(0, 255, (45, 80, 3)).astype(np.uint8)
    return cv2.GaussianBlur(cv2.resize(rough, (640, 360)), (0, 0), 2.0)


def moved(image: np.ndarray, factor: float, right_px: float, down_px: float) -> np.ndarray:
    """`image` scaled about its middle and shifted."""
    matrix = np.array(
        [[factor, 0, 320 * (1 - factor) + right_px], [0, factor, 180 * (1 - factor) + down_px]]
    )
    return cv2.warpAffine(image, matrix, (640, 360), borderMode=cv2.BORDER_REFLECT)


@pytest.mark.parametrize("factor", [0.93, 0.99, 1.0, 1.004, 1.03, 1.1])
def test_scale_change_and_shift_are_measured(factor: float) -> None:
    image, rear = textured(), RearTracker()
    rear.set_reference(image, ImageBox(260, 130, 120, 100), PLATE)

    scale_change = rear.track(moved(image, factor, 6.0, -3.0))

    assert scale_change is not None
    assert scale_change.factor == pytest.approx(factor, abs=0.003)
    corners = np.array([[300, 160], [340, 160], [340, 170], [300, 170]], np.float32)
    expected = (corners - (320, 180)) * factor + (326, 177)
    assert scale_change.moved(corners) == pytest.approx(expected, abs=0.3)


@pytest.mark.parametrize(
    "after",
    [textured(seed=2), np.zeros((360, 640, 3), np.uint8), moved(textured(), 2.0, 0.0, 0.0)],
    ids=["another place", "black", "twice as large"],
)
def test_a_region_that_vanished_is_not_tracked(after: np.ndarray) -> None:
    rear = RearTracker()
    rear.set_reference(textured(), ImageBox(260, 130, 120, 100), PLATE)

    assert rear.track(after) is None


def test_a_wall_without_corners_is_not_tracked() -> None:
    wall, rear = np.full((360, 640, 3), 90, np.uint8), RearTracker()
    rear.set_reference(wall, ImageBox(260, 130, 120, 100), PLATE)

    assert rear.track(wall) is None


@pytest.mark.parametrize("place", [(-300, -300), (620, 340), (0, 0), (630, 0)])
def test_regions_at_and_beyond_the_border_raise_nothing(place: tuple[int, int]) -> None:
    image, rear = textured(), RearTracker()
    rear.set_reference(image, ImageBox(*place, 120, 100), ImageBox(*place, 40, 10))

    scale_change = rear.track(moved(image, 1.02, 0.0, 0.0))

    assert scale_change is None or scale_change.factor == pytest.approx(1.02, abs=0.01)


def test_a_frame_of_another_size_is_not_tracked() -> None:
    image, rear = textured(), RearTracker()
    rear.set_reference(image, ImageBox(400, 230, 120, 100), PLATE)

    assert rear.track(image[:200, :300].copy()) is None


def test_a_lead_whose_tag_is_unreadable_for_seconds_is_kept_by_its_rear() -> None:
    def car(stamp_s: float) -> SceneCar:
        return SceneCar(14.0 - 0.7 * stamp_s, 0.2, tag_id=1, tag_side_m=0.4)

    drive = []
    for stamp_s, image in frames(lambda t: Scene(cars=(car(t),)), 8.0):
        if 3.0 <= stamp_s < 7.0:  # mud
            middle, side_px = (
                RENDERER.plate_quad(car(stamp_s)).mean(axis=0),
                330 / (14 - 0.7 * stamp_s),
            )
            corner = tuple(np.rint(middle - 0.6 * side_px).astype(int))
            cv2.rectangle(image, corner, tuple(np.rint(middle).astype(int)), (60, 70, 80), -1)
        drive.append((stamp_s, image))

    observed = observe(load_perception(CAMERA, TAGS), iter(drive))

    muddy = [lead for lead in observed.leads if 3.0 <= lead.stamp_s < 7.0]
    assert not [plate for plate in observed.plates if 3.0 <= plate.stamp_s < 7.0]
    assert {(lead.identity, lead.text) for lead in muddy} == {(LeadIdentity.KNOWN, "TAG1")}
    for lead in muddy:
        assert lead.gap_m == pytest.approx(14.0 - 0.7 * lead.stamp_s, rel=0.08)


def test_a_lead_that_vanishes_is_dropped_in_time() -> None:
    def scene(stamp_s: float) -> Scene:
        return Scene((SceneCar(15.0, tag_id=1, tag_side_m=0.4),) if stamp_s < 2.0 else ())

    observed = observe(load_perception(CAMERA, TAGS), frames(scene, 5.0))

    gone_at = min(lead.stamp_s for lead in observed.leads[10:] if lead.gap_m is None)
    assert gone_at <= 2.0 + KEEP_S + 0.2
    assert all(lead.gap_m is None for lead in observed.leads if lead.stamp_s > gone_at)


@pytest.mark.long
def test_the_closing_speed_of_a_lead_without_a_plate_is_not_of_the_road_around_it() -> None:
    def scene(stamp_s: float) -> Scene:
        car = SceneCar(55.0 - 4.0 * stamp_s, colour_bgr=(40, 40, 170))
        return Scene((car,), travelled_m=15.0 * stamp_s)

    camera = CameraSettings(source="rig", **LENS.model_dump())
    perception = load_perception(camera, VisionSettings())
    observed = observe(perception, frames(scene, 4.0, camera=camera))

    speeds_m_s = [
        lead.closing_speed_m_s for lead in observed.leads if lead.closing_speed_m_s is not None
    ]
    assert len(speeds_m_s) > 25
    assert np.median(speeds_m_s) == pytest.approx(4.0, abs=0.8)


def _closing_error_m_s(leads: list[Lead]) -> float:
    errors = [
        lead.closing_speed_m_s - (-4.0 * np.cos(lead.stamp_s))
        for lead in leads
        if lead.stamp_s > 1.0 and lead.closing_speed_m_s is not None
    ]
    return float(np.sqrt(np.mean(np.square(errors))))


def test_closing_speed_follows_a_lead_that_speeds_up_and_slows_down() -> None:
    def scene(stamp_s: float) -> Scene:
        car = SceneCar(15.0 + 4.0 * np.sin(stamp_s), 0.2, tag_id=1, tag_side_m=0.4)
        return Scene(cars=(car,))

    observed = observe(load_perception(CAMERA, TAGS), frames(scene, 6.0))

    assert _closing_error_m_s(observed.leads) < 0.6
