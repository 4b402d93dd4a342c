"""A stack with access adaptation: among many vehicles, an unsafe one sends more BSMs."""

import numpy as np
import pytest

from onboard.access.driver_model import DEFAULT_POPULATION, DriverModel
from onboard.observations import Lead, LeadIdentity, Sensor, Speed
from onboard.risk.alarm import Alarm, Level
from onboard.settings import parse_settings
from onboard.step import Input, ReceivedWsm
from onboard.trace.trace_line import as_record
from onboard.vehicle.config import CarConfig
from onboard.vehicle.stack import Stack


def stack_of(plate: str, seed: int, enabled: bool, driver: DriverModel | None = None) -> Stack:
    tree = {
        "car": {"plate": plate},
        "access": {"enabled": enabled},
        "security": {"plate_digest": {"scrypt_log2_n": 1}},
    }
    config = parse_settings(tree, CarConfig, plate)
    rng = np.random.default_rng(seed)
    sensors = Sensor.SPEED, Sensor.CAMERA
    return Stack(config, sensors, rng, now=0.0, utc_s=1_700_000_100.0, driver=driver)


def bsms_among_many(gap_m: float, enabled: bool) -> tuple[int, list[dict[str, object]]]:
    """Return the number of BSMs from 15 s to 20 s among 75 vehicles, and the safety events."""
    stack = stack_of("AAA1", 1, enabled)
    others = [stack_of(f"BBB{k}", 10 + k, enabled=False) for k in range(75)]
    frames = []
    for other in others:
        sent = [wsm.data for tenth in range(4) for wsm in other.step((), 0.05 * tenth).wsms]
        frames += sent[:1]
    count, events = 0, []
    for step in range(2000):
        now = 0.01 * step
        inputs: list[Input] = []
        if step % 10 == 0:
            lead = Lead(now, LeadIdentity.UNKNOWN, None, gap_m, 0.3, 0.0, 0.2)
            inputs += [Speed(now, 20.0, 0.28, "obd:7E8"), lead]
        if step % 30 == 0:  # as often as the rate control lets 76 vehicles send
            inputs += [ReceivedWsm(now, wsm) for wsm in frames]
        outputs = stack.step(inputs, now)
        count += len(outputs.wsms) if now >= 15.0 else 0
        for event in outputs.events:
            events += [as_record(event)] if event.kind == "following_safety" else []
    return count, events


@pytest.mark.long
@pytest.mark.parametrize(
    ("gap_m", "enabled", "expected"),
    [(8.0, True, 50), (60.0, True, 17), (8.0, False, 17)],
)
def test_bsms_of_one_among_76_vehicles(gap_m: float, enabled: bool, expected: int) -> None:
    count, events = bsms_among_many(gap_m, enabled)

    assert count == pytest.approx(expected, abs=2)
    assert [line["is_unsafe"] for line in events] == ([True] if expected == 50 else [])


@pytest.mark.parametrize(("reaction_s", "earlier_s"), [(0.6, 0.0), (1.25, 0.2)])
def test_a_driver_who_has_reacted_late_is_warned_earlier(
    reaction_s: float, earlier_s: float
) -> None:
    """Of a standing vehicle at 20 m/s; the model is that of an earlier drive."""
    driver = DriverModel(DEFAULT_POPULATION)
    for _ in range(40):
        driver.receive_reaction(reaction_s, 1.2)

    usual_s, known_s = (
        warned_of_a_standing_vehicle_s(DriverModel(DEFAULT_POPULATION, memory=memory))
        for memory in (None, driver.memory())
    )
    assert usual_s - known_s == pytest.approx(earlier_s, abs=0.051)


def warned_of_a_standing_vehicle_s(driver: DriverModel) -> float:
    stack = stack_of("AAA1", 1, True, driver)
    for step in range(100):
        now = 0.05 * step
        lead = Lead(now, LeadIdentity.UNKNOWN, None, 100.0 - 20.0 * now, 0.3, 20.0, 0.2)
        for event in stack.step([Speed(now, 20.0, 0.28, "obd:7E8"), lead], now).events:
            if isinstance(event, Alarm) and event.level is Level.WARNING:
                return now
    raise AssertionError
