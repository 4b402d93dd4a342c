"""Who comes up to a standing queue without positions is warned by the camera alone."""

import pytest

from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import load_scenario
from sim_rig.scenario.sensor_settings import LensSettings
from sim_rig.studies.lcca.platoon_sight import RECOMMENDED_LENS

LENGTH_M = 4.5


@pytest.mark.long
@pytest.mark.parametrize(("lens", "before_s"), [(RECOMMENDED_LENS, 2.8), (LensSettings(), 2.3)])
def test_fcw_comes_as_soon_as_the_lens_shows_the_queue(lens: LensSettings, before_s: float) -> None:
    """Aim: 3 s. BSMs without positions do not tell the queue from one in a side road."""
    scenario = load_scenario("standing-queue").model_copy(update={"gnss": None, "lens": lens})
    gap_m = scenario.cars["last"].start_m - scenario.cars["ann"].start_m - LENGTH_M

    log = run_virtual(scenario.model_copy(update={"duration_s": 11.5}))

    (first, *_) = log.of("ann", "alarm", cause="fcw")
    assert gap_m / 30.0 - log.at_s(first) >= before_s
    assert not any(list(log.of(car, "alarm")) for car in ("first", "second", "last"))
