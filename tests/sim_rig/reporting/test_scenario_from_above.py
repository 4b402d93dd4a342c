"""The page of a scenario's run: true positions, and what each car perceived and warned of."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from onboard.errors import UserError
from sim_rig.reporting.scenario_from_above import animate, show_scenario
from sim_rig.run_log.run_log import Record, RunLog
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import load_scenario

START_S = 100.0


def state(at_s: float, car: str, x_m: float, y_m: float = 0.0) -> Record:
    return {
        "stamp_s": START_S + at_s,
        "kind": "car_state",
        "car": car,
        "x_m": x_m,
        "y_m": y_m,
        "heading_rad": math.pi / 2,
        "elevation_m": 0.0,
        "speed_m_s": 10.0,
        "length_m": 4.5,
        "width_m": 1.8,
    }


def alarm(at_s: float, level: str, vehicle: str = "") -> Record:
    kind = {"kind": "alarm", "cause": "lcca", "level": level, "vehicle": vehicle}
    return {"stamp_s": START_S + at_s, **kind}


def log_of(*alarms: Record) -> RunLog:
    rig = [
        state(i / 10, car, i + away) for i in range(30) for car, away in (("red", 0), ("van", 9))
    ]
    return RunLog(START_S, {"red": alarms}, rig, {})


def warned_at(log: RunLog) -> list[float]:
    return [frame.at for frame in animate(log).frames if frame.warned]


def test_cars_are_where_they_were() -> None:
    animation = animate(log_of())
    frame = animation.frames[20]
    assert frame.at == 2.0
    assert frame.cars == {"red": [20, 0, 0, 10], "van": [29, 0, 0, 10]}
    assert frame.equipped == ["red"]
    assert animation.sizes["van"] == (4.5, 1.8)


def test_a_warning_is_shown_from_its_alarm_to_the_end_of_it() -> None:
    assert warned_at(log_of(alarm(1.02, "warning"), alarm(1.55, "none"))) == [
        1.1,
        1.2,
        1.3,
        1.4,
        1.5,
    ]


def test_a_caution_is_no_warning_and_a_warning_that_becomes_one_is_over() -> None:
    log = log_of(alarm(0.5, "caution"), alarm(0.98, "warning"), alarm(1.08, "caution"))
    assert warned_at(log) == [1.0]


def test_a_warning_of_one_vehicle_does_not_end_that_of_another() -> None:
    log = log_of(alarm(1.0, "warning", "1"), alarm(1.0, "warning", "2"), alarm(1.18, "none", "1"))
    at = {frame.at: len(frame.warned) for frame in animate(log).frames}
    assert (at[1.1], at[1.2], at[2.9]) == (2, 1, 1)


def test_a_warning_of_a_car_that_is_not_on_the_road_yet_is_not_drawn() -> None:
    log = log_of()
    late = replace(
        log,
        traces={**log.traces, "blue": [alarm(1.0, "warning")]},
        rig=[*log.rig, state(2.0, "blue", 50.0)],
    )
    assert warned_at(late) == [2.0]


def test_the_present_folder_is_titled_by_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "run").mkdir()
    log_of().write(tmp_path / "run")
    monkeypatch.chdir(tmp_path / "run")
    assert show_scenario(Path(), tmp_path / "run.html").startswith("run: ")


@pytest.mark.long
def test_perceived_vehicles_and_the_one_of_the_alarm_are_found_in_the_truth(tmp_path: Path) -> None:
    log = run_virtual(load_scenario("shared-detection"))
    log.write(tmp_path / "run")
    animation = animate(log)
    perceived = {
        (car, other, source)
        for frame in animation.frames
        for car, objects in frame.perceived.items()
        for other, source in objects
    }
    assert ("v1", "v3", "shared") in perceived
    assert {(car, other) for frame in animation.frames for car, _, _, other, _ in frame.warned} == {
        ("v1", "v3")
    }
    assert any(frame.sent for frame in animation.frames)
    summary = show_scenario(tmp_path / "run", tmp_path / "run.html")
    assert summary == "run: 10 s. Warned: v1."
    assert '"title":"run"' in (tmp_path / "run.html").read_text("utf-8")


@pytest.mark.parametrize(
    ("rig", "why"),
    [
        (None, r"holds no run of a scenario: .*rig\.jsonl: No such file"),
        ("{\n", "a trace is broken"),
        ('{"stamp_s":0,"kind":"on_air"}\n', "has no positions of cars"),
        ('{"stamp_s":0,"kind":"car_state"}\n', "no run of this version: a record has no 'car'"),
        ('{"stamp_s":0}\n', "no run of this version: a record has no 'kind'"),
        ("[]\n", "a trace is broken: a line is no JSON object"),
        ("\x00\xff\n", "a trace is broken"),
    ],
)
def test_a_folder_without_a_run_is_refused(tmp_path: Path, rig: str | None, why: str) -> None:
    if rig is not None:
        (tmp_path / "rig.jsonl").write_text(rig, encoding="latin-1")
    with pytest.raises(UserError, match=why):
        show_scenario(tmp_path, tmp_path / "run.html")
