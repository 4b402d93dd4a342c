"""LCCA of the MVS studies' cars: groups form by plate cameras; braking reaches the followers."""

from pathlib import Path

import numpy as np
import pytest
from typing_extensions import override

from onboard.kinematics.units import KM_H
from onboard.lcca.events import WarningOver, WarningRaised
from onboard.lcca.settings import LccaSettings
from onboard.observations import HardBrake, Lead
from onboard.risk.settings import RiskSettings
from sim_rig.roads.cars import Cars, Traffic
from sim_rig.roads.driver import ReactionSettings
from sim_rig.roads.events import TrafficEventKind
from sim_rig.scenario.sensor_settings import LensSettings
from sim_rig.studies.lcca.study_lcca import GroupWarning
from sim_rig.studies.mvs.encounter import EncounterCase, Encounters, EncounterSettings, Method
from sim_rig.studies.mvs.lcca import FORMING_S, LccaFleet
from sim_rig.studies.mvs.profiles import WORLD_PROFILES
from sim_rig.studies.mvs.sampled_bus import TICK_S
from sim_rig.studies.radio.lossy_reach import LossyReach
from tests.sim_rig.roads.lane_trace import write_lane

SPEED_M_S, HEADWAY_M = 15.0, 16.0
NAMES = ("first", "second", "third", "beside")
BEGIN_S = FORMING_S


class Lane(Traffic):
    """Three cars behind each other, north-east, and one in the next lane beside the second."""

    @override
    def cars_at(self, at_s: float) -> Cars:
        along_m = SPEED_M_S * at_s - HEADWAY_M * np.array([0.0, 1.0, 2.0, 1.0])
        left_m = np.array([0.0, 0.0, 0.0, 3.5])
        east_m, north_m = along_m - left_m, along_m + left_m
        middle_m = np.stack([east_m, north_m], axis=1) / np.sqrt(2.0)
        same = np.ones(len(NAMES))
        speed_m_s, heading_rad = SPEED_M_S * same, np.pi / 4.0 * same
        return Cars(
            at_s, NAMES, middle_m, heading_rad, speed_m_s, 0.0 * same, 4.5 * same, 1.8 * same
        )


def fleet_of(*equipped: str, loss: float = 0.0) -> LccaFleet:
    fleet = LccaFleet(
        set(equipped),
        LensSettings(),
        LccaSettings(),
        radio=LossyReach(300.0, loss, np.random.default_rng(2)),
        speed_step_m_s=KM_H,
        seed=1,
    )
    fleet.form(Lane(), BEGIN_S)
    return fleet


def warnings(fleet: LccaFleet, name: str) -> list[GroupWarning]:
    return [report for _, report in fleet.take_reports(name) if not isinstance(report, Lead)]


def brake(fleet: LccaFleet, name: str) -> None:
    """Let a car brake hard for one tick."""
    stamp_s = BEGIN_S + 0.02
    fleet.receive_hard_brake(name, HardBrake(stamp_s, 6.0, "test"))
    over = HardBrake(stamp_s + TICK_S, 0.0, "test", is_over=True)
    fleet.receive_hard_brake(name, over)
    fleet.drive(Lane().cars_at(BEGIN_S), BEGIN_S + TICK_S)


def test_who_reads_the_lead_plate_is_warned_of_its_braking_and_of_its_end() -> None:
    fleet = fleet_of(*NAMES)
    assert {name: fleet.lead_of(name) for name in NAMES} == {
        "first": None,
        "second": "first",
        "third": "second",
        "beside": None,
    }

    brake(fleet, "first")

    for name in ("second", "third"):
        (warning,) = warnings(fleet, name)
        assert isinstance(warning, WarningRaised)
        assert fleet.name_of(warning.origin_id) == "first"
        assert warning.stamp_s - BEGIN_S <= 0.1
    assert warnings(fleet, "first") == warnings(fleet, "beside") == []

    fleet.drive(Lane().cars_at(BEGIN_S + TICK_S), BEGIN_S + 2 * TICK_S)
    assert [type(each) for each in warnings(fleet, "second")] == [WarningOver]


@pytest.mark.parametrize(
    ("equipped", "loss"),
    [(("second", "third"), 0.0), (("first", "third"), 0.0), (NAMES, 1.0)],
    ids=["who brakes has no radio", "a car without radio between them", "all messages are lost"],
)
def test_without_messages_of_the_lead_nobody_is_warned(
    equipped: tuple[str, ...], loss: float
) -> None:
    fleet = fleet_of(*equipped, loss=loss)

    brake(fleet, "first")

    assert all(not warnings(fleet, name) for name in NAMES)


def test_a_car_that_leaves_has_no_part_any_more() -> None:
    fleet = fleet_of(*NAMES)
    fleet.drive(Lane().cars_at(BEGIN_S).without("second"), BEGIN_S + TICK_S)
    later_s = BEGIN_S + TICK_S
    fleet.receive_hard_brake("second", HardBrake(later_s, 6.0, "test"))
    fleet.drive(Lane().cars_at(later_s).without("second"), later_s + TICK_S)

    assert warnings(fleet, "third") == []


@pytest.mark.parametrize("profile", ["plate-camera", "camera-60"])
def test_only_cars_that_read_plates_are_warned_by_their_group(tmp_path: Path, profile: str) -> None:
    """The first of two cars brakes, too slow for any other alarm."""
    trace = write_lane(tmp_path / "lane.csv", 2)
    settings = EncounterSettings(
        scenes=(trace,),
        world=WORLD_PROFILES[profile],
        risk=RiskSettings(least_speed_m_s=20.0),
        reactions=ReactionSettings(distracted=1.0),
    )
    case = EncounterCase(TrafficEventKind.SUDDEN_BRAKE, Method.MVS, 1.0)

    outcome = Encounters(settings).run(case, seed=1)

    assert (outcome.first_warning_s is not None) == (profile == "plate-camera")
    assert outcome.false_warnings == 0
