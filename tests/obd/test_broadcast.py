"""Speed and brake pedal from broadcast signals, by name."""

from pathlib import Path

import cantools
import pytest

from onboard.errors import UserError
from onboard.obd.can_frame import CanFrame
from onboard.obd.dbc_file import read_signals
from onboard.obd.settings import BroadcastSettings, ObdSettings
from onboard.obd.vehicle_bus import VehicleBus
from onboard.observations import BrakePedal, HardBrake, Speed
from onboard.units import KM_H, MPH

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
BO_ 177 NO_RANGES: 6 CAR
 SG_ WHEEL : 7|16@0+ (0.01,0) [0|0] "km/h" CAR
 SG_ FLOAT : 23|32@0+ (1,0) [0|0] "km/h" CAR
SIG_VALTYPE_ 177 FLOAT : 1;
VAL_ 256 BRAKE 1 "pressed" 0 "released" ;
"""


@pytest.fixture(name="dbc")
def _dbc(tmp_path) -> Path:
    path = tmp_path / "car.dbc"
    path.write_text(DBC, encoding="ascii")
    return path


def settings(dbc, **more):
    return ObdSettings(broadcast=BroadcastSettings(dbc=dbc, **more))


def bus_of(settings):
    return VehicleBus(settings, read_signals(settings.broadcast))


def frame(stamp_s, message, **values):
    """A frame encoded by cantools."""
    database = cantools.database.load_string(DBC, "dbc")
    found = database.get_message_by_name(message)
    defaults = {signal.name: 0 for signal in found.signals}
    data = found.encode(defaults | values)
    return CanFrame(stamp_s, found.frame_id, found.is_extended_frame, data)


def received(bus, *frames):
    for each in frames:
        bus.receive_frame(each, each.stamp_s)
    events = []
    while (event := bus.next_event()) is not None:
        events.append(event)
    return events


def test_a_speed_in_si_with_its_resolution_and_name(dbc):
    bus = bus_of(settings(dbc, speed=("WHEELS.FRONT_LEFT",)))
    assert received(bus, frame(2.0, "WHEELS", FRONT_LEFT=36.0)) == [
        Speed(2.0, pytest.approx(10.0), pytest.approx(0.01 * KM_H), "dbc:WHEELS.FRONT_LEFT")
    ]


def test_the_speed_of_several_wheels_is_their_mean(dbc):
    bus = bus_of(settings(dbc, speed=("WHEELS.FRONT_LEFT", "WHEELS.FRONT_RIGHT")))
    (speed,) = received(bus, frame(2.0, "WHEELS", FRONT_LEFT=36.0, FRONT_RIGHT=37.0))
    assert speed.speed_m_s == pytest.approx(36.5 * KM_H)


def test_the_unit_is_the_dbc_files_in_any_case(dbc):
    bus = bus_of(settings(dbc, speed=("CLUSTER.SPEED",)))
    (speed,) = received(bus, frame(2.0, "CLUSTER", SPEED=60))
    assert speed.speed_m_s == pytest.approx(60 * MPH)


def test_the_settings_may_name_another_unit(dbc):
    bus = bus_of(settings(dbc, speed=("WHEELS.FRONT_LEFT",), speed_unit="m/s"))
    assert received(bus, frame(2.0, "WHEELS", FRONT_LEFT=36.0))[0].speed_m_s == pytest.approx(36.0)


def test_the_brake_pedal(dbc):
    bus = bus_of(settings(dbc, brake_pedal="PEDALS.BRAKE"))
    assert received(bus, frame(2.0, "PEDALS", BRAKE=1), frame(2.1, "PEDALS", BRAKE=0)) == [
        BrakePedal(2.0, pressed=True, source="dbc:PEDALS.BRAKE"),
        BrakePedal(2.1, pressed=False, source="dbc:PEDALS.BRAKE"),
    ]


def test_11_and_29_bit_identifiers_are_distinct(dbc):
    """0x100 with 29 bits is another message than 0x100 with 11."""
    bus = bus_of(settings(dbc, brake_pedal="PEDALS.BRAKE"))
    assert received(bus, CanFrame(2.0, 256, is_extended_id=True, data=b"\x01")) == []


def test_values_beyond_the_range_are_not_available(dbc):
    bus = bus_of(settings(dbc, speed=("WHEELS.FRONT_LEFT",)))
    (discarded,) = received(bus, CanFrame(2.0, 176, is_extended_id=False, data=b"\xff" * 8))
    assert (discarded.component, discarded.reason) == ("obd", "signal_range")


@pytest.mark.parametrize("signal", ["WHEEL", "FLOAT"])
@pytest.mark.parametrize("number", ["ffffffff", "7f800000", "7fc00000", "47000000", "c7000000"])
def test_without_a_range_impossible_speeds_are_discarded(dbc, signal, number):
    """All ones, and as floating point: infinite, no number, too fast either way."""
    bus = bus_of(settings(dbc, speed=(f"NO_RANGES.{signal}",)))
    wheel = b"\xff\xff"
    (discarded,) = received(bus, CanFrame(2.0, 177, False, wheel + bytes.fromhex(number)))
    assert (discarded.component, discarded.reason) == ("obd", "signal_range")


@pytest.mark.parametrize("length", [0, 1, 7])
def test_a_frame_that_is_too_short_is_discarded(dbc, length):
    bus = bus_of(settings(dbc, speed=("WHEELS.FRONT_LEFT",)))
    (discarded,) = received(bus, CanFrame(2.0, 176, is_extended_id=False, data=bytes(length)))
    assert (discarded.component, discarded.reason) == ("obd", "signal_decoding")


def test_while_the_speed_is_broadcast_obd_is_neither_requested_nor_used(dbc):
    bus = bus_of(settings(dbc, speed=("WHEELS.FRONT_LEFT",)))
    answer = CanFrame(10.1, 0x7E8, is_extended_id=False, data=bytes.fromhex("03410D32"))
    events = received(bus, frame(10.0, "WHEELS", FRONT_LEFT=48.0), answer)
    assert [event.source for event in events] == ["dbc:WHEELS.FRONT_LEFT"]
    assert bus.frames_to_send(10.4) == []
    assert bus.get_timer() == 10.5


def test_obd_takes_over_when_the_broadcast_stops(dbc):
    bus = bus_of(settings(dbc, speed=("WHEELS.FRONT_LEFT",)))
    received(bus, frame(10.0, "WHEELS", FRONT_LEFT=48.0))
    assert len(bus.frames_to_send(10.5)) == 1
    answer = CanFrame(10.51, 0x7E8, is_extended_id=False, data=bytes.fromhex("03410D32"))
    assert [event.source for event in received(bus, answer)] == ["obd:7E8"]


def test_wheel_speed_finds_hard_braking_within_a_fifth_of_a_second(dbc):
    bus = bus_of(settings(dbc, speed=("WHEELS.FRONT_LEFT",)))
    frames = [
        frame(n / 50, "WHEELS", FRONT_LEFT=100 - 28.8 * max(0.0, n / 50 - 1.0)) for n in range(100)
    ]
    (alarm,) = [event for event in received(bus, *frames) if isinstance(event, HardBrake)]
    assert 1.0 < alarm.stamp_s < 1.2
    assert alarm.deceleration_m_s2 == pytest.approx(8.0, rel=0.2)


@pytest.mark.parametrize(
    ("more", "named"),
    [
        ({"speed": ("WHEEL.FRONT_LEFT",)}, "no message WHEEL (for WHEEL.FRONT_LEFT)"),
        ({"speed": ("WHEELS.REAR",)}, "WHEELS has no signal REAR, but FRONT_LEFT, FRONT_RIGHT"),
        ({"brake_pedal": "PEDALS"}, "PEDALS has no signal , but BRAKE"),
        ({"speed": ("WHEELS.FRONT_LEFT", "CLUSTER.SPEED")}, "belong to several messages"),
        ({"speed": ("WHEELS.SLIP",)}, "has the unit '%'; set obd.broadcast.speed_unit"),
    ],
)
def test_the_error_for_a_wrong_name_lists_the_existing_ones(dbc, more, named):
    with pytest.raises(UserError) as raised:
        bus_of(settings(dbc, **more))
    assert named in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_missing_or_broken_file_is_an_error_of_one_line(tmp_path):
    with pytest.raises(UserError, match=r"nowhere\.dbc: cannot be read: No such file"):
        bus_of(settings(tmp_path / "nowhere.dbc"))
    broken = tmp_path / "broken.dbc"
    broken.write_text("BO_ this is no message", encoding="ascii")
    with pytest.raises(UserError, match=r"broken\.dbc: no DBC file: ") as raised:
        bus_of(settings(broken))
    assert "\n" not in str(raised.value)
