"""Speed and brake pedal broadcast by a DBC file, as the car's own decoder reads them."""

from collections import Counter
from pathlib import Path

import pytest
from cantools.database import Database, load_file, load_string
from hypothesis import example, given
from hypothesis import strategies as st

from onboard.errors import UserError
from onboard.kinematics.units import KM_H
from onboard.obd.broadcast import BroadcastSignals
from onboard.obd.can_frame import CanFrame
from onboard.obd.settings import BroadcastSettings
from onboard.observations import BrakePedal, Speed, Steering, YawRate
from sim_rig.cars.broadcast_unit import BroadcastUnit
from sim_rig.scenario.catalogue import SCENARIOS
from sim_rig.scenario.schema import Scenario, load_scenario
from tests.typed import a

DBC = SCENARIOS / "wheel-speeds.dbc"
WHEELS = ("FRONT_LEFT", "FRONT_RIGHT", "REAR_LEFT", "REAR_RIGHT")
SIGNALS = BroadcastSettings(
    dbc=DBC, speed=tuple(f"WHEEL_SPEEDS.{wheel}" for wheel in WHEELS), brake_pedal="BRAKE.PEDAL"
)


def speeds_in(database: object, frame: CanFrame) -> dict[str, float]:
    speeds: dict[str, float] = a(dict, a(Database, database).decode_message(288, frame.data))
    return speeds


def braking(now: float) -> float:
    """15 m/s, and from 1 s on braking with 6 m/s^2."""
    return max(0.0, 15.0 - 6.0 * max(0.0, now - 1.0))


def unit(settings: BroadcastSettings = SIGNALS, dbc: str | None = None) -> BroadcastUnit:
    return BroadcastUnit(settings, dbc if dbc is not None else DBC.read_text("latin-1"), braking)


def frames_until(sender: BroadcastUnit, until_s: float) -> list[CanFrame]:
    frames: list[CanFrame] = []
    while (now := sender.get_timer()) <= until_s:
        frames += sender.frames_to_send(now)
    return frames


def test_the_cars_decoder_reads_the_true_speed_and_the_pedal() -> None:
    decoder = BroadcastSignals(SIGNALS, DBC.read_text("latin-1"))
    read = [each for frame in frames_until(unit(), 1.99) for each in decoder.receive_frame(frame)]
    speeds = [each for each in read if isinstance(each, Speed)]
    assert len(speeds) == 100
    for speed in speeds:
        assert speed.speed_m_s == pytest.approx(braking(speed.stamp_s), abs=0.005 * KM_H + 1e-9)
    pressed_at = [each.stamp_s for each in read if isinstance(each, BrakePedal) and each.pressed]
    assert pressed_at[0] == pytest.approx(1.05)


def test_messages_have_the_rates_of_the_file() -> None:
    frames = frames_until(unit(), 0.999)
    sent = Counter(frame.arbitration_id for frame in frames)
    assert sent == {288: 50, 289: 20}


def test_a_message_without_a_rate_is_sent_fifty_times_a_second() -> None:
    dbc = DBC.read_text("latin-1").replace('BA_ "GenMsgCycleTime" BO_ 289 50;', "")
    frames = frames_until(unit(dbc=dbc), 0.999)
    assert sum(frame.arbitration_id == 289 for frame in frames) == 50


@given(late_s=st.floats(0.0, 5.0))
@example(late_s=0.58)
def test_after_a_pause_each_message_comes_once_and_keeps_its_phase(late_s: float) -> None:
    sender = unit()
    assert len(sender.frames_to_send(late_s)) == 2
    assert late_s < sender.get_timer() <= late_s + 0.02 + 1e-9
    assert sender.get_timer() / 0.01 == pytest.approx(round(sender.get_timer() / 0.01), abs=1e-6)


def test_another_unit_may_be_stated_in_the_settings() -> None:
    dbc = DBC.read_text("latin-1").replace('"km/h"', '""')
    settings = SIGNALS.model_copy(update={"speed_unit": "mph"})
    frame = unit(settings, dbc).frames_to_send(0.0)[0]
    decoded = speeds_in(load_string(dbc), frame)
    assert decoded["FRONT_LEFT"] == pytest.approx(15.0 * 3600.0 / 1609.344, abs=0.005)


@pytest.mark.parametrize("speed_m_s", [0.0, 182.0, 183.0, 1e6, -1.0])
def test_a_speed_that_the_bits_cannot_carry_is_sent_as_the_nearest(speed_m_s: float) -> None:
    sender = BroadcastUnit(SIGNALS, DBC.read_text("latin-1"), lambda _now: speed_m_s)
    frame = sender.frames_to_send(0.0)[0]
    decoded = speeds_in(load_file(DBC), frame)
    nearest_km_h = min(max(speed_m_s / KM_H, 0.0), 655.35)
    assert decoded["REAR_LEFT"] == pytest.approx(nearest_km_h, abs=0.005)


def test_signals_that_are_not_in_the_file_are_refused() -> None:
    settings = SIGNALS.model_copy(update={"brake_pedal": "BRAKE.PEDALS"})
    with pytest.raises(UserError, match="PEDALS"):
        unit(settings)


def test_a_scenario_names_a_dbc_file_of_the_rig_or_of_ones_own(tmp_path: Path) -> None:
    cars = load_scenario("wheel-speeds").cars
    assert cars["green"].broadcast is not None
    assert cars["green"].broadcast.dbc == DBC
    own = tmp_path / "own.dbc"
    own.write_text(DBC.read_text("latin-1"), "latin-1")
    tree = load_scenario("wheel-speeds").model_dump()
    tree["cars"]["green"]["broadcast"]["dbc"] = own
    broadcast = Scenario.model_validate(tree).cars["green"].broadcast
    assert broadcast is not None
    assert broadcast.dbc == own


@pytest.mark.parametrize("yaw_rate_rad_s", [0.1, -0.05])
def test_the_cars_decoder_reads_how_the_car_turns(yaw_rate_rad_s: float) -> None:
    settings = BroadcastSettings(
        dbc=DBC, yaw_rate="TURNING.YAW_RATE", steering_angle="TURNING.STEERING_ANGLE"
    )
    text = DBC.read_text("latin-1")
    sender = BroadcastUnit(settings, text, lambda _now: 15.0, lambda _now: yaw_rate_rad_s)
    decoder = BroadcastSignals(settings, text)

    yaw_rate, steering = decoder.receive_frame(sender.frames_to_send(0.0)[0])

    assert a(YawRate, yaw_rate).yaw_rate_rad_s == pytest.approx(-yaw_rate_rad_s, abs=1e-4)
    assert a(Steering, steering).curvature_1_m == pytest.approx(-yaw_rate_rad_s / 15.0, abs=1e-4)


def test_the_bus_of_a_car_counts_to_the_left_whatever_the_settings_say() -> None:
    """So a scenario has a sensor of the wrong sign by a mistake in the settings, as a user does."""
    right = BroadcastSettings(dbc=DBC, yaw_rate="TURNING.YAW_RATE", yaw_rate_positive="right")
    text = DBC.read_text("latin-1")
    sender = BroadcastUnit(right, text, lambda _now: 15.0, lambda _now: 0.1)

    (yaw_rate,) = BroadcastSignals(right, text).receive_frame(sender.frames_to_send(0.0)[0])

    assert a(YawRate, yaw_rate).yaw_rate_rad_s == pytest.approx(0.1, abs=1e-4)
