"""A car leaves its group within a second when another car takes the place of the one ahead."""

from typing import Any

import pytest

from onboard.settings import parse_settings
from sim_rig.cars.camera_model import ENTER, LEAVE
from sim_rig.run_log.run_log import RunLog
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import Scenario, load_scenario

CUT_IN_SEEDS, LANE_CHANGE_SEEDS = range(1, 11), (1, 2, 3)
CHANGE_S, LASTS_S = 10.0, 2.5
"""Begin and duration of the change of lanes."""
IN_LANE_S, OUT_OF_LANE_S = (CHANGE_S + share * LASTS_S for share in (1.0 - ENTER, LEAVE))
"""When a car that cuts in is in the host's lane, and when one that leaves it is out of it."""


def cut_in() -> Scenario:
    """A car without a radio cuts in between red and green."""
    return parse_settings(
        {
            "title": "A car without a radio cuts in.",
            "seed": 1,
            "duration_s": 16.0,
            "radio": {"reach_m": 300},
            "lens": {"width_px": 1280, "focal_px": 3300.0},
            "cars": {
                "green": {"plate": "GN417KB", "lane": 1, "start_m": 100.0, "speed_m_s": 15.0},
                "red": {"plate": "RD288HX", "lane": 1, "start_m": 72.0, "speed_m_s": 15.0},
                "grey": {
                    "plate": "GY551PL",
                    "equipped": False,
                    "lane": [[CHANGE_S, 2.0], [CHANGE_S + LASTS_S, 1.0]],
                    "start_m": 88.5,
                    "speed_m_s": 15.0,
                },
            },
            "expect": [],
        },
        Scenario,
        "cut-in",
    )


def changed_s(log: RunLog, car: str, **fields: Any) -> float:
    """Time of the first transition after the exchange has begun."""
    return log.at_s(next(iter(log.of(car, "transition", from_s=CHANGE_S, **fields))))


def noticed_s(log: RunLog, car: str) -> float:
    """Time of the first image after the exchange has begun in which another car is the lead."""
    leads = list(log.of(car, "lead", from_s=CHANGE_S))
    return next(log.at_s(lead) for lead in leads if lead["track_id"] != leads[0]["track_id"])


@pytest.mark.long
@pytest.mark.parametrize("seed", CUT_IN_SEEDS)
def test_behind_a_car_that_cuts_in_the_group_is_left(seed: int) -> None:
    log = run_virtual(cut_in(), seed)

    before = list(log.of("red", "transition", until_s=CHANGE_S))[-1]
    assert before["state"] == "member"
    assert noticed_s(log, "red") < IN_LANE_S + 0.5
    assert changed_s(log, "red", state="regular") < noticed_s(log, "red") + 1.0


@pytest.mark.long
@pytest.mark.parametrize("seed", LANE_CHANGE_SEEDS)
def test_when_the_lead_leaves_the_lane_the_one_beyond_is_followed(seed: int) -> None:
    scenario = load_scenario("lane-change").model_copy(update={"duration_s": 16.0})
    log = run_virtual(scenario, seed)

    before = list(log.of("blue", "transition", until_s=CHANGE_S))[-1]
    assert (before["state"], before["group_number"]) == ("member", 3)
    assert noticed_s(log, "blue") < OUT_OF_LANE_S + 0.5
    assert changed_s(log, "blue", state="member", group_number=2) < noticed_s(log, "blue") + 1.0
