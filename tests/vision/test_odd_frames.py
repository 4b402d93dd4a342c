"""A drive behind an identified lead, with both networks and with invalid or odd frames."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from onboard.observations import LeadIdentity, Sensor, SensorLost, SensorRecovered
from onboard.vision.frame_check import UPSIDE_DOWN_FRAMES, FrameCheck
from onboard.vision.frames import decode_image
from onboard.vision.perception import Perception
from onboard.vision.plate_detector import Image, PlateDetector
from onboard.vision.plate_reader import PlateReader
from onboard.vision.settings import CameraSettings, VisionSettings
from onboard.vision.sized_camera import Networks
from sim_rig.rendering.scene import Light, Scene, SceneCar
from tests.vision.drive import Observed, frames, observe

CAMERA = CameraSettings(
    source="rendered",
    width_px=640,
    height_px=360,
    focal_x_px=1600.0,
    focal_y_px=1600.0,
    principal_x_px=320.0,
    principal_y_px=180.0,
    pitch_rad=0.03,
)
GAP_M, LEAD = 9.0, "GN417KB"
FINDER, READER = PlateDetector(), PlateReader()
Drive = list[tuple[float, Image]]
Change = Callable[[Image], Image]
ODD = range(5, 14, 2)


def rendered(*cars: SceneCar) -> Drive:
    def scene(stamp_s: float) -> Scene:
        return Scene(cars, travelled_m=15 * stamp_s)

    return list(frames(scene, 1.5, camera=CAMERA))


@pytest.fixture(scope="module")
def drive() -> Drive:
    """One and a half seconds behind one vehicle."""
    return rendered(SceneCar(GAP_M, 0.2, plate=LEAD))


def observe_images(images: Drive) -> Observed:
    return observe(Perception(CAMERA, VisionSettings(), Networks(FINDER, READER)), iter(images))


def spoilt(drive: Drive, *ways: Change) -> Drive:
    """Replace every other frame from the sixth on, by one change after the other."""
    return [
        (stamp_s, ways[(index - 5) // 2 % len(ways)](image.copy()) if index in ODD else image)
        for index, (stamp_s, image) in enumerate(drive)
    ]


def assert_identity_kept(observed: Observed) -> None:
    assert {lead.text for lead in observed.leads} <= {None, LEAD}
    assert observed.leads[-1].text == LEAD
    assert observed.leads[-1].gap_m == pytest.approx(GAP_M, rel=0.1)


def blank(level: int) -> Change:
    return lambda image: np.full_like(image, level)


def rotated(image: Image) -> Image:
    return np.rot90(image).copy()


def narrower(image: Image) -> Image:
    return image[:, :500].copy()


def not_decoded(_: Image) -> Image:
    return np.zeros((0, 0, 3), np.uint8)


def test_invalid_frames_are_discarded_and_the_lead_keeps_its_identity(drive: Drive) -> None:
    observed = observe_images(spoilt(drive, blank(0), blank(255), rotated, narrower, not_decoded))

    reasons = [event.reason for event in observed.discarded]
    assert reasons == ["blank_frame"] * 2 + ["frame_size"] * 2 + ["corrupt_frame"]
    assert len(observed.leads) == len(drive) - len(reasons)
    assert_identity_kept(observed)


def torn(image: Image) -> Image:
    """An image whose lower half is of another frame."""
    image[180:] = np.roll(image[180:], 230, axis=1)
    return image


def darker(image: Image) -> Image:
    return (image * 0.3).astype(np.uint8)


def overexposed(image: Image) -> Image:
    return np.asarray(np.clip(image * 2.2, 0, 255), np.uint8)


def half_as_large(image: Image) -> Image:
    return np.asarray(cv2.resize(image, (320, 180), interpolation=cv2.INTER_AREA), np.uint8)


@pytest.mark.long
@pytest.mark.parametrize("how", [torn, darker, overexposed, half_as_large])
def test_odd_frames_do_not_change_the_leads_identity(drive: Drive, how: Change) -> None:
    observed = observe_images(spoilt(drive, how))

    assert len(observed.leads) == len(drive)
    assert_identity_kept(observed)


def test_a_stream_that_changes_its_resolution_for_good_keeps_the_lead(drive: Drive) -> None:
    images = drive[:10] + [(stamp_s, half_as_large(image)) for stamp_s, image in drive[10:]]

    assert_identity_kept(observe_images(images))


@pytest.mark.long
def test_a_stream_that_alternates_its_resolution_has_no_closing_speed(drive: Drive) -> None:
    """Slightly larger: the change of scale of a rear from one frame to the next."""
    sizes = [(640, 360), (576, 324)]
    images = [
        (stamp_s, np.asarray(cv2.resize(image, sizes[index % 2]), np.uint8))
        for index, (stamp_s, image) in enumerate(drive)
    ]

    observed = observe_images(images)

    assert_identity_kept(observed)
    for lead in observed.leads[2:]:
        assert lead.gap_m == pytest.approx(GAP_M, rel=0.1)
        assert lead.closing_speed_m_s == pytest.approx(0.0, abs=2.0)


def dark_noise(stamp_s: float) -> Image:
    """The image of a covered lens."""
    noise = np.random.default_rng(round(10 * stamp_s)).normal(8, 5, (360, 640, 3))
    return np.clip(noise, 0, 255).astype(np.uint8)


def no_signal(_: float) -> Image:
    return np.full((360, 640, 3), (255, 0, 0), np.uint8)


@pytest.mark.parametrize("given", [dark_noise, no_signal])
def test_blank_frames_do_not_report_a_free_road(
    given: Callable[[float], Image],
) -> None:
    observed = observe_images([(0.1 * index, given(0.1 * index)) for index in range(5)])

    assert [event.reason for event in observed.discarded] == ["blank_frame"] * 5
    assert observed.leads == []


@pytest.mark.parametrize("axis", [0, 1, -1], ids=["upside down", "mirrored", "both"])
def test_a_wrongly_mounted_camera_identifies_no_lead(drive: Drive, axis: int) -> None:
    observed = observe_images(
        [(stamp_s, np.asarray(cv2.flip(i, axis), np.uint8)) for stamp_s, i in drive]
    )

    assert {lead.text for lead in observed.leads} == {None}


def test_a_frozen_camera_is_lost_and_the_lead_is_identified_again_afterwards(drive: Drive) -> None:
    frozen = [(1.5 + 0.1 * index, drive[-1][1]) for index in range(15)]
    after = [(3.0 + stamp_s, image) for stamp_s, image in drive]

    observed = observe_images(drive + frozen + after)

    lost, back = observed.health
    assert isinstance(lost, SensorLost)
    assert (lost.sensor, lost.reason) == (Sensor.CAMERA, "frozen")
    assert back == SensorRecovered(3.0, Sensor.CAMERA)
    assert not any(lost.stamp_s <= lead.stamp_s < back.stamp_s for lead in observed.leads)
    assert_identity_kept(observed)


@pytest.mark.long
@pytest.mark.parametrize("how", ["silent", "frozen", "covered"])
def test_after_a_long_outage_the_lead_is_not_identified(drive: Drive, how: str) -> None:
    """Another vehicle with an illegible plate is where the identified one was a minute before."""
    away: Drive = []
    if how == "frozen":
        away = [(stamp_s, drive[-1][1]) for stamp_s in np.arange(1.5, 60.0, 0.5).tolist()]
    elif how == "covered":
        away = [(stamp_s, np.zeros_like(drive[-1][1])) for stamp_s in range(2, 60)]
    another = rendered(SceneCar(28.0, plate="YW903MS", colour_bgr=(40, 40, 160)))
    back = [(60.0 + stamp_s, image) for stamp_s, image in another]

    observed = observe_images(drive + away + back)

    after = [lead for lead in observed.leads if lead.stamp_s >= 60.0]
    assert {lead.text for lead in after} == {None}
    assert after[-1].identity is LeadIdentity.UNKNOWN


def test_after_an_outage_of_a_second_the_lead_keeps_its_identity(drive: Drive) -> None:
    back = [(2.4 + stamp_s, image) for stamp_s, image in drive]

    observed = observe_images(drive + back)

    assert {lead.text for lead in observed.leads if lead.stamp_s >= 2.4} == {LEAD}


def clock(image: Image, stamp_s: float) -> None:
    at = (8, image.shape[0] - 8)
    clock_text = f"2026-11-22 10:30:{stamp_s:05.2f}"
    cv2.putText(image, clock_text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 255, 255))


def noisy_pixel(image: Image, stamp_s: float) -> None:
    image[168:176, 320:328] = round(500 * stamp_s) % 256


@pytest.mark.long
@pytest.mark.parametrize("changed", [clock, noisy_pixel])
def test_a_frozen_camera_with_a_running_clock_in_its_image_is_lost(
    drive: Drive, changed: Callable[[Image, float], None]
) -> None:
    frozen = [(1.5 + 0.1 * index, drive[-1][1].copy()) for index in range(10)]
    images = []
    for stamp_s, image in drive + frozen:
        changed(shown := image.copy(), stamp_s)
        images.append((stamp_s, shown))

    observed = observe_images(images)

    assert [type(event) for event in observed.health] == [SensorLost]
    assert {
        lead.stamp_s for lead in observed.leads if lead.stamp_s >= observed.health[0].stamp_s
    } == set()


def test_a_standstill_behind_a_standing_vehicle_is_not_frozen() -> None:
    """With strong compression, nine tenths of the pixels are equal."""
    check, scene = FrameCheck(), Scene((SceneCar(GAP_M, 0.2, plate=LEAD),))

    for _, image in frames(lambda _: scene, 0.5, camera=CAMERA):
        data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 30])[1]
        assert not check.check(decode_image(data.tobytes())).is_repeat


def test_a_plate_in_the_next_lane_is_no_lead_when_the_hosts_lane_is_empty() -> None:
    observed = observe_images(rendered(SceneCar(22.0, 3.5, plate=LEAD)))

    assert observed.cars
    assert {lead.identity for lead in observed.leads} == {LeadIdentity.NO_LEAD}


@pytest.mark.long
@pytest.mark.parametrize("light", [Light.DAY, Light.OVERCAST, Light.FOG])
def test_a_camera_upside_down_is_named_and_shows_no_free_lane(light: Light) -> None:
    """It is never a free lane, and after a while each frame is discarded with the reason."""
    images = [
        np.ascontiguousarray(image[::4, ::4][::-1, ::-1])
        for _, image in frames(lambda _: Scene(light=light), 0.5, camera=CAMERA)
    ]
    drive = [(0.1 * index, images[index % 5]) for index in range(UPSIDE_DOWN_FRAMES + 20)]

    observed = observe_images(drive)

    assert {lead.identity for lead in observed.leads} == {LeadIdentity.UNKNOWN}
    assert {event.reason for event in observed.discarded} == {"upside_down_frame"}
    assert len(observed.discarded) == len(drive) - UPSIDE_DOWN_FRAMES


@pytest.mark.parametrize("light", Light)
def test_an_upright_camera_is_never_upside_down(light: Light) -> None:
    check = FrameCheck()
    ((_, image),) = frames(lambda _: Scene(light=light), 0.1, camera=CAMERA)

    assert not check.check(image).may_hide_vehicles


def test_a_still_of_a_road_is_a_frozen_camera_and_no_free_lane() -> None:
    """A file that is shown over and over, as from a test source."""
    ((_, image),) = frames(lambda _: Scene(), 0.1, camera=CAMERA)
    data = cv2.imencode(".jpg", image)[1].tobytes()

    observed = observe_images([(0.1 * index, decode_image(data)) for index in range(40)])

    assert [type(event) for event in observed.health] == [SensorLost]
    assert max(lead.stamp_s for lead in observed.leads) < 1.0
