"""The whole core: frames in, observations out, requests on the bus."""

import math
from collections.abc import Callable, Iterable, Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.kinematics.units import KM_H
from onboard.obd.can_frame import CanFrame
from onboard.obd.settings import ObdSettings
from onboard.obd.vehicle_bus import BusEvent, VehicleBus
from onboard.observations import BrakeCause, Discarded, HardBrake, Speed
from tests.typed import a, every

ENGINE, GEARBOX = 0x7E8, 0x7EA
ENGINE_29, GEARBOX_29 = 0x18DAF110, 0x18DAF118


def frame(
    stamp_s: float, identifier: int, data: str, is_extended_id: bool | None = None
) -> CanFrame:
    if is_extended_id is None:
        is_extended_id = identifier > 0x7FF
    return CanFrame(stamp_s, identifier, is_extended_id, bytes.fromhex(data))


def speed_frame(stamp_s: float, identifier: int, km_h: int) -> CanFrame:
    return frame(stamp_s, identifier, f"03 41 0D {km_h:02X} 00 00 00 00")


def events_of(bus: VehicleBus) -> list[BusEvent]:
    return list(iter(bus.next_event, None))


def received(*frames: CanFrame, settings: ObdSettings | None = None) -> list[BusEvent]:
    bus = VehicleBus(settings or ObdSettings())
    for each in frames:
        bus.receive_frame(each, each.stamp_s)
    return events_of(bus)


class Car:
    """A bus with ECUs that respond 5 ms after each functional request."""

    def __init__(
        self,
        answers: Callable[[CanFrame, float], Iterable[CanFrame]],
        settings: ObdSettings | None = None,
    ) -> None:
        self.bus = VehicleBus(settings or ObdSettings())
        self.answers = answers
        self.sent: list[CanFrame] = []

    def drive(self, start: float, end: float) -> list[BusEvent]:
        now = start
        while True:
            self.bus.handle_timer(now)
            for request in self.bus.frames_to_send(now):
                self.sent.append(request)
                for answer in self.answers(request, now + 0.005):
                    self.bus.receive_frame(answer, answer.stamp_s)
            at = self.bus.get_timer()
            if at >= end:
                return events_of(self.bus)
            now = max(at, now)


def engine(request: CanFrame, at: float, km_h: int = 50) -> Iterator[CanFrame]:
    """An ECU with 11-bit identifiers."""
    match request.arbitration_id, request.data[:3]:
        case 0x7DF, b"\x02\x01\x00":
            yield frame(at, ENGINE, "06 41 00 BE 3F A8 13 00")
        case 0x7DF, b"\x02\x01\x0d":
            yield speed_frame(at, ENGINE, km_h)


def test_a_speed_carries_value_unit_stamp_and_source() -> None:
    assert received(speed_frame(1.25, ENGINE, 50)) == [
        Speed(stamp_s=1.25, speed_m_s=50 * KM_H, resolution_m_s=KM_H, source="obd:7E8")
    ]
    assert a(Speed, received(speed_frame(1.25, ENGINE_29, 255))[0]).source == "obd:18DAF110"


def test_requests_are_functional_single_frames_padded_to_eight_bytes() -> None:
    bus = VehicleBus(ObdSettings())
    requests = [bus.frames_to_send(now)[0] for now in (1.0, 1.25, 1.5, 1.75)]
    assert [(r.arbitration_id, r.is_extended_id) for r in requests] == [
        (0x7DF, False),
        (0x7DF, False),
        (0x18DB33F1, True),
        (0x18DB33F1, True),
    ]
    assert requests[0].data == bytes.fromhex("02 01 00 CC CC CC CC CC")
    assert requests[1].data == bytes.fromhex("02 01 0D CC CC CC CC CC")


@pytest.mark.parametrize("polling_hz", [10.0, 20.0])
def test_an_ecu_that_responds_is_polled_at_the_configured_rate(polling_hz: float) -> None:
    car = Car(engine, ObdSettings(polling_hz=polling_hz))
    speeds = every(Speed, car.drive(100.0, 110.0))
    assert {speed.source for speed in speeds} == {"obd:7E8"}
    assert len(speeds) == pytest.approx(10 * polling_hz, abs=3)


def test_without_polling_no_request_is_sent() -> None:
    bus = VehicleBus(ObdSettings(polling_hz=None))
    assert bus.get_timer() == math.inf
    assert bus.frames_to_send(1.0) == []
    bus.receive_frame(speed_frame(1.0, ENGINE, 50), 1.0)
    assert len(events_of(bus)) == 1


def test_ecus_with_29_bit_identifiers_are_found() -> None:
    def answers(request: CanFrame, at: float) -> Iterator[CanFrame]:
        if request.arbitration_id == 0x18DB33F1 and request.data[2] == 0x0D:
            yield speed_frame(at, ENGINE_29, 50)

    car = Car(answers)
    speeds = every(Speed, car.drive(0.0, 3.0))
    assert {speed.source for speed in speeds} == {"obd:18DAF110"}
    assert speeds[0].stamp_s < 1.0
    assert len(speeds) > 40


def test_of_several_ecus_the_lowest_identifier_is_used() -> None:
    def answers(request: CanFrame, at: float) -> Iterator[CanFrame]:
        if request.data[2] == 0x0D and not request.is_extended_id:
            yield speed_frame(at, ENGINE, 50)
            yield speed_frame(at + 0.001, GEARBOX, 53)

    speeds = every(Speed, Car(answers).drive(0.0, 2.0))
    assert {speed.source for speed in speeds} == {"obd:7E8"}


def test_when_the_used_ecu_is_silent_for_a_second_the_next_one_is_used() -> None:
    def answers(request: CanFrame, at: float) -> Iterator[CanFrame]:
        if request.data[2] == 0x0D and not request.is_extended_id:
            if at < 2.0:
                yield speed_frame(at, ENGINE, 50)
            yield speed_frame(at + 0.001, GEARBOX, 53)

    events = Car(answers).drive(0.0, 5.0)
    gearbox = [event for event in every(Speed, events) if event.source == "obd:7EA"]
    assert 2.9 < gearbox[0].stamp_s < 3.1


@pytest.mark.parametrize(
    ("gearbox_km_h", "causes"),
    [(0, [BrakeCause.COLLISION]), (53, []), (None, [BrakeCause.COLLISION])],
)
def test_a_speed_that_collapses_is_a_collision_unless_another_ecu_contradicts(
    gearbox_km_h: int | None, causes: list[BrakeCause]
) -> None:
    def answers(request: CanFrame, at: float) -> Iterator[CanFrame]:
        if request.data[2] == 0x0D and not request.is_extended_id:
            yield speed_frame(at, ENGINE, 50 if at < 3.0 else 0)
            if gearbox_km_h is not None:
                yield speed_frame(at + 0.001, GEARBOX, 53 if at < 3.0 else gearbox_km_h)

    events = Car(answers).drive(0.0, 5.0)
    assert [event.cause for event in events if isinstance(event, HardBrake)] == causes


def test_braking_ends_by_the_timer_when_the_bus_falls_silent() -> None:
    def answers(request: CanFrame, at: float) -> Iterator[CanFrame]:
        if request.data[2] == 0x0D and not request.is_extended_id and at < 3.0:
            yield speed_frame(at, ENGINE, round(100 - 28.8 * max(0.0, at - 2.0)))

    events = Car(answers).drive(0.0, 6.0)
    brakes = [event for event in events if isinstance(event, HardBrake)]
    assert [brake.is_over for brake in brakes].count(True) == 1
    assert brakes[-1].is_over
    assert 4.0 < brakes[-1].stamp_s < 4.3


def test_a_bus_without_ecus_gets_four_requests_a_second() -> None:
    car = Car(lambda request, at: ())
    assert car.drive(0.0, 10.0) == []
    assert len(car.sent) == 40


def test_a_long_response_gets_flow_control_at_the_ecus_address() -> None:
    bus = VehicleBus(ObdSettings(addressing="11-bit"))
    bus.frames_to_send(1.0)
    bus.frames_to_send(1.25)  # asks for the speed
    bus.receive_frame(frame(1.26, GEARBOX, "10 0C 41 0D 32 0C 1A F8"), 1.26)
    (go_on,) = bus.frames_to_send(1.26)
    assert (go_on.arbitration_id, go_on.data[:3]) == (0x7E2, b"\x30\x00\x00")
    bus.receive_frame(frame(1.27, GEARBOX, "21 11 80 05 7B 0F 40 55"), 1.27)
    assert events_of(bus) == [Speed(1.27, 50 * KM_H, KM_H, "obd:7EA")]


def test_a_long_response_with_29_bits_gets_flow_control_at_the_ecus_address() -> None:
    bus = VehicleBus(ObdSettings(addressing="29-bit"))
    bus.frames_to_send(1.0)
    bus.frames_to_send(1.25)
    bus.receive_frame(frame(1.26, GEARBOX_29, "10 0C 41 0D 32 0C 1A F8"), 1.26)
    (go_on,) = bus.frames_to_send(1.26)
    assert (go_on.arbitration_id, go_on.is_extended_id) == (0x18DA18F1, True)


def test_a_response_that_is_longer_than_can_be_taken_is_refused_by_flow_control() -> None:
    """Told to go on, an ECU would fill the bus with as many frames as its length says."""
    bus = VehicleBus(ObdSettings(addressing="11-bit"))
    bus.frames_to_send(1.0)
    bus.frames_to_send(1.25)
    bus.receive_frame(frame(1.26, GEARBOX, "10 00 FF FF FF FF 41 0D"), 1.26)
    (refusal,) = bus.frames_to_send(1.26)
    assert (refusal.arbitration_id, refusal.data[:3]) == (0x7E2, b"\x32\x00\x00")
    assert [each.reason for each in every(Discarded, events_of(bus))] == ["n_buffer_overflow"]


def test_another_testers_long_response_is_read_without_flow_control() -> None:
    bus = VehicleBus(ObdSettings())
    bus.frames_to_send(1.0)
    bus.receive_frame(frame(1.01, ENGINE, "10 0C 41 0C 1A F8 0D 32"), 1.01)
    assert bus.frames_to_send(1.01) == []
    bus.receive_frame(frame(1.02, ENGINE, "21 11 80 05 7B 0F 40 55"), 1.02)
    assert [event.speed_m_s for event in every(Speed, events_of(bus))] == [50 * KM_H]


def test_a_long_response_that_stops_is_aborted_and_counted() -> None:
    bus = VehicleBus(ObdSettings(polling_hz=None))
    bus.receive_frame(frame(1.0, ENGINE, "10 0C 41 0C 1A F8 0D 32"), 1.0)
    assert bus.get_timer() == 2.0
    bus.handle_timer(2.0)
    (discarded,) = every(Discarded, events_of(bus))
    assert (discarded.reason, discarded.stamp_s) == ("n_timeout_cr", 2.0)


def test_long_responses_of_two_ecus_do_not_mix() -> None:
    events = received(
        frame(1.00, ENGINE, "10 0C 41 0C 1A F8 0D 32"),
        frame(1.01, GEARBOX, "10 0C 41 0C 1A F8 0D 33"),
        frame(1.02, GEARBOX, "21 11 80 05 7B 0F 40 55"),
        frame(1.03, ENGINE, "21 11 80 05 7B 0F 40 55"),
    )
    assert [(event.source, round(event.speed_m_s / KM_H)) for event in every(Speed, events)] == [
        ("obd:7EA", 51),
        ("obd:7E8", 50),
    ]


def test_response_pending_is_no_fault() -> None:
    def answers(request: CanFrame, at: float) -> Iterator[CanFrame]:
        if request.data[2] == 0x0D and not request.is_extended_id:
            yield frame(at, ENGINE, "03 7F 01 78 00 00 00 00")
            yield speed_frame(at + 0.3, ENGINE, 50)

    assert {event.kind for event in Car(answers).drive(0.0, 5.0)} == {"speed"}


def test_a_negative_response_is_counted_with_its_code() -> None:
    (discarded,) = received(frame(1.0, ENGINE, "03 7F 01 12 00 00 00 00"))
    assert discarded == Discarded(1.0, "obd", "negative_response", "7E8: response code 0x12")


@pytest.mark.parametrize(
    ("identifier", "data"),
    [
        (ENGINE, "02 43 00 00 00 00 00 00"),
        (ENGINE, "03 7F 22 31 00 00 00 00"),
        (ENGINE, "04 41 0C 1A F8 00 00 00"),
        (ENGINE, "30 00 00 00 00 00 00 00"),
        (0x7DF, "02 01 0D 00 00 00 00 00"),
        (0x7E0, "02 01 0D 00 00 00 00 00"),
        (0x7E7, "03 41 0D 32 00 00 00 00"),
        (0x7F0, "03 41 0D 32 00 00 00 00"),
        (0x18DAF210, "03 41 0D 32 00 00 00 00"),
        (0x123, ""),
    ],
)
def test_frames_of_other_services_are_ignored(identifier: int, data: str) -> None:
    assert received(frame(1.0, identifier, data)) == []


def test_an_11_bit_response_under_a_29_bit_identifier_is_ignored() -> None:
    assert received(frame(1.0, ENGINE, "03 41 0D 32", is_extended_id=True)) == []


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        ("", "frame_length"),
        ("03", "single_frame_length"),
        ("03 41 0D", "single_frame_length"),
        ("08 41 0D 32 00 00 00 00", "single_frame_length"),
        ("03 41 0D 32 00 00 00 00 00 00 00 00", "frame_length"),
        ("02 41 0D 00 00 00 00 00", "pid_length"),
        ("04 41 0D 32 00 00 00 00", "pid_length"),
        ("22 01 02 03 04 05 06 07", "unexpected_consecutive_frame"),
        ("90 41 0D 32", "n_pci_type"),
        ("02 7F 01 00 00 00 00 00", "negative_response_length"),
    ],
)
def test_invalid_frames_are_discarded_with_their_reason(data: str, reason: str) -> None:
    (discarded,) = every(Discarded, received(frame(1.0, ENGINE, data)))
    assert (discarded.component, discarded.reason, discarded.stamp_s) == ("obd", reason, 1.0)
    assert discarded.detail.startswith("7E8: ")


def test_hard_braking_follows_the_speed_that_made_it_certain() -> None:
    events = received(
        *(speed_frame(i / 20, ENGINE, max(0, 100 - 2 * max(0, i - 20))) for i in range(60))
    )
    at, *_ = [n for n, event in enumerate(events) if isinstance(event, HardBrake)]
    assert isinstance(events[at - 1], Speed)
    assert events[at - 1].stamp_s == events[at].stamp_s


@given(
    st.lists(
        st.builds(
            CanFrame,
            stamp_s=st.floats(0, 100),
            arbitration_id=st.sampled_from([ENGINE, GEARBOX, ENGINE_29, 0x7DF, 0x100]),
            is_extended_id=st.booleans(),
            data=st.binary(max_size=12),
        ),
        max_size=40,
    )
)
def test_no_traffic_raises(frames: list[CanFrame]) -> None:
    bus = VehicleBus(ObdSettings())
    for each in sorted(frames, key=lambda each: each.stamp_s):
        bus.receive_frame(each, each.stamp_s)
        bus.handle_timer(each.stamp_s)
        bus.frames_to_send(each.stamp_s)
    for event in events_of(bus):
        assert event.kind in {"speed", "hard_brake", "discarded"}
