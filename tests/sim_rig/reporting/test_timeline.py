"""The figure of a run: it is written, and its bars are the states of each car."""

from pathlib import Path

import cv2

from sim_rig.reporting.timeline import StateInterval, draw_timeline, state_intervals
from sim_rig.run_log.run_log import RunLog
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import load_scenario


def test_a_figure_is_written(tmp_path: Path) -> None:
    scenario = load_scenario("stopped-ecu").model_copy(update={"duration_s": 5.0})
    path = tmp_path / "deep" / "timeline.png"

    draw_timeline(scenario, run_virtual(scenario), path)

    image = cv2.imread(str(path))
    assert image is not None
    assert image.shape[1] == 1100


def test_a_bar_lasts_while_state_and_number_stay() -> None:
    def transition(stamp_s: float, state: str, number: int) -> dict[str, object]:
        return {
            "stamp_s": stamp_s,
            "kind": "transition",
            "state": state,
            "group_number": number,
            "leader_id": "aa",
        }

    trace = [
        transition(99.0, "member", 2),
        transition(102.0, "member", 3),
        transition(103.0, "member", 3),
        transition(105.0, "regular", 1),
        transition(111.0, "leader", 1),
    ]

    assert list(state_intervals(RunLog(100.0, {"red": trace}, [], {}), "red", 10.0)) == [
        StateInterval(0.0, 2.0, "member", 2),
        StateInterval(2.0, 5.0, "member", 3),
        StateInterval(5.0, 10.0, "regular", 1),
    ]
