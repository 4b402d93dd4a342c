"""Cars of a live run that the rig steps itself."""

import asyncio
import time

import numpy as np
import pytest

from sim_rig.boxes.trial_keys import run_credentials
from sim_rig.radio.iwcu import RadioUnits
from sim_rig.radio.reach import ReachAir
from sim_rig.roads.breakpoints import BreakpointRoad
from sim_rig.run_log.lateness import Lateness
from sim_rig.run_log.rig_recorder import RigRecorder
from sim_rig.runs.virtual_others import VirtualOthers
from sim_rig.scenario.radio_settings import ReachSettings
from sim_rig.scenario.schema import Scenario, load_scenario
from tests.typed import a


@pytest.fixture
def scenario() -> Scenario:
    """Of `fig4`, green alone beside the box `red`, who hear each other."""
    whole = load_scenario("fig4")
    cars = {name: whole.cars[name] for name in ("green", "red")}
    radio = whole.radio.model_copy(
        update={"reach_m": None, "neighbours": {"green": ("red",), "red": ("green",)}}
    )
    return whole.model_copy(update={"cars": cars, "radio": radio, "expect": ()})


def test_a_car_drives_by_its_timers_also_while_frames_arrive_without_a_pause(
    scenario: Scenario,
) -> None:
    recorder, lateness, sent = RigRecorder(), Lateness(), list[bytes]()

    async def drive() -> VirtualOthers:
        radio = a(ReachSettings, scenario.radio)
        air = ReachAir(radio, lambda _now: {}, scenario.equipped, np.random.default_rng(0))
        units = RadioUnits(air, recorder)
        units.add_in_process("red", sent.append)
        others = VirtualOthers(scenario, BreakpointRoad(scenario), ["green"], units)
        now, utc_s = time.monotonic(), time.time()
        others.begin(
            now,
            utc_s,
            seed=1,
            credentials=run_credentials(scenario, {}, utc_s),
            recorder=recorder,
            lateness=lateness,
            brake=lambda *_: None,
        )
        async with asyncio.timeout(10.0):
            while not (sent and recorder.answers["green"]):
                units.transmit("red", b"no WSM", 0)
                await asyncio.sleep(0.0)
        others.close()
        units.close()
        return others

    begun_s = time.monotonic()
    trace = asyncio.run(drive()).trace("green")
    assert [line.what for line in lateness.lines()] == ["other car"]
    assert "speed" in {record["kind"] for record in trace}
    assert all(begun_s <= record["stamp_s"] <= time.monotonic() for record in trace)
