"""Speed and brake pedal from broadcast signals, by name."""

import math
from pathlib import Path
from typing import Any

import cantools
import pytest
from cantools.database import Database
from pydantic import ValidationError

from onboard.errors import UserError
from onboard.kinematics.units import KM_H, MPH
from onboard.obd.braking import BrakeTrigger
from onboard.obd.broadcast import BroadcastSignals
from onboard.obd.can_frame import CanFrame
from onboard.obd.dbc_file import read_signals
from onboard.obd.settings import BroadcastSettings, ObdSettings
from onboard.obd.vehicle_bus import BusEvent, VehicleBus
from onboard.observations import (
    BrakeCause,
    BrakePedal,
    Discarded,
    HardBrake,
    Speed,
    Steering,
    TurnSignal,
    YawRate,
)
from tests.typed import a, about, every

DBC = """VERSION ""
NS_ :
BS_:
BU_: CAR
BO_ 176 WHEELS: 8 CAR
 SG_ FRONT_LEFT : 7|16@0+ (0.01,0) [0|300] "km/h" CAR
 SG_ FRONT_RIGHT : 23|16@0+ (0.01,0) [0|300] "km/h" CAR
 SG_ SLIP : 39|8@0+ (1,0) [0|100] "%" CAR
BO_ 2566869221 CLUSTER: 2 CAR
 SG_ SPEED : 0|8@1+ (1,0) [0|200] "MPH" CAR
BO_ 256 PEDALS: 1 CAR
 SG_ BRAKE : 0|1@1+ (1,0) [0|1] "" CAR
BO_ 257 LAMPS: 1 CAR
 SG_ LEFT : 0|1@1+ (1,0) [0|1] "" CAR
 SG_ RIGHT : 2|2@1+ (1,0) [0|3] "" CAR
BO_ 512 SAFETY: 4 CAR
 SG_ ABS_ACTIVE : 0|1@1+ (1,0) [0|1] "" CAR
 SG_ AIRBAG : 2|2@1+ (1,0) [0|3] "" CAR
 SG_ ESC : 4|3@1+ (1,0) [0|5] "" CAR
 SG_ HAZARD : 7|1@1+ (1,0) [0|1] "" CAR
 SG_ PRESSURE : 8|16@1+ (10,0) [0|30000] "kPa" CAR
 SG_ FORCE : 24|8@1+ (1,0) [0|255] "N" CAR
BO_ 513 TURNS: 6 CAR
 SG_ YAW_RATE : 0|16@1- (0.01,0) [-180|180] "deg/sec" CAR
 SG_ ANGLE : 16|16@1- (0.1,0) [-800|800] "deg" CAR
 SG_ BARE : 32|16@1- (0.001,0) [-30|30] "" CAR
BO_ 178 THREE: 6 CAR
 SG_ A : 0|16@1+ (0.01,0) [0|300] "km/h" CAR
 SG_ B : 16|16@1+ (0.01,0) [0|300] "km/h" CAR
 SG_ C : 32|16@1+ (0.01,0) [0|300] "km/h" CAR
BO_ 177 NO_RANGES: 6 CAR
 SG_ WHEEL : 7|16@0+ (0.01,0) [0|0] "km/h" CAR
 SG_ FLOAT : 23|32@0+ (1,0) [0|0] "km/h" CAR
SIG_VALTYPE_ 177 FLOAT : 1;
VAL_ 256 BRAKE 1 "pressed" 0 "released" ;
"""


@pytest.fixture(name="dbc")
def _dbc(tmp_path: Path) -> Path:
    path = tmp_path / "car.dbc"
    path.write_text(DBC, encoding="ascii")
    return path


def settings(dbc: Path, **more: Any) -> ObdSettings:
    return ObdSettings(broadcast=BroadcastSettings(dbc=dbc, **more))


def bus_of(settings: ObdSettings) -> VehicleBus:
    return VehicleBus(settings, read_signals(settings.broadcast))


def signals_of(dbc: Path, **more: Any) -> BroadcastSignals:
    return a(BroadcastSignals, read_signals(BroadcastSettings(dbc=dbc, **more)))


def frame(stamp_s: float, message: str, **values: float) -> CanFrame:
    """A frame encoded by cantools."""
    database = a(Database, cantools.database.load_string(DBC, "dbc"))
    found = database.get_message_by_name(message)
    defaults: dict[str, float] = {signal.name: 0 for signal in found.signals}
    data = found.encode(defaults | values)
    return CanFrame(stamp_s, found.frame_id, found.is_extended_frame, data)


def received(bus: VehicleBus, *frames: CanFrame) -> list[BusEvent]:
    for each in frames:
        bus.receive_frame(each, each.stamp_s)
    return list(iter(bus.next_event, None))


def test_a_speed_in_si_with_its_resolution_and_name(dbc: Path) -> None:
    bus = bus_of(settings(dbc, speed=("WHEELS.FRONT_LEFT",)))
    assert received(bus, frame(2.0, "WHEELS", FRONT_LEFT=36.0)) == [
        Speed(2.0, about(10.0), about(0.01 * KM_H), "dbc:WHEELS.FRONT_LEFT")
    ]


def test_the_speed_of_several_wheels_is_their_median(dbc: Path) -> None:
    bus = bus_of(settings(dbc, speed=("WHEELS.FRONT_LEFT", "WHEELS.FRONT_RIGHT")))
    (speed,) = every(Speed, received(bus, frame(2.0, "WHEELS", FRONT_LEFT=36.0, FRONT_RIGHT=37.0)))
    assert speed.speed_m_s == pytest.approx(36.5 * KM_H)


def test_the_unit_is_the_dbc_files_in_any_case(dbc: Path) -> None:
    bus = bus_of(settings(dbc, speed=("CLUSTER.SPEED",)))
    (speed,) = every(Speed, received(bus, frame(2.0, "CLUSTER", SPEED=60)))
    assert speed.speed_m_s == pytest.approx(60 * MPH)


def test_the_settings_may_name_another_unit(dbc: Path) -> None:
    bus = bus_of(settings(dbc, speed=("WHEELS.FRONT_LEFT",), speed_unit="m/s"))
    (speed,) = every(Speed, received(bus, frame(2.0, "WHEELS", FRONT_LEFT=36.0)))
    assert speed.speed_m_s == pytest.approx(36.0)


def test_the_turn_signals(dbc: Path) -> None:
    """Of two bits, 3 is "not available"."""
    bus = bus_of(settings(dbc, turn_signal_left="LAMPS.LEFT", turn_signal_right="LAMPS.RIGHT"))
    left, right, _, unavailable = received(
        bus, frame(2.0, "LAMPS", LEFT=1, RIGHT=0), frame(2.1, "LAMPS", LEFT=0, RIGHT=3)
    )
    assert left == TurnSignal(2.0, "left", is_on=True, source="dbc:LAMPS.LEFT")
    assert right == TurnSignal(2.0, "right", is_on=False, source="dbc:LAMPS.RIGHT")
    assert unavailable == TurnSignal(2.1, "right", is_on=False, source="dbc:LAMPS.RIGHT")


def test_the_brake_pedal(dbc: Path) -> None:
    bus = bus_of(settings(dbc, brake_pedal="PEDALS.BRAKE"))
    assert received(bus, frame(2.0, "PEDALS", BRAKE=1), frame(2.1, "PEDALS", BRAKE=0)) == [
        BrakePedal(2.0, pressed=True, source="dbc:PEDALS.BRAKE"),
        BrakePedal(2.1, pressed=False, source="dbc:PEDALS.BRAKE"),
    ]


def test_a_brake_pedal_that_is_not_available_is_not_pressed(dbc: Path) -> None:
    """Of two bits, 2 is an error and 3 is "not available" (SAE J1939-71)."""
    bus = bus_of(settings(dbc, brake_pedal="LAMPS.RIGHT"))
    seen = received(bus, *(frame(2.0, "LAMPS", LEFT=0, RIGHT=value) for value in range(4)))
    assert [each.pressed for each in every(BrakePedal, seen)] == [False, True, False, False]


@pytest.mark.parametrize(
    ("names", "values", "cause"),
    [
        ({"abs": "SAFETY.ABS_ACTIVE"}, {"ABS_ACTIVE": 1}, BrakeCause.ABS),
        ({"stability_control": "SAFETY.ESC"}, {"ESC": 2}, BrakeCause.STABILITY_CONTROL),
        ({"airbag": "SAFETY.AIRBAG"}, {"AIRBAG": 1}, BrakeCause.AIRBAG),
        ({"hazard_lights": "SAFETY.HAZARD"}, {"HAZARD": 1}, BrakeCause.HAZARD_LIGHTS),
        (
            {"brake_pressure": "SAFETY.PRESSURE", "brake_pressure_threshold_bar": 60.0},
            {"PRESSURE": 6000},
            BrakeCause.BRAKE_PRESSURE,
        ),
    ],
)
def test_a_trigger_is_active_by_its_signal(
    dbc: Path, names: dict[str, Any], values: dict[str, Any], cause: BrakeCause
) -> None:
    signals = signals_of(dbc, **names)
    (on,) = every(BrakeTrigger, signals.receive_frame(frame(2.0, "SAFETY", **values)))
    (off,) = every(BrakeTrigger, signals.receive_frame(frame(2.1, "SAFETY", PRESSURE=5990)))
    assert (on.stamp_s, on.cause, on.is_active) == (2.0, cause, True)
    assert (off.cause, off.is_active) == (cause, False)
    assert on.source.startswith("dbc:SAFETY.")


@pytest.mark.parametrize("value", [2, 3])
def test_error_and_not_available_of_two_bits_are_no_airbag(dbc: Path, value: int) -> None:
    signals = signals_of(dbc, airbag="SAFETY.AIRBAG")
    (trigger,) = every(BrakeTrigger, signals.receive_frame(frame(2.0, "SAFETY", AIRBAG=value)))
    assert not trigger.is_active


@pytest.mark.parametrize("name", ["stability_control", "airbag"])
def test_a_flag_beyond_its_range_is_discarded(dbc: Path, name: str) -> None:
    bus = bus_of(settings(dbc, **{name: "SAFETY.ESC"}))
    (discarded,) = every(
        Discarded, received(bus, CanFrame(2.0, 512, is_extended_id=False, data=b"\x70\0\0\0"))
    )
    assert (discarded.component, discarded.reason) == ("obd", "signal_range")


def test_an_airbag_is_hard_braking_while_it_is_reported(dbc: Path) -> None:
    bus = bus_of(settings(dbc, airbag="SAFETY.AIRBAG"))
    (begin,) = every(
        HardBrake, received(bus, *(frame(n / 10, "SAFETY", AIRBAG=1) for n in range(10, 20)))
    )
    assert (begin.kind, begin.cause, begin.source) == ("hard_brake", "airbag", "dbc:SAFETY.AIRBAG")
    while (at := bus.get_timer()) < 10.0:
        bus.frames_to_send(at)
        bus.handle_timer(at)
    (end,) = every(HardBrake, received(bus))
    assert end.is_over


@pytest.mark.parametrize(
    "more",
    [{"brake_pressure": "SAFETY.PRESSURE"}, {"brake_pressure_threshold_bar": 50.0}],
)
def test_brake_pressure_and_its_threshold_belong_together(dbc: Path, more: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match="is required with `brake_pressure`"):
        BroadcastSettings(dbc=dbc, **more)


def test_the_settings_may_name_another_unit_of_pressure(dbc: Path) -> None:
    named = {"brake_pressure": "SAFETY.FORCE", "brake_pressure_threshold_bar": 20.0}
    signals = signals_of(dbc, **named, brake_pressure_unit="MPa")
    (trigger,) = every(BrakeTrigger, signals.receive_frame(frame(2.0, "SAFETY", FORCE=2)))
    assert trigger.is_active


@pytest.mark.long
def test_a_wheel_of_three_that_stops_at_once_is_no_collision(dbc: Path) -> None:
    bus = bus_of(settings(dbc, speed=("THREE.A", "THREE.B", "THREE.C")))
    frames = [frame(n / 50, "THREE", A=80 * (n < 100), B=80, C=80) for n in range(200)]
    assert {event.kind for event in received(bus, *frames)} == {"speed"}


def test_11_and_29_bit_identifiers_are_distinct(dbc: Path) -> None:
    """0x100 with 29 bits is another message than 0x100 with 11."""
    bus = bus_of(settings(dbc, brake_pedal="PEDALS.BRAKE"))
    assert received(bus, CanFrame(2.0, 256, is_extended_id=True, data=b"\x01")) == []


def test_values_beyond_the_range_are_not_available(dbc: Path) -> None:
    bus = bus_of(settings(dbc, speed=("WHEELS.FRONT_LEFT",)))
    (discarded,) = every(
        Discarded, received(bus, CanFrame(2.0, 176, is_extended_id=False, data=b"\xff" * 8))
    )
    assert (discarded.component, discarded.reason) == ("obd", "signal_range")


@pytest.mark.parametrize("signal", ["WHEEL", "FLOAT"])
@pytest.mark.parametrize("number", ["ffffffff", "7f800000", "7fc00000", "47000000", "c7000000"])
def test_without_a_range_impossible_speeds_are_discarded(
    dbc: Path, signal: str, number: str
) -> None:
    """All ones, and as floating point: infinite, no number, too fast either way."""
    bus = bus_of(settings(dbc, speed=(f"NO_RANGES.{signal}",)))
    wheel = b"\xff\xff"
    (discarded,) = every(
        Discarded, received(bus, CanFrame(2.0, 177, False, wheel + bytes.fromhex(number)))
    )
    assert (discarded.component, discarded.reason) == ("obd", "signal_range")


@pytest.mark.parametrize("length", [0, 1, 7])
def test_a_frame_that_is_too_short_is_discarded(dbc: Path, length: int) -> None:
    bus = bus_of(settings(dbc, speed=("WHEELS.FRONT_LEFT",)))
    (discarded,) = every(
        Discarded, received(bus, CanFrame(2.0, 176, is_extended_id=False, data=bytes(length)))
    )
    assert (discarded.component, discarded.reason) == ("obd", "signal_decoding")


def test_while_the_speed_is_broadcast_obd_is_neither_requested_nor_used(dbc: Path) -> None:
    bus = bus_of(settings(dbc, speed=("WHEELS.FRONT_LEFT",)))
    answer = CanFrame(10.1, 0x7E8, is_extended_id=False, data=bytes.fromhex("03410D32"))
    events = received(bus, frame(10.0, "WHEELS", FRONT_LEFT=48.0), answer)
    assert [event.source for event in every(Speed, events)] == ["dbc:WHEELS.FRONT_LEFT"]
    assert bus.frames_to_send(10.4) == []
    assert bus.get_timer() == 10.5


def test_obd_takes_over_when_the_broadcast_stops(dbc: Path) -> None:
    bus = bus_of(settings(dbc, speed=("WHEELS.FRONT_LEFT",)))
    received(bus, frame(10.0, "WHEELS", FRONT_LEFT=48.0))
    assert len(bus.frames_to_send(10.5)) == 1
    answer = CanFrame(10.51, 0x7E8, is_extended_id=False, data=bytes.fromhex("03410D32"))
    assert [event.source for event in every(Speed, received(bus, answer))] == ["obd:7E8"]


def test_wheel_speed_finds_hard_braking_within_a_fifth_of_a_second(dbc: Path) -> None:
    bus = bus_of(settings(dbc, speed=("WHEELS.FRONT_LEFT",)))
    frames = [
        frame(n / 50, "WHEELS", FRONT_LEFT=100 - 28.8 * max(0.0, n / 50 - 1.0)) for n in range(100)
    ]
    alarm, *_ = [event for event in received(bus, *frames) if isinstance(event, HardBrake)]
    assert 1.0 < alarm.stamp_s < 1.2
    assert alarm.deceleration_m_s2 == pytest.approx(8.0, rel=0.2)


@pytest.mark.parametrize(
    ("more", "named"),
    [
        ({"speed": ("WHEEL.FRONT_LEFT",)}, "no message WHEEL (for WHEEL.FRONT_LEFT)"),
        ({"speed": ("WHEELS.REAR",)}, "WHEELS has no signal REAR, but FRONT_LEFT, FRONT_RIGHT"),
        ({"brake_pedal": "PEDALS"}, "PEDALS has no signal , but BRAKE"),
        ({"speed": ("WHEELS.FRONT_LEFT", "CLUSTER.SPEED")}, "belong to several messages"),
        ({"airbag": "SAFETY.BAG"}, "SAFETY has no signal BAG, but ABS_ACTIVE, AIRBAG, ESC"),
        (
            {"brake_pressure": "SAFETY.FORCE", "brake_pressure_threshold_bar": 9.0},
            "has the unit 'N'; set obd.broadcast.brake_pressure_unit to bar, kPa or MPa",
        ),
        ({"speed": ("WHEELS.SLIP",)}, "has the unit '%'; set obd.broadcast.speed_unit"),
    ],
)
def test_the_error_for_a_wrong_name_lists_the_existing_ones(
    dbc: Path, more: Any, named: str
) -> None:
    with pytest.raises(UserError) as raised:
        bus_of(settings(dbc, **more))
    assert named in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_missing_or_broken_file_is_an_error_of_one_line(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"nowhere\.dbc: cannot be read: No such file"):
        bus_of(settings(tmp_path / "nowhere.dbc"))
    broken = tmp_path / "broken.dbc"
    broken.write_text("BO_ this is no message", encoding="ascii")
    with pytest.raises(UserError, match=r"broken\.dbc: no DBC file: ") as raised:
        bus_of(settings(broken))
    assert "\n" not in str(raised.value)


FAULTY = """
BO_ 600 OVERLAPS: 1 CAR
 SG_ A : 0|6@1+ (1,0) [0|1] "" CAR
 SG_ B : 4|4@1+ (1,0) [0|1] "" CAR
BO_ 601 TOO_LONG: 1 CAR
 SG_ A : 4|8@1+ (1,0) [0|1] "" CAR

BO_ 70000 NO_STANDARD_ID: 1 CAR
 SG_ A : 0|1@1+ (1,0) [0|1] "" CAR
 SG_ 0_B : 1|1@1+ (.5,0) [0|1] "" CAR
BO_ 602 MULTIPLEXED: 4 CAR
 SG_ MUX M : 0|8@1+ (1,0) [0|255] "" CAR
 SG_ SPEED m1 : 8|16@1+ (0.01,0) [0|300] "km/h" CAR
 SG_ OTHER m2 : 8|16@1+ (0.01,0) [0|300] "km/h" CAR
CM_ SG_ 601 "A comment \x81 of no signal";
VAL_ 601 NOWHERE 1 "on" ;
"""


@pytest.mark.parametrize(
    "names",
    [
        {"speed": ("WHEELS.FRONT_LEFT", "WHEELS.FRONT_RIGHT"), "airbag": "SAFETY.AIRBAG"},
        {"brake_pedal": "OVERLAPS.B"},
        {"speed": ("NO_RANGES.FLOAT",)},
        {"speed": ("MULTIPLEXED.SPEED",)},
    ],
)
def test_faults_in_other_declarations_do_not_matter(
    dbc: Path, names: dict[str, str | tuple[str, str]] | dict[str, str] | dict[str, tuple[str]]
) -> None:
    dbc.write_text(DBC + FAULTY, encoding="latin-1")
    signals_of(dbc, **names)


def test_a_value_is_the_same_beside_faults(dbc: Path) -> None:
    dbc.write_text(DBC + FAULTY, encoding="latin-1")
    bus = bus_of(settings(dbc, speed=("NO_RANGES.FLOAT",)))
    (speed,) = every(Speed, received(bus, frame(2.0, "NO_RANGES", FLOAT=36.0)))
    assert speed.speed_m_s == pytest.approx(10.0)
    bus = bus_of(settings(dbc, speed=("MULTIPLEXED.SPEED",)))
    with_speed, without = b"\1\x10\x0e\0", b"\2\x10\x0e\0"
    frames = [CanFrame(2.0, 602, is_extended_id=False, data=data) for data in (with_speed, without)]
    assert [event.speed_m_s for event in every(Speed, received(bus, *frames))] == [
        pytest.approx(10.0)
    ]


@pytest.mark.parametrize(
    ("name", "fault"),
    [("TOO_LONG.A", "does not fit"), ("NO_STANDARD_ID.A", "more than 11 bits")],
)
def test_a_fault_in_a_named_signal_is_an_error(dbc: Path, name: str, fault: str) -> None:
    dbc.write_text(DBC + FAULTY, encoding="latin-1")
    with pytest.raises(UserError, match=rf"car\.dbc: .*{fault}"):
        read_signals(BroadcastSettings(dbc=dbc, brake_pedal=name))


def test_two_named_signals_that_overlap_are_an_error(dbc: Path) -> None:
    dbc.write_text(DBC + FAULTY, encoding="latin-1")
    with pytest.raises(UserError, match="signals B and A are overlapping"):
        read_signals(BroadcastSettings(dbc=dbc, brake_pedal="OVERLAPS.A", abs="OVERLAPS.B"))


def test_a_yaw_rate_to_the_left_is_negative(dbc: Path) -> None:
    """ISO 8855 counts it positive to the left, SAE J2735 and `onboard` to the right."""
    bus = bus_of(settings(dbc, yaw_rate="TURNS.YAW_RATE"))

    assert received(bus, frame(2.0, "TURNS", YAW_RATE=90.0)) == [
        YawRate(2.0, about(-math.pi / 2), "dbc:TURNS.YAW_RATE")
    ]


def test_the_side_of_positive_yaw_rates_and_their_unit_may_be_named(dbc: Path) -> None:
    bus = bus_of(settings(dbc, yaw_rate="TURNS.BARE", yaw_rate_positive="right", angle_unit="rad"))

    assert received(bus, frame(2.0, "TURNS", BARE=0.5)) == [
        YawRate(2.0, about(0.5), "dbc:TURNS.BARE")
    ]


def test_a_steering_wheel_at_90_degrees_steers_on_a_circle_of_its_ratio_and_wheelbase(
    dbc: Path,
) -> None:
    bus = bus_of(settings(dbc, steering_angle="TURNS.ANGLE", steering_m=45.0))

    assert received(bus, frame(2.0, "TURNS", ANGLE=90.0)) == [
        Steering(2.0, about(-math.pi / 2 / 45.0), "dbc:TURNS.ANGLE")
    ]


def test_a_yaw_rate_without_a_unit_is_an_error(dbc: Path) -> None:
    with pytest.raises(UserError, match=r"set obd\.broadcast\.angle_unit to deg or rad"):
        signals_of(dbc, yaw_rate="TURNS.BARE")


def test_a_yaw_rate_that_is_not_available_is_discarded(dbc: Path) -> None:
    bus = bus_of(settings(dbc, yaw_rate="TURNS.YAW_RATE"))

    (discarded,) = every(
        Discarded, received(bus, CanFrame(2.0, 513, is_extended_id=False, data=b"\xff\x7f\0\0\0\0"))
    )

    assert (discarded.component, discarded.reason) == ("obd", "signal_range")
