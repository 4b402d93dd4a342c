"""The studies' world: footers passed as decoded values give the same results as bytes."""

import numpy as np

from onboard.mvs.multi_vehicle_sensing import MultiVehicleSensing
from onboard.mvs.received_footers import SharedEntries
from onboard.mvs.settings import MvsSettings, SensingSettings
from sim_rig.propagation.path_loss import LogDistance
from sim_rig.scenario.radio_settings import CsmaSettings
from sim_rig.studies.mvs_roads import SixLaneRoad
from sim_rig.studies.mvs_world import START_UTC_S, MvsWorld, WorldSettings

SETTINGS = MvsSettings(sensing=SensingSettings(face_to_centre_m=0.0, face_to_centre_sigma_m=0.0))


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


def test_a_core_computes_the_same_from_decoded_footers_and_from_bytes() -> None:
    road = SixLaneRoad(4, 25.0, 2.0, 1.0, np.random.default_rng(1))
    world = MvsWorld(road, set(road.names[::3]), WorldSettings(loss=0.2), SETTINGS, seed=1)
    world.tick()
    own = road.names[0]
    doubled = world.cores[own] = Doubled(world.own_id(own), world)  # type: ignore[assignment]
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

    assert set(world.cores) == set(road.names[:4])
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
        receivers == set(world.cores) - {sender} for sender, receivers in receivers_of.items()
    )
    assert len(world.cores[road.names[0]].kinematic_info(world.now)) > len(world.cores)

    weak_radio = CsmaSettings(tx_power_dbm=-10.0, path_loss=LogDistance(exponent=5.0))
    far = near.model_copy(update={"csma": weak_radio})
    weak = MvsWorld(road, set(road.names[::2]), far, SETTINGS, seed=1)
    weak.tick()
    assert all(len(sent.receivers) < len(weak.cores) - 1 for sent in weak.sent)
