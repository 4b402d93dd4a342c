"""The picture of a run: it comes out, and its bands are the places that each car had."""

from pathlib import Path

import cv2

from sim_rig.reporting.timeline import Stay, draw_timeline, stays
from sim_rig.run_log.run_log import RunLog
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import load_scenario


def test_a_run_becomes_a_picture(tmp_path: Path) -> None:
    scenario = load_scenario("stopped-ecu").model_copy(update={"duration_s": 5.0})
    path = tmp_path / "deep" / "timeline.png"

    draw_timeline(scenario, run_virtual(scenario), path)

    image = cv2.imread(str(path))
    assert image is not None
    assert image.shape[1] == 1100


def test_a_band_is_as_long_as_the_car_kept_its_place() -> None:
    def place(stamp_s: float, state: str, number: int) -> dict[str, object]:
        return {
            "stamp_s": stamp_s,
            "kind": "transition",
            "state": state,
            "group_number": number,
            "leader_id": "aa",
        }

    trace = [
        place(99.0, "member", 2),
        place(102.0, "member", 3),
        place(103.0, "member", 3),
        place(105.0, "regular", 1),
        place(111.0, "leader", 1),
    ]

    assert list(stays(RunLog(100.0, {"red": trace}, [], {}), "red", 10.0)) == [
        Stay(0.0, 2.0, "member", 2),
        Stay(2.0, 5.0, "member", 3),
        Stay(5.0, 10.0, "regular", 1),
    ]
