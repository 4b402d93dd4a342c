"""The rig's ECU, asked by an independent ISO-TP implementation and by hand-made frames."""

import math

import pytest

from onboard.kinematics.units import KM_H
from onboard.obd.can_frame import CanFrame
from onboard.obd.settings import ObdSettings
from onboard.obd.vehicle_bus import VehicleBus
from onboard.observations import Speed
from onboard.settings import parse_settings
from sim_rig.cars.ecu import ENGINE_11_BIT, ENGINE_29_BIT, Addresses, Ecu, separation_s


def ask(ecu: Ecu, *octets: int, to: int = 0x7DF, now: float = 0.0) -> list[CanFrame]:
    """What is on the bus within a second of a request."""
    frame = CanFrame(now, to, to > 0x7FF, bytes(octets).ljust(8, b"\0"))
    ecu.receive_frame(frame, now)
    answers = []
    while (at := ecu.get_timer()) < now + 1.0:
        answers += ecu.frames_to_send(at)
    return answers


def ecu_at(speed_km_h: float, addresses: Addresses = ENGINE_11_BIT) -> Ecu:
    return Ecu(lambda _now: speed_km_h * KM_H, addresses=addresses)


@pytest.mark.parametrize(
    ("speed_km_h", "octet"), [(0.0, 0), (49.6, 50), (50.4, 50), (255.0, 255), (300.0, 255)]
)
def test_speed_is_whole_km_h_in_one_byte(speed_km_h: float, octet: int) -> None:
    (answer,) = ask(ecu_at(speed_km_h), 2, 0x01, 0x0D)

    assert (answer.arbitration_id, answer.is_extended_id) == (0x7E8, False)
    assert answer.data[:4] == bytes([3, 0x41, 0x0D, octet])
    assert len(answer.data) == 8


def test_with_29_bit_identifiers_it_answers_under_its_own() -> None:
    (answer,) = ask(ecu_at(36, ENGINE_29_BIT), 2, 0x01, 0x0D, to=0x18DB33F1)

    assert (answer.arbitration_id, answer.is_extended_id) == (0x18DAF110, True)
    assert answer.data[:4] == bytes([3, 0x41, 0x0D, 36])


def test_the_answer_has_its_delay() -> None:
    ecu = Ecu(lambda now: now, answer_after_s=0.01)
    ecu.receive_frame(CanFrame(5.0, 0x7DF, is_extended_id=False, data=bytes([2, 1, 13])), 5.0)

    assert ecu.frames_to_send(5.005) == []
    assert ecu.get_timer() == pytest.approx(5.01)
    assert len(ecu.frames_to_send(ecu.get_timer())) == 1


def test_without_power_it_is_silent() -> None:
    ecu = Ecu(lambda _now: 10.0, runs=lambda now: now < 5.0)

    assert len(ask(ecu, 2, 0x01, 0x0D, now=4.9)) == 1
    assert ask(ecu, 2, 0x01, 0x0D, now=5.0) == []


def test_the_bitmap_names_each_supported_pid_once() -> None:
    (answer,) = ask(ecu_at(50), 2, 0x01, 0x00)

    bits = int.from_bytes(answer.data[3:7])
    assert {pid for pid in range(1, 33) if bits >> (32 - pid) & 1} == {0x04, 0x05, 0x0C, 0x0D, 0x1C}


@pytest.mark.parametrize("request_octets", [(2, 0x01, 0x7B), (2, 0x01, 0x20), (1, 0x03), (1, 0x01)])
def test_what_it_does_not_support_is_silence_to_all_and_refusal_by_name(
    request_octets: tuple[int, ...],
) -> None:
    assert ask(ecu_at(50), *request_octets) == []
    (answer,) = ask(ecu_at(50), *request_octets, to=0x7E0)
    assert answer.data[:3] == bytes([3, 0x7F, request_octets[1]])


@pytest.mark.parametrize(
    "octets", [(), (0,), (8, 1, 13), (0x21, 1, 13), (0x10, 20, 1), (0x30, 0, 0), (0xF0,)]
)
def test_frames_that_are_no_request_are_passed_over(octets: tuple[int, ...]) -> None:
    assert ask(ecu_at(50), *octets, to=0x7E0) == []


def test_frames_with_the_other_identifier_length_are_not_for_it() -> None:
    ecu = ecu_at(50)
    ecu.receive_frame(CanFrame(0.0, 0x7DF, is_extended_id=True, data=bytes([2, 1, 13])), 0.0)

    assert ecu.get_timer() == math.inf


def test_several_pids_in_one_request_come_back_in_several_frames() -> None:
    ecu = ecu_at(50)
    (first,) = ask(ecu, 4, 0x01, 0x0C, 0x0D, 0x05, to=0x7E0)
    assert first.data == bytes([0x10, 8, 0x41, 0x0C, 0x11, 0x5C, 0x0D, 50])

    (second,) = ask(ecu, 0x30, 0, 0, to=0x7E0, now=0.1)
    assert second.data[:3] == bytes([0x21, 0x05, 128])


def test_without_flow_control_in_time_the_rest_is_dropped() -> None:
    ecu = ecu_at(50)
    ask(ecu, 2, 0x09, 0x02)

    assert ask(ecu, 0x30, 0, 0, to=0x7E0, now=1.2) == []


def test_overflow_ends_the_answer_and_wait_keeps_it() -> None:
    ecu = ecu_at(50)
    ask(ecu, 2, 0x09, 0x02)
    assert ask(ecu, 0x31, 0, 0, to=0x7E0, now=0.9) == []
    assert len(ask(ecu, 0x30, 1, 0, to=0x7E0, now=1.8)) == 1
    assert ask(ecu, 0x32, 0, 0, to=0x7E0, now=1.9) == []
    assert ask(ecu, 0x30, 0, 0, to=0x7E0, now=2.0) == []


@pytest.mark.parametrize(
    ("code", "seconds"), [(0, 0.0), (10, 0.01), (0x7F, 0.127), (0xF1, 1e-4), (0xF9, 9e-4)]
)
def test_separation_time_codes(code: int, seconds: float) -> None:
    assert separation_s(code) == pytest.approx(seconds)


def test_reserved_separation_codes_are_the_longest_time() -> None:
    assert {separation_s(code) for code in (0x80, 0xF0, 0xFA, 0xFF)} == {0.127}


@pytest.mark.parametrize(("block_size", "st_min"), [(0, 0), (1, 0), (2, 5)])
def test_can_isotp_reads_the_vin_with_any_flow_control(block_size: int, st_min: int) -> None:
    isotp = pytest.importorskip("isotp")
    ecu = ecu_at(50)
    now = 0.0
    to_tester: list[CanFrame] = []

    def send(message: object) -> None:
        data = bytes(message.data)  # type: ignore[attr-defined]
        ecu.receive_frame(CanFrame(now, 0x7E0, is_extended_id=False, data=data), now)

    def receive(_timeout: float) -> object:
        if not to_tester:
            return None
        frame = to_tester.pop(0)
        return isotp.CanMessage(arbitration_id=frame.arbitration_id, data=frame.data)

    tester = isotp.TransportLayerLogic(
        receive,
        send,
        address=isotp.Address(isotp.AddressingMode.Normal_11bits, txid=0x7E0, rxid=0x7E8),
        params={"blocksize": block_size, "stmin": st_min},
    )
    tester.send(b"\x09\x02")
    for _ in range(100):
        to_tester += ecu.frames_to_send(now)
        tester.process()
        now += 0.005

    assert tester.recv() == b"\x49\x02\x01" + b"1RG0000000000001X"


@pytest.mark.parametrize("addresses", [ENGINE_11_BIT, ENGINE_29_BIT])
def test_the_car_s_own_bus_finds_it_and_reads_its_speed_twenty_times_a_second(
    addresses: Addresses,
) -> None:
    """`VehicleBus` tries both identifier lengths until an ECU answers."""
    bus = VehicleBus(parse_settings({"polling_hz": 20.0}, ObdSettings, "test"))
    ecu = Ecu(lambda now: 10.0 + now, addresses=addresses)
    now, speeds = 0.0, []
    while now < 10.0:
        for frame in bus.frames_to_send(now):
            ecu.receive_frame(frame, now)
        now = min(bus.get_timer(), ecu.get_timer())
        for frame in ecu.frames_to_send(now):
            bus.receive_frame(frame, now)
        bus.handle_timer(now)
        while (event := bus.next_event()) is not None:
            assert isinstance(event, Speed)
            speeds.append(event)

    in_last_second = [speed for speed in speeds if speed.stamp_s > 9.0]
    assert len(in_last_second) == 20
    for speed in in_last_second:
        # Half a step of 1 km/h, and what the speed changes in the ECU's 4 ms.
        assert speed.speed_m_s == pytest.approx(10.0 + speed.stamp_s, abs=0.5 * KM_H + 0.004)
