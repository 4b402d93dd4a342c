"""The delay of a car's pictures is found from the gaps that it measured."""

import numpy as np
import pytest

from sim_rig.run_log.picture_delay import picture_delay
from sim_rig.run_log.run_log import Record, RunLog
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import load_scenario

PLATES = {"GN417KB": "green"}
LENGTH_M, START_S, DURATION_S = 4.5, 100.0, 20.0


def place_m(car: str, at_s: float, swing_m: float) -> float:
    """Green is 15 m ahead, and comes and goes by `swing_m`."""
    ahead_m = 15.0 + LENGTH_M + swing_m * np.sin(at_s / 2.0) if car == "green" else 0.0
    return 14.0 * at_s + ahead_m


def drive(
    delay_s: float, *, scale: float = 1.0, swing_m: float = 5.0, seconds: float = 20.0
) -> RunLog:
    rng = np.random.default_rng(1)
    states: list[Record] = [
        {"stamp_s": START_S + at_s, "kind": "car_state", "car": car, "length_m": LENGTH_M,
         "x_m": place_m(car, at_s, swing_m), "y_m": 0.0}
        for at_s in np.arange(0.0, DURATION_S, 0.1).tolist()
        for car in ("green", "red")
    ]  # fmt: skip
    leads: list[Record] = []
    for at_s in np.arange(2.0, DURATION_S, 0.1).tolist():
        exposed_s = at_s - delay_s
        gap_m = place_m("green", exposed_s, swing_m) - place_m("red", exposed_s, swing_m) - LENGTH_M
        measured_m = gap_m * (scale + 0.01 * rng.normal())
        leads.append(
            {"stamp_s": START_S + at_s, "kind": "lead", "text": "GN417KB", "gap_m": measured_m}
        )
    return RunLog(START_S, {"red": leads, "green": []}, states, {})


@pytest.mark.parametrize("scale", [0.95, 1.0, 1.05])
@pytest.mark.parametrize("delay_s", [-0.05, 0.0, 0.12, 0.8])
def test_the_delay_is_found_whatever_the_scale_of_the_lens(delay_s: float, scale: float) -> None:
    found = picture_delay(drive(delay_s, scale=scale), "red", PLATES)

    assert found is not None
    assert found.delay_s == pytest.approx(delay_s, abs=found.uncertainty_s)
    assert found.pictures == 180


def test_a_constant_gap_says_nothing() -> None:
    assert picture_delay(drive(0.1, swing_m=0.0), "red", PLATES) is None


def test_a_car_that_sees_no_plate_has_no_delay() -> None:
    log = drive(0.1)

    assert picture_delay(log, "green", PLATES) is None
    assert picture_delay(log, "red", {}) is None


@pytest.mark.long
def test_in_virtual_time_pictures_have_no_delay() -> None:
    scenario = load_scenario("fig4")
    plates = {str(car.plate): name for name, car in scenario.cars.items()}
    found = picture_delay(run_virtual(scenario), "red", plates)

    assert found is not None
    assert found.delay_s == pytest.approx(0.0, abs=0.03)
