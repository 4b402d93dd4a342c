"""Each expectation accepts a matching log, and describes each deviation."""

import json
from typing import Any

import pytest
from pydantic import TypeAdapter

from sim_rig.run_log.run_log import RunLog
from sim_rig.scenario.expectations import Expectation

ADAPTER: TypeAdapter[Any] = TypeAdapter(Expectation)
GREEN, RED = "aa", "bb"


def record(at_s: float, kind: str, **fields: object) -> dict[str, object]:
    return {"stamp_s": 1000.0 + at_s, "kind": kind, **fields}


def transition(at_s: float, state: str, number: int, leader: str) -> dict[str, object]:
    return record(at_s, "transition", state=state, group_number=number, leader_id=leader)


LOG = RunLog(
    start_s=1000.0,
    traces={
        "green": [
            transition(2.0, "leader", 1, GREEN),
            record(5.2, "sent", message="warn"),
            record(8.0, "sensor_lost", sensor="speed"),
        ],
        "red": [
            transition(2.1, "member", 2, GREEN),
            record(5.3, "warning", origin_id=GREEN),
            transition(9.0, "regular", 1, RED),
        ],
        "yellow": [record(5.3, "discarded", component="lcca", reason="not_in_group")],
    },
    rig=[
        record(at_s, "delivered", car="red", sender="green", user_priority=5)
        for at_s in (3.0, 3.1, 3.2)
    ],
    names={GREEN: "green", RED: "red"},
)

STATE = {"what": "state", "car": "red", "by_s": 3, "state": "member"}
DELIVERED = {"what": "delivered", "sender": "green", "car": "red", "from_s": 0, "until_s": 9}
WARNING = {"what": "warning", "braking": "green", "at_s": [5]}


@pytest.mark.parametrize(
    ("entry", "complaint"),
    [
        (STATE | {"group_number": 2, "leader": "green", "until_s": 8}, None),
        (STATE | {"by_s": 1}, "red is still regular at 1 s, not member"),
        (STATE | {"by_s": 1, "state": "regular"}, None),
        (STATE | {"state": "leader"}, "at 3.00 s red is member, not leader"),
        (STATE | {"group_number": 3}, "at 3.00 s red is member with number 2, not 3"),
        (STATE | {"leader": "red"}, "at 3.00 s red is member led by green, not red"),
        (STATE | {"until_s": 10}, "at 9.00 s red is regular, not member"),
        (STATE | {"car": "yellow", "state": "regular", "until_s": 10}, None),
        (WARNING | {"within_s": {"red": 0.5}, "not_warned": ["yellow"]}, None),
        (
            WARNING | {"within_s": {"red": 0.2}},
            "red is warned of green braking at 5 s after 0.300 s, not 0.2 s",
        ),
        (WARNING | {"within_s": {"yellow": 1}}, "yellow is not warned of green braking at 5 s"),
        (
            WARNING | {"not_warned": ["red"]},
            "red is warned of green braking at 5 s, and must not",
        ),
        (WARNING | {"braking": "red", "not_warned": ["red"]}, None),
        (WARNING | {"at_s": [1], "not_warned": ["red"]}, None),
        (WARNING | {"discarded": {"yellow": "not_in_group"}}, None),
        (
            WARNING | {"discarded": {"yellow": "stale"}},
            "yellow discards nothing as stale upon green braking at 5 s",
        ),
        (DELIVERED | {"at_least": 3, "at_most": 3, "user_priority": 5}, None),
        (DELIVERED | {"user_priority": 4, "at_most": 0}, None),
        (DELIVERED | {"at_least": 4}, "red receives 3 frames of green, at least 4"),
        (DELIVERED | {"at_most": 2}, "red receives 3 frames of green, at most 2"),
        (DELIVERED | {"until_s": 3.15, "at_most": 2}, None),
        (
            DELIVERED | {"sender": "yellow", "at_least": 1},
            "red receives 0 frames of yellow, at least 1",
        ),
        ({"what": "no_warning", "cars": ["green", "red"], "from_s": 0, "until_s": 5}, None),
        (
            {"what": "no_warning", "cars": ["red"], "from_s": 0, "until_s": 6},
            "at 5.30 s red raises a warning, and must not",
        ),
        (
            {
                "what": "sensor_lost",
                "car": "green",
                "sensor": "speed",
                "from_s": 7.5,
                "within_s": 1,
            },
            None,
        ),
        (
            {"what": "sensor_lost", "car": "green", "sensor": "speed", "from_s": 6, "within_s": 1},
            "green reports sensor_lost of its speed 2.00 s after 6 s, later than 1 s",
        ),
        (
            {
                "what": "sensor_recovered",
                "car": "green",
                "sensor": "speed",
                "from_s": 8,
                "within_s": 1,
            },
            "green never reports sensor_recovered of its speed",
        ),
        (
            {
                "what": "sent",
                "message": "warn",
                "cars": ["green", "red"],
                "from_s": 0,
                "until_s": 9,
                "at_least": 1,
                "at_most": 1,
            },
            None,
        ),
        (
            {"what": "sent", "message": "warn", "cars": ["green"], "from_s": 0, "until_s": 9}
            | {"at_most": 0},
            "sent warn: 1 times by green, at most 0",
        ),
        (
            {"what": "discarded", "reason": "stale", "cars": ["yellow"], "from_s": 0, "until_s": 9}
            | {"at_least": 1},
            "discarded stale: 0 times by yellow, at least 1",
        ),
    ],
)
def test_a_deviation_is_described(entry: dict[str, object], complaint: str | None) -> None:
    found = list(ADAPTER.validate_json(json.dumps(entry)).check(LOG))

    assert found == ([] if complaint is None else [complaint])
