"""The studies' world: footers passed as decoded values give the same results as bytes."""

import math

import numpy as np
import pytest

from onboard.mvs.multi_vehicle_sensing import MultiVehicleSensing
from onboard.mvs.received_footers import SharedEntries
from onboard.mvs.settings import MvsSettings, SensingSettings
from onboard.observations import VehicleDetection
from sim_rig.propagation.path_loss import LogDistance
from sim_rig.scenario.radio_settings import CsmaSettings
from sim_rig.studies.mvs.profiles import WORLD_PROFILES
from sim_rig.studies.mvs.roads import SixLaneRoad
from sim_rig.studies.mvs.world import START_UTC_S, MvsWorld
from sim_rig.studies.mvs.world_settings import WorldSettings
from tests.typed import a

SETTINGS = MvsSettings(sensing=SensingSettings(face_to_centre_m=0.0, face_to_centre_sigma_m=0.0))


def detections_of(settings: WorldSettings) -> list[tuple[VehicleDetection, str]]:
    """What the first car of a six-lane road detects in one tick, and of which car."""
    road = SixLaneRoad(4, 25.0, 1.0, 1.0, np.random.default_rng(1))
    world = MvsWorld(road, {road.names[0]}, settings, SETTINGS, seed=1)
    world.tick()
    core = Recorded()
    world.cars[road.names[0]].sharing.mvs = core  # type: ignore[assignment]
    world.tick()
    names = {int.from_bytes(world.own_id(name)): name for name in road.names}
    return [(each, names[each.track_id]) for each in core.detections]


class Recorded:
    """Stands for a core; keeps the detections."""

    def __init__(self) -> None:
        self.detections: list[VehicleDetection] = []

    def receive_detection(self, detection: VehicleDetection) -> None:
        self.detections.append(detection)

    def receive_position(self, _: object) -> None:
        """Not kept."""

    def footer_to_send(self, _: float) -> None:
        """Nothing is sent."""

    def heading(self, _: float) -> None:
        """It has none."""


def test_a_sensor_has_a_field_of_view() -> None:
    sure = WorldSettings(detection=1.0, sensing_range_m=100.0)
    everywhere = detections_of(sure)
    ahead = detections_of(sure.model_copy(update={"view_deg": 90.0}))

    assert max(abs(each.bearing_rad) for each, _ in everywhere) > np.pi / 2.0
    assert ahead
    assert max(abs(each.bearing_rad) for each, _ in ahead) < np.radians(50.0)


def test_a_camera_for_plates_detects_rears_only() -> None:
    """The six lanes have three directions each: cars 0 to 11 drive one way."""
    sure = WorldSettings(detection=1.0, sensing_range_m=100.0)
    rears = detections_of(sure.model_copy(update={"rear_only": True}))

    assert {name for _, name in rears} < {name for _, name in detections_of(sure)}
    assert all(int(name.removeprefix("car")) < 12 for _, name in rears)
    assert all(abs(each.bearing_rad) < np.radians(65.0) for each, _ in rears)


def test_a_radar_measures_range_rates() -> None:
    for name, has_rates in (("radar-150", True), ("camera-60", False)):
        seen = detections_of(WORLD_PROFILES[name].model_copy(update={"detection": 1.0}))
        assert seen
        assert {each.range_rate_m_s is not None for each, _ in seen} == {has_rates}


class Doubled:
    """Two new cores of one car; the second receives every footer as bytes."""

    def __init__(self, own_id: bytes, world: MvsWorld) -> None:
        self.world = world
        self.core, self.twin = (
            MultiVehicleSensing(SETTINGS, own_id, np.random.default_rng(0), START_UTC_S)
            for _ in range(2)
        )
        self.footers = 0

    def __getattr__(self, name: str) -> object:
        def call(*arguments: object) -> object:
            self.footers += sum(isinstance(each, SharedEntries) for each in arguments)
            data = self.world.sent[-1].footer if self.world.sent else b""
            wire = [data if isinstance(each, SharedEntries) else each for each in arguments]
            getattr(self.twin, name)(*wire)
            return getattr(self.core, name)(*arguments)

        return call


@pytest.mark.long
def test_a_core_computes_the_same_from_decoded_footers_and_from_bytes() -> None:
    road = SixLaneRoad(4, 25.0, 2.0, 1.0, np.random.default_rng(1))
    world = MvsWorld(road, set(road.names[::3]), WorldSettings(loss=0.2), SETTINGS, seed=1)
    world.tick()
    own = road.names[0]
    doubled = Doubled(world.own_id(own), world)
    world.cars[own].sharing.mvs = doubled  # type: ignore[assignment]
    for _ in range(9):
        world.tick()

    known = doubled.core.kinematic_info(world.now)

    assert doubled.footers > 30
    assert len(known) > 10
    assert known == doubled.twin.kinematic_info(world.now)


def test_a_lost_message_has_no_receivers_and_a_car_without_radio_has_no_core() -> None:
    road = SixLaneRoad(2, 25.0, 1.0, 1.0, np.random.default_rng(1))
    world = MvsWorld(road, set(road.names[:4]), WorldSettings(loss=1.0), SETTINGS, seed=1)
    world.tick()

    assert set(world.cars) == set(road.names[:4])
    assert len(world.sent) == 4
    assert all(sent.receivers == () for sent in world.sent)


def test_over_the_channel_near_cars_receive_and_far_cars_do_not() -> None:
    road = SixLaneRoad(2, 25.0, 3.0, 1.0, np.random.default_rng(1))
    near = WorldSettings(csma=CsmaSettings())
    world = MvsWorld(road, set(road.names[::2]), near, SETTINGS, seed=1)
    for _ in range(10):
        world.tick()
    receivers_of = {sent.sender: set(sent.receivers) for sent in world.sent}

    assert len(receivers_of) >= 5
    assert all(
        receivers == set(world.cars) - {sender} for sender, receivers in receivers_of.items()
    )
    assert len(world.cars[road.names[0]].sharing.mvs.kinematic_info(world.now)) > len(world.cars)

    weak_radio = CsmaSettings(tx_power_dbm=-10.0, path_loss=LogDistance(exponent=5.0))
    far = near.model_copy(update={"csma": weak_radio})
    weak = MvsWorld(road, set(road.names[::2]), far, SETTINGS, seed=1)
    weak.tick()
    assert all(len(sent.receivers) < len(weak.cars) - 1 for sent in weak.sent)


def test_receivers_get_the_bsms_of_their_neighbours() -> None:
    """With the sender's size, speed and heading, east or west; its own are not among them."""
    road = SixLaneRoad(2, 25.0, 1.0, 1.0, np.random.default_rng(1))
    equipped = road.names[::3]
    world = MvsWorld(road, set(equipped), WorldSettings(), SETTINGS, seed=1)
    for _ in range(3):
        world.tick()
    cars = world.traffic.cars_at(world.now)
    names = {world.own_id(name): name for name in equipped}

    assert set(world.cars) == set(equipped)
    for receiver, each_car in world.cars.items():
        messages = each_car.received
        senders = [names[each.core.temporary_id] for each in messages]
        assert set(senders) == set(equipped) - {receiver}
        for name, each in zip(senders, messages, strict=True):
            car = cars.names.index(name)
            assert each.core.size.length_m == round(float(cars.length_m[car]), 2)
            assert each.core.speed_m_s == pytest.approx(cars.speed_m_s[car], abs=1.0)
            heading_rad = a(float, each.core.heading_rad)
            ahead = math.sin(heading_rad), math.cos(heading_rad)
            assert ahead == pytest.approx(cars.ahead[car], abs=0.1)
