"""When all of the image is searched, and for what, where vehicles are found as such."""

import math

import numpy as np
import pytest
from typing_extensions import override

from onboard.observations import ImageBox, PlateCandidate
from onboard.vision.frames import Image
from onboard.vision.networks import load_networks
from onboard.vision.perception import Perception
from onboard.vision.plate_detector import Corners, PlateDetection
from onboard.vision.plate_reader import Plates, PlateText
from onboard.vision.settings import VisionSettings
from onboard.vision.sized_camera import Networks
from onboard.vision.vehicle_finder import VehicleFinder
from onboard.vision.vehicle_network import VehicleBox, VehicleKind
from sim_rig.rendering.scene import Scene
from tests.vision.drive import CAMERA, Observed, frames, observe

DURATION_S = 4.0
REAR = ImageBox(430.0, 230.0, 100.0, 90.0)
PLATE = PlateDetection(
    np.array([(465.0, 280.0), (495.0, 280.0), (495.0, 287.0), (465.0, 287.0)], np.float32), 0.95
)
OURS = "GN417KB"


class GivenVehicles(VehicleFinder):
    """Finds what it is told, and counts searches of all of an image and around rears."""

    def __init__(self, *boxes: ImageBox) -> None:
        self.searches = self.around_rears = 0
        self._given = [
            VehicleBox(box, (box.x_px, box.x_px + box.w_px), VehicleKind.CAR, 0.9) for box in boxes
        ]

    @override
    def find(
        self, image: Image, rear: ImageBox | None = None, most_scale: float = math.inf
    ) -> list[VehicleBox]:
        self.searches += rear is None
        self.around_rears += rear is not None
        return self._given


class NoPlates:
    """Finds no plate, and remembers where it looked."""

    def __init__(self) -> None:
        self.regions: list[ImageBox] = []

    def find(self, image: Image, region: ImageBox | None = None) -> list[PlateDetection]:
        self.regions.append(region or ImageBox(0.0, 0.0, image.shape[1], image.shape[0]))
        return []

    def find_again(self, image: Image, last: Corners) -> PlateDetection | None:
        return None

    def read_many(self, image: Image, plates: Plates) -> list[PlateText]:
        return []


class OnePlate(NoPlates):
    """Finds one plate wherever it looks."""

    @override
    def find(self, image: Image, region: ImageBox | None = None) -> list[PlateDetection]:
        super().find(image, region)
        return [PLATE]

    @override
    def find_again(self, image: Image, last: Corners) -> PlateDetection | None:
        return PLATE

    @override
    def read_many(self, image: Image, plates: Plates) -> list[PlateText]:
        return [PlateText(OURS, 0.99, 0.99, (PlateCandidate(OURS, 0.99),)) for _ in plates]


def perception(vehicles: GivenVehicles, plates: NoPlates) -> Perception:
    networks = Networks(plates, plates, vehicles)
    return Perception(CAMERA, VisionSettings(tag_dictionary=None), networks)


def watched(vehicles: GivenVehicles, plates: NoPlates) -> Observed:
    return observe(perception(vehicles, plates), frames(lambda _: Scene(), DURATION_S))


def test_on_a_free_road_vehicles_are_searched_twice_as_often_as_plates() -> None:
    vehicles, plates = GivenVehicles(), NoPlates()
    watched(vehicles, plates)

    assert 1.5 <= vehicles.searches / DURATION_S <= 2.5
    assert vehicles.around_rears == 0
    assert 0.75 <= len(plates.regions) / DURATION_S <= 1.25


def test_a_vehicle_without_a_plate_is_followed_and_its_rear_searched_for_one() -> None:
    vehicles, plates = GivenVehicles(REAR), NoPlates()
    leads = watched(vehicles, plates).leads

    assert all(lead.gap_m is not None for lead in leads[6:])
    assert 1.5 <= vehicles.searches / DURATION_S <= 2.5
    assert 4.0 <= (vehicles.searches + vehicles.around_rears) / DURATION_S <= 5.5
    on_rears = [region for region in plates.regions if region.w_px <= REAR.w_px + 1]
    assert 2.0 <= len(on_rears) / DURATION_S <= 5.5
    assert len(plates.regions) - len(on_rears) <= 1.25 * DURATION_S


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        (VisionSettings(), True),
        (VisionSettings(plates=False), False),
        (VisionSettings(plates=False, vehicles=True), True),
        (VisionSettings(vehicles=False), False),
    ],
)
def test_vehicles_are_detected_where_plates_are_by_default(
    settings: VisionSettings, *, expected: bool
) -> None:
    assert (load_networks(settings).vehicle_model is not None) is expected


def test_all_of_the_image_is_searched_for_plates_and_vehicles_in_turn_behind_a_plate() -> None:
    vehicles, plates = GivenVehicles(REAR), OnePlate()
    watched(vehicles, plates)

    everywhere = len(plates.regions) / DURATION_S
    assert 0.75 <= vehicles.searches / DURATION_S <= 1.5
    assert 0.75 <= everywhere <= 1.5


@pytest.mark.parametrize(
    ("took_s", "searches"), [(0.05, 8), (0.4, 4), (60.0, 2)], ids=["fast", "slow", "suspended"]
)
def test_searches_take_a_third_of_the_time_and_one_comes_every_2_s_at_least(
    took_s: float, searches: int
) -> None:
    """Of a processor that others take, what is followed keeps two thirds."""
    vehicles, plates = GivenVehicles(), NoPlates()
    watching, free_at = perception(vehicles, plates), 0.0
    for stamp_s, image in frames(lambda _: Scene(), DURATION_S):
        if stamp_s < free_at:
            continue  # of a live camera the newest frame is taken
        before = vehicles.searches, len(plates.regions)
        watching.receive_frame(image, stamp_s)
        is_search = before != (vehicles.searches, len(plates.regions))
        busy_s = took_s if is_search else 0.0
        watching.receive_duration(busy_s)
        free_at = stamp_s + min(busy_s, 0.5)

    assert vehicles.searches == pytest.approx(searches, abs=0.5)
