"""The signals ahead by MAP and SPAT messages, and which messages are refused."""

from dataclasses import replace

import pytest

from onboard.intersections import intersections as core
from onboard.intersections.approach_lane import MAX_NODES, ApproachLane, Point
from onboard.intersections.intersection import ApproachedSignal
from onboard.intersections.intersections import Intersections, SignalAhead
from onboard.intersections.signal_phase import SignalPhase
from onboard.kinematics.local_frame import LocalFrame
from onboard.messages import map_data, spat
from onboard.messages.fields import Chosen
from onboard.messages.lane_nodes import ComputedLane
from onboard.messages.lanes import IntersectionReferenceId
from onboard.messages.map_data import MapData, ReferencePoint
from onboard.messages.spat import IntersectionStatus, MovementPhaseState, Spat
from onboard.observations import Discarded, Position
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject
from tests.intersections.test_signal_phase import GREEN, RED, SENT_UTC_S
from tests.messages.crossing_messages import (
    ID,
    crossing_map,
    crossing_spat,
    intersections_of,
    lane,
    movement,
    ways_of,
)
from tests.typed import a, about, every

UNIT, OTHER_UNIT = b"unit-one", b"unit-two"
FRAME = LocalFrame(42.0, -83.0)
EMPTY = ((0.0,) * 4,) * 4


def vehicle(
    east_m: float, north_m: float, east_m_s: float, north_m_s: float, name: str = "host"
) -> PerceivedObject:
    state = (east_m, north_m, east_m_s, north_m_s)
    return PerceivedObject(0.0, name, ObjectSource.BSM, state, EMPTY, 0.0, frozenset())


EASTWARDS = vehicle(-48.0, 0.5, 10.0, 0.0)
NORTHWARDS = vehicle(0.5, -48.0, 0.0, 10.0)


def phases_of(signal: ApproachedSignal | None) -> tuple[SignalPhase, ...]:
    assert signal is not None
    assert signal.phases is not None
    return tuple(signal.phases)


class Listener:
    """The core, with messages of road-side units at times since `SENT_UTC_S`."""

    def __init__(self) -> None:
        self.core = Intersections()
        self.core.receive_host_vehicle(None, FRAME, 0.0)

    def hears(self, message: MapData | Spat, at_s: float = 0.0, signer: bytes = UNIT) -> list[str]:
        if isinstance(message, MapData):
            self.core.receive_map(map_data.decode(map_data.encode(message)), signer, at_s)
        else:
            received = spat.decode(spat.encode(message))
            self.core.receive_spat(received, signer, at_s, SENT_UTC_S + at_s)
        return [f"{each.component} {each.reason}" for each in every(Discarded, self.events())]

    def events(self) -> list[SignalAhead | Discarded]:
        return list(iter(self.core.next_event, None))

    def states(self, of: PerceivedObject, at_s: float = 0.0) -> list[MovementPhaseState] | None:
        self.core.receive_host_vehicle(None, FRAME, at_s)
        signal = self.core.signal_ahead(of)
        return None if signal is None or signal.phases is None else [p.state for p in signal.phases]


@pytest.fixture
def listener() -> Listener:
    one = Listener()
    assert one.hears(crossing_map()) == []
    assert one.hears(crossing_spat()) == []
    return one


def test_each_vehicle_has_the_signal_of_its_lane(listener: Listener) -> None:
    assert listener.states(EASTWARDS) == [GREEN]
    assert listener.states(NORTHWARDS) == [RED]
    signal = a(ApproachedSignal, listener.core.signal_ahead(EASTWARDS))
    assert (signal.id, signal.lane_id) == (ID, 1)
    assert signal.distance_m == pytest.approx(40.0, abs=0.1)


@pytest.mark.parametrize(
    "elsewhere",
    [
        vehicle(-48.0, 8.0, 10.0, 0.0),
        vehicle(-48.0, 0.0, -10.0, 0.0),
        vehicle(-48.0, 0.0, 0.5, 0.0),
    ],
    ids=["beside the lane", "leaving", "standing still"],
)
def test_a_vehicle_on_no_lane_has_no_signal(listener: Listener, elsewhere: PerceivedObject) -> None:
    assert listener.core.signal_ahead(elsewhere) is None


def test_the_time_left_runs_down_between_messages(listener: Listener) -> None:
    listener.core.receive_host_vehicle(None, FRAME, 0.6)
    (phase,) = phases_of(listener.core.signal_ahead(EASTWARDS))
    assert phase.min_left_s == pytest.approx(7.7 - 0.6)


def test_a_late_message_has_less_time_left() -> None:
    """Nobody can tell a delay of 0.9 s from a sender's clock that is 0.9 s behind."""
    one = Listener()
    one.hears(crossing_map())
    one.hears(crossing_spat(), at_s=0.9)
    one.core.receive_host_vehicle(None, FRAME, 1.5)
    (phase,) = phases_of(one.core.signal_ahead(EASTWARDS))
    assert phase.min_left_s == pytest.approx(7.7 - 1.5)


def test_a_message_of_a_clock_that_is_ahead_has_the_time_that_it_states() -> None:
    one = Listener()
    one.hears(crossing_map())
    one.hears(crossing_spat(time_stamp_s=13.2))
    one.core.receive_host_vehicle(None, FRAME, 0.5)
    (phase,) = phases_of(one.core.signal_ahead(EASTWARDS))
    assert phase.min_left_s == pytest.approx(20.0 - 13.2 - 0.5)


def test_between_two_lanes_all_signals_count() -> None:
    one = Listener()
    geometry = crossing_map()
    (crossing,) = intersections_of(geometry)
    beside = lane(3, [(-8.0, 3.5), (-60.0, 3.5)], signal_group=4)
    crossing = replace(crossing, lanes=(*crossing.lanes, beside))
    one.hears(replace(geometry, intersections=(crossing,)))
    one.hears(crossing_spat())
    assert one.states(vehicle(-48.0, 1.6, 10.0, 0.0)) == [GREEN, RED]
    assert one.core.red_light_m(vehicle(-48.0, 1.6, 10.0, 0.0)) is None
    assert one.states(vehicle(-48.0, 3.6, 10.0, 0.0)) == [RED]


# ---- red until the vehicle is there --------------------------------------------------------------


def test_red_until_arrival_has_the_distance(listener: Listener) -> None:
    assert listener.core.red_light_m(NORTHWARDS) == pytest.approx(40.0, abs=0.1)
    assert listener.core.red_light_m(EASTWARDS) is None, "it has green"
    assert listener.core.green_light_m(EASTWARDS) == pytest.approx(40.0, abs=0.1)
    assert listener.core.green_light_m(NORTHWARDS) is None


def test_red_is_not_on_all_ways_of_a_lane_with_one_that_has_no_signal() -> None:
    (geometry,) = intersections_of(crossing_map())
    northwards = geometry.lanes[1]
    (straight,) = ways_of(northwards)
    ways = (straight, replace(straight, signal_group=None))
    lanes = (geometry.lanes[0], replace(northwards, connects_to=ways), *geometry.lanes[2:])
    one = Listener()
    one.hears(replace(crossing_map(), intersections=(replace(geometry, lanes=lanes),)))
    one.hears(crossing_spat())
    assert one.core.red_light_m(NORTHWARDS) is None


def test_red_that_may_end_before_arrival_is_not() -> None:
    one = Listener()
    one.hears(crossing_map())
    one.hears(crossing_spat(movement(4, RED, 12.3 + 3.0)))
    assert one.core.red_light_m(NORTHWARDS) is None, "in 4 s"
    assert one.core.red_light_m(vehicle(0.0, -48.0, 0.0, 14.0)) is not None, "in 2.9 s"


def test_red_without_an_end_is_not() -> None:
    one = Listener()
    one.hears(crossing_map())
    one.hears(crossing_spat(movement(4, RED, None)))
    assert one.states(NORTHWARDS) == [RED]
    assert one.core.red_light_m(NORTHWARDS) is None


# ---- what is put out -----------------------------------------------------------------------------


def test_a_change_of_the_signals_ahead_is_put_out_once(listener: Listener) -> None:
    for at_s in (0.1, 0.2):
        listener.core.receive_host_vehicle(EASTWARDS, FRAME, at_s)
    (shown,) = listener.events()
    green = ("protected_movement_allowed",)
    assert shown == SignalAhead(0.1, 501, 1, about(40.0, 0.1), green, 7.6)
    listener.core.receive_host_vehicle(vehicle(20.0, 0.0, 10.0, 0.0), FRAME, 0.3)
    assert listener.events() == [SignalAhead(0.3, None)]


# ---- what is refused -----------------------------------------------------------------------------


def test_a_silent_unit_is_forgotten(listener: Listener) -> None:
    assert listener.states(EASTWARDS, at_s=1.1) is None
    assert listener.core.signal_ahead(EASTWARDS) is not None, "its lanes are known"
    assert listener.states(EASTWARDS, at_s=61.0) is None
    assert listener.core.signal_ahead(EASTWARDS) is None


def test_a_map_of_another_town_is_refused() -> None:
    one = Listener()
    one.core.receive_position(Position(0.0, 42.1, -83.0, None, 1.0, None, None))
    assert one.hears(crossing_map()) == ["map too_far"]
    one.core.receive_position(Position(1.0, 42.001, -83.0, None, 1.0, None, None))
    assert one.hears(crossing_map()) == []


def test_a_map_without_a_place_is_refused() -> None:
    geometry = crossing_map()
    (crossing,) = intersections_of(geometry)
    nowhere = replace(crossing, ref_point=replace(crossing.ref_point, latitude_deg=None))
    assert Listener().hears(replace(geometry, intersections=(nowhere,))) == ["map no_position"]


def test_other_lanes_need_another_revision_of_the_same_unit(listener: Listener) -> None:
    (crossing,) = intersections_of(crossing_map())
    fewer = replace(crossing, lanes=crossing.lanes[1:])
    same_revision = replace(crossing_map(), intersections=(fewer,))
    assert listener.hears(same_revision) == ["map contradictory"]
    newer = replace(crossing_map(), intersections=(replace(fewer, revision=4),))
    assert listener.hears(newer, signer=OTHER_UNIT) == ["map contradictory"]
    assert listener.hears(newer) == []
    assert listener.core.signal_ahead(EASTWARDS) is None


def test_a_unit_with_a_new_certificate_may_send_other_lanes(listener: Listener) -> None:
    (crossing,) = intersections_of(crossing_map())
    fewer = replace(crossing, lanes=crossing.lanes[1:], revision=4)
    assert listener.hears(crossing_map(), signer=OTHER_UNIT) == []
    newer = replace(crossing_map(), intersections=(fewer,))
    assert listener.hears(newer, signer=OTHER_UNIT) == []


def test_signals_of_another_revision_of_the_lanes_are_unknown(listener: Listener) -> None:
    assert listener.hears(crossing_spat(revision=4)) == []
    assert listener.states(EASTWARDS) is None


@pytest.mark.parametrize(
    ("time_stamp_s", "reason"),
    [(10.2, "spat stale"), (14.4, "spat from_the_future")],
)
def test_a_message_of_another_time_is_refused(
    listener: Listener, time_stamp_s: float, reason: str
) -> None:
    assert listener.hears(crossing_spat(time_stamp_s=time_stamp_s)) == [reason]
    assert listener.states(EASTWARDS) == [GREEN]


def test_a_repeated_message_is_accepted(listener: Listener) -> None:
    assert listener.hears(crossing_spat(), 0.05) == []


def test_a_message_that_was_overtaken_is_refused(listener: Listener) -> None:
    assert listener.hears(crossing_spat(time_stamp_s=12.2)) == ["spat older"]


def test_a_signal_that_goes_dark_is_unknown_at_once(listener: Listener) -> None:
    dark = crossing_spat(status=IntersectionStatus.OFF, time_stamp_s=12.4)
    assert listener.hears(dark, 0.1) == ["spat dark"]
    assert listener.states(EASTWARDS, at_s=0.1) is None


def test_a_phase_that_ends_in_the_past_is_refused(listener: Listener) -> None:
    past = crossing_spat(movement(2, GREEN, 2.0), time_stamp_s=12.4)
    assert listener.hears(past, 0.1) == ["spat ends_in_past"]
    assert listener.states(EASTWARDS, at_s=0.1) is None


def test_two_units_that_contradict_each_other_are_both_not_believed(listener: Listener) -> None:
    red = crossing_spat(movement(2, RED, 30.0))
    assert listener.hears(red, signer=OTHER_UNIT) == ["spat contradictory"]
    assert listener.states(EASTWARDS) is None
    later = crossing_spat(time_stamp_s=13.4)
    assert listener.hears(later, 1.1) == []
    assert listener.states(EASTWARDS, at_s=1.1) == [GREEN]


def test_two_units_that_agree_are_believed(listener: Listener) -> None:
    assert listener.hears(crossing_spat(), signer=OTHER_UNIT) == []
    assert listener.states(EASTWARDS) == [GREEN]


def test_only_the_intersections_heard_last_are_kept(
    monkeypatch: pytest.MonkeyPatch, listener: Listener
) -> None:
    monkeypatch.setattr(core, "MAX_INTERSECTIONS", 2)
    for number in (1, 2):
        listener.hears(crossing_spat(intersection=IntersectionReferenceId(None, number)))
    assert listener.core.signal_ahead(EASTWARDS) is None


BENT = lane(1, [(-8.0 - 3.0 * node, 0.0) for node in range(63)], signal_group=2)


def flood(numbers: range, *, north_m: float = 0.0) -> list[MapData]:
    """MAPs of intersections with these numbers, each of 126 nodes on lane 1."""
    geometry = crossing_map()
    (crossing,) = intersections_of(geometry)
    reference = ReferencePoint(42.0 + north_m / 111_000.0, -83.0)
    return [
        replace(
            geometry,
            intersections=(
                replace(
                    crossing,
                    id=IntersectionReferenceId(None, number),
                    ref_point=reference,
                    lanes=(BENT, replace(BENT, lane_id=2)),
                ),
            ),
        )
        for number in numbers
    ]


@pytest.fixture
def nodes_placed(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Numbers of nodes of the lanes on which a vehicle is looked for exactly."""
    placed: list[int] = []
    place = ApproachLane.place

    def counted(self: ApproachLane, position_m: Point, course: Point) -> Point | None:
        placed.append(len(self.points_m))
        return place(self, position_m, course)

    monkeypatch.setattr(ApproachLane, "place", counted)
    return placed


def test_of_one_unit_a_vehicle_is_looked_for_on_a_bounded_number_of_nodes(
    listener: Listener, nodes_placed: list[int]
) -> None:
    """A certificate of a road-side unit can fill the vehicle with lanes at one place."""
    refused = [each for message in flood(range(1, 17)) for each in listener.hears(message)]
    assert set(refused) == {"map too_many_nodes"}
    assert listener.states(EASTWARDS) == [GREEN], "of the intersection that was heard first"
    assert 0 < sum(nodes_placed) <= MAX_NODES


def test_of_one_unit_the_nearest_intersections_are_kept(listener: Listener) -> None:
    listener.core.receive_position(Position(0.0, 42.0, -83.0006, None, 1.0, None, None))
    refused = [
        each for message in flood(range(1, 17), north_m=900.0) for each in listener.hears(message)
    ]
    assert set(refused) == {"map too_many_nodes"}
    assert listener.states(EASTWARDS) == [GREEN]


def test_a_unit_that_sends_many_intersections_replaces_its_own_only(listener: Listener) -> None:
    for message in flood(range(1, core.MAX_INTERSECTIONS + 2), north_m=900.0):
        listener.hears(message, signer=OTHER_UNIT)
    assert listener.states(EASTWARDS) == [GREEN]


def test_lanes_that_are_computed_from_a_long_one_are_refused_where_they_are_too_many() -> None:
    """An octet of such a message has the vehicle compute and keep three segments."""
    (message,) = flood(range(1, 2))
    (crossing,) = intersections_of(message)
    here = Chosen("small", 0.0)
    computed = Chosen("computed", ComputedLane(1, here, here))
    lanes = (BENT, *(replace(BENT, lane_id=number, node_list=computed) for number in range(2, 60)))
    many = replace(message, intersections=(replace(crossing, lanes=lanes),))
    one = Listener()
    assert one.hears(many) == ["map too_many_nodes"]
    fewer = replace(message, intersections=(replace(crossing, lanes=lanes[:8]),))
    assert one.hears(fewer) == []


def test_far_from_all_lanes_a_vehicle_is_looked_for_on_none(
    listener: Listener, nodes_placed: list[int]
) -> None:
    assert listener.states(vehicle(-48.0, 40.0, 10.0, 0.0)) is None
    assert nodes_placed == []


@pytest.mark.parametrize("on", [(-209.5, 3.0), (-8.1, -3.0)], ids=["last", "at the line"])
def test_at_the_ends_of_a_lane_a_vehicle_has_its_signal(
    listener: Listener, on: tuple[float, float]
) -> None:
    assert listener.states(vehicle(*on, 10.0, 0.0)) == [GREEN]
