"""A scenario chooses how many pictures a second its cameras take, virtually and live."""

import math

import numpy as np
import pytest

from onboard.settings import parse_settings
from onboard.vision.settings import VisionSettings
from sim_rig.cars.camera_model import CameraModel
from sim_rig.cars.camera_view import CameraView
from sim_rig.cars.plate_readings import CORRELATION_S, PlateReadings
from sim_rig.roads.breakpoints import BreakpointRoad
from sim_rig.scenario.schema import Scenario


def scenario(lens: dict[str, float]) -> Scenario:
    cars = {
        "ann": {"plate": "AN123KB", "start_m": 20, "speed_m_s": 15},
        "ben": {"plate": "BN456HX", "start_m": 0, "speed_m_s": 15},
    }
    settings = {"title": "Ben follows Ann.", "seed": 1, "duration_s": 10, "lens": lens}
    parts = {"radio": {"reach_m": 100}, "cars": cars, "expect": []}
    return parse_settings({**settings, **parts}, Scenario, "rate")


@pytest.mark.parametrize(("lens", "pictures"), [({}, 20), ({"rate_hz": 5.0}, 10)])
def test_a_camera_takes_as_many_pictures_as_the_scenario_says(
    lens: dict[str, float], pictures: int
) -> None:
    chosen = scenario(lens)
    rng = np.random.default_rng(1)
    view = CameraView(chosen, BreakpointRoad(chosen), "ben", rng)
    model = CameraModel(view, VisionSettings(), 0.0, rng, rate_hz=chosen.lens.rate_hz)
    begin_s, taken = model.get_timer(), 0
    while (at := model.get_timer()) < begin_s + 2.0 - 1e-6:
        model.handle_timer(at)
        taken += 1
    assert taken == pictures


@pytest.mark.parametrize("rate_hz", [5.0, 10.0, 20.0])
def test_readings_are_as_alike_after_half_a_second_at_any_rate(rate_hz: float) -> None:
    """What is drawn anew at each picture adds up to the same in the same time."""
    rng = np.random.default_rng(3)
    alike = []
    for _ in range(20):
        readings = PlateReadings(rng, rate_hz)
        before = readings._passing
        for _ in range(round(CORRELATION_S * rate_hz)):
            readings.advance()
        alike.append(np.corrcoef(before.ravel(), readings._passing.ravel())[0, 1])
    # The mean of a coefficient's estimate is off by its sampling error, about 1 in 100 here.
    expected = math.exp(-round(CORRELATION_S * rate_hz) / rate_hz / CORRELATION_S)
    assert np.mean(alike) == pytest.approx(expected, abs=0.04)
