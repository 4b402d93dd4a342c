"""Expected alarms and perceived objects, on a synthetic log of two cars that collide."""

import math
from typing import Any

import pytest
from pydantic import TypeAdapter

from sim_rig.run_log.ground_truth import overlap, touch_s
from sim_rig.run_log.run_log import Record, RunLog
from sim_rig.scenario.expectations import Expectation

ADAPTER: TypeAdapter[Any] = TypeAdapter(Expectation)


def true_state(at_s: float, car: str) -> dict[str, object]:
    """ann drives north and ben east, both through the origin at 8 s; eva stands far away."""
    way_m = 10.0 * (at_s - 8.0)
    x_m, y_m, heading, speed = {
        "ann": (0.0, way_m, 0.0, 10.0),
        "ben": (way_m, 0.0, math.pi / 2, 10.0),
        "eva": (100.0, 100.0, 0.0, 0.0),
    }[car]
    return {
        "stamp_s": 1000.0 + at_s, "kind": "car_state", "car": car, "x_m": x_m, "y_m": y_m,
        "heading_rad": heading, "elevation_m": 0.0, "speed_m_s": speed, "length_m": 4.5,
        "width_m": 1.8,
    }  # fmt: skip


def perceived(at_s: float, name: str, source: str, x_m: float, y_m: float) -> dict[str, object]:
    """Return a record in ann's local frame, whose origin is elsewhere."""
    state = [x_m + 500.0, y_m - 70.0, 0.0, 0.0]
    return {
        "stamp_s": 1000.0 + at_s, "kind": "perceived_object", "name": name, "source": source,
        "state": state,
    }  # fmt: skip


def alarm(at_s: float, level: str, what: str, name: str) -> dict[str, object]:
    return {
        "stamp_s": 1000.0 + at_s, "kind": "alarm", "cause": "ima", "level": level,
        "reasons": [{"what": what, "name": name, "age_s": 0.1}],
    }  # fmt: skip


def log(*more: Record) -> RunLog:
    trace: list[Record] = []
    for at_s in range(2, 8):
        way_m = 10.0 * (at_s - 8.0)
        trace.append(perceived(at_s, "aa", "host", 0.0, way_m))
        trace.append(perceived(at_s, "7", "shared", way_m + 1.0, 0.5))
    rig = [true_state(k / 10, car) for k in range(100) for car in ("ann", "ben", "eva")]
    return RunLog(1000.0, {"ann": [*trace, *more], "ben": []}, rig, {})


ALARM = {"what": "alarm", "car": "ann", "cause": "ima", "from_s": 3, "by_s": 8}
WARNED = alarm(6.0, "warning", "perceived_object:shared", "7")


@pytest.mark.parametrize(
    ("more", "entry", "complaint"),
    [
        (WARNED, ALARM | {"of": "ben", "source": "shared"}, None),
        (WARNED, ALARM | {"of": "ben", "least_lead_s": 1.5}, None),
        (WARNED, ALARM | {"of": "ben", "least_lead_s": 1.9}, "1.70 s before they touch, not 1.9 s"),
        (WARNED, ALARM | {"of": "eva"}, "ann is warned of perceived_object:shared, not of eva"),
        (WARNED, ALARM | {"of": "ben", "source": "bsm"}, "not of ben"),
        (WARNED, ALARM | {"by_s": 5}, "ann raises no warning (ima) until 5 s"),
        (WARNED, ALARM | {"cause": "fcw"}, "ann raises no warning (fcw) until 8 s"),
        (alarm(6, "caution", "perceived_object:shared", "7"), ALARM, "ann raises no warning"),
        (alarm(6, "caution", "perceived_object:shared", "7"), ALARM | {"level": "caution"}, None),
        (WARNED, {"what": "no_alarm", "cars": ["ann"], "until_s": 5.9}, None),
        (
            WARNED,
            {"what": "no_alarm", "cars": ["ann"], "until_s": 8},
            "at 6.00 s ann raises a warning of ima, and must not",
        ),
        (WARNED, {"what": "no_alarm", "cars": ["ann"], "causes": ["lcca"], "until_s": 8}, None),
        (
            alarm(6.0, "caution", "perceived_object:shared", "7"),
            {"what": "no_alarm", "cars": ["ann"], "from_level": "warning", "until_s": 8},
            None,
        ),
        (
            alarm(6.0, "none", "perceived_object:shared", "7"),
            {"what": "no_alarm", "cars": ["ann"], "until_s": 8},
            None,
        ),
    ],
)
def test_alarms(more: Record, entry: dict[str, object], complaint: str | None) -> None:
    assert_complains(log(more), entry, complaint)


def request(at_s: float, deceleration_m_s2: float) -> dict[str, object]:
    return {
        "stamp_s": 1000.0 + at_s, "kind": "brake_request", "deceleration_m_s2": deceleration_m_s2,
    }  # fmt: skip


REQUEST = {"what": "brake_request", "car": "ann", "from_s": 5, "by_s": 7, "at_least_m_s2": 4.0}


@pytest.mark.parametrize(
    ("more", "entry", "complaint"),
    [
        ((request(5.5, 3.0), request(6.0, 4.5)), REQUEST, None),
        ((request(5.5, 3.0),), REQUEST, "ann requests at most 3.0 m/s^2 by 7 s, not 4"),
        ((), REQUEST, "ann requests at most 0.0 m/s^2 by 7 s"),
        ((request(4.0, 1.0), request(6.0, 5.0)), REQUEST, "ann requests braking at 4.00 s"),
        ((), {"what": "no_contact", "car": "ann", "of": "ben"}, "ann and ben touch at 7.7 s"),
        ((), {"what": "no_contact", "car": "ann", "of": "eva"}, None),
    ],
)
def test_requested_braking(
    more: tuple[Record, ...], entry: dict[str, object], complaint: str | None
) -> None:
    assert_complains(log(*more), entry, complaint)


PERCEIVES = {"what": "perceives", "car": "ann", "of": "ben", "from_s": 2, "until_s": 7}
NOT = {"what": "does_not_perceive", "car": "ann", "of": "ben", "from_s": 2, "until_s": 7}


@pytest.mark.parametrize(
    ("more", "entry", "complaint"),
    [
        ((), PERCEIVES, None),
        ((), PERCEIVES | {"sources": ["shared"]}, None),
        ((), PERCEIVES | {"sources": ["bsm"]}, "at 2.00 s ann perceives ben by shared"),
        (
            (),
            PERCEIVES | {"within_m": 1.0},
            "at 2.00 s ann perceives ben 1.1 m off",
        ),
        ((), PERCEIVES | {"of": "eva"}, "ann does not always perceive eva"),
        ((), PERCEIVES | {"from_s": 8, "until_s": 9}, "ann traces no objects from 8 s to 9 s"),
        (
            (perceived(4, "8", "sensor", -41.0, 0.0),),
            PERCEIVES,
            "ann has 2 objects for ben",
        ),
        ((), NOT, "at 2.00 s ann perceives ben by shared"),
        ((), NOT | {"of": "eva"}, None),
        ((), NOT | {"of": "ann"}, None),
        (
            (perceived(4, "9", "shared", 1.0, -41.0),),
            NOT | {"of": "ann"},
            "ann perceives ann by",
        ),
        ((perceived(4, "9", "shared", 1.0, -54.0),), NOT | {"of": "ann"}, None),
    ],
)
def test_perceived_objects(
    more: tuple[Record, ...], entry: dict[str, object], complaint: str | None
) -> None:
    assert_complains(log(*more), entry, complaint)


def assert_complains(of: RunLog, entry: dict[str, object], complaint: str | None) -> None:
    found = list(ADAPTER.validate_python(entry, strict=False).check(of))
    if complaint is None:
        assert found == []
    else:
        assert complaint in found[0]


def test_cars_touch_when_their_rectangles_overlap() -> None:
    # Front of ann to side of ben: 3.15 m and 0.315 s before both reach the origin.
    assert touch_s(log(), "ann", "ben") == pytest.approx(7.7)
    assert touch_s(log(), "ann", "eva") is None


@pytest.mark.parametrize(
    ("x_m", "y_m", "heading_deg", "elevation_m", "touches"),
    [
        (1.7, 0.0, 0.0, 0.0, True),
        (1.9, 0.0, 0.0, 0.0, False),
        (0.0, 4.4, 0.0, 0.0, True),
        (0.0, 4.6, 0.0, 0.0, False),
        (2.6, 2.6, 45.0, 0.0, True),
        (2.9, 2.9, -45.0, 0.0, False),
        (0.0, 0.0, 90.0, 6.5, False),
    ],
)
def test_overlap(
    x_m: float, y_m: float, heading_deg: float, elevation_m: float, touches: bool
) -> None:
    one = true_state(8.0, "ann")
    other = one | {
        "x_m": x_m, "y_m": y_m, "heading_rad": math.radians(heading_deg),
        "elevation_m": elevation_m,
    }  # fmt: skip

    assert overlap(one, other) == touches


def signal_ahead(at_s: float, *states: str) -> dict[str, object]:
    return {"stamp_s": 1000.0 + at_s, "kind": "signal_ahead", "states": list(states)}


@pytest.mark.parametrize(
    ("signals", "deviation"),
    [
        ((signal_ahead(-1.0, "stop_and_remain"),), None),
        ((signal_ahead(-1.0), signal_ahead(2.0, "stop_and_remain")), None),
        ((signal_ahead(1.0, "stop_and_remain"), signal_ahead(2.0)), "but [[]]"),
        ((signal_ahead(4.0, "stop_and_remain"),), "but []"),
    ],
)
def test_the_signal_that_counts_is_the_one_at_the_time(
    signals: tuple[Record, ...], deviation: str | None
) -> None:
    """It may be known before the scenario begins."""
    tree = {"what": "signal_ahead", "car": "ann", "state": "stop_and_remain", "at_s": 3.0}
    found = list(ADAPTER.validate_python(tree).check(log(*signals)))

    assert found == (
        [] if deviation is None else [f"ann knows no signal of stop_and_remain at 3 s, {deviation}"]
    )
