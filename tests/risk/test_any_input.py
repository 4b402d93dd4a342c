"""Properties that alarms have for any input in any order."""

import math
from collections import defaultdict
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.lcca.events import WarningOver
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData, VehicleSize
from onboard.messages.bsm_safety import VehicleEventFlags, VehicleSafetyExtensions
from onboard.observations import BrakePedal, Lead, LeadIdentity, Position, Speed
from onboard.risk.alarm import Alarm, Cause, Level
from onboard.risk.monitor import RiskMonitor
from onboard.risk.settings import RiskSettings
from onboard.tracking.perceived_object import ObjectSource, PerceivedObject
from tests.risk.lcca_warnings import lcca_warning

STEP_S = 0.1
IDS = (b"\x00\x00\x00\x01", b"\x00\x00\x00\x02", b"\x00\x00\x00\x03")

late_s = st.sampled_from([0.0, 0.0, 0.0, 0.0, -0.7, -2.0, 60.0])
maybe = st.none() | st.floats(-5.0, 5.0)
places = st.tuples(st.floats(-150, 150), st.floats(-150, 150)) | st.just((0.0, 0.0))
velocities = st.tuples(st.floats(-40, 40), st.floats(-40, 40)) | st.just((0.0, 0.0))
sigmas = st.sampled_from([0.0, 0.3, 1.0, 5.0, 100.0])


@st.composite
def perceived_objects(draw: st.DrawFn, name: str, source: ObjectSource) -> PerceivedObject:
    place_sigma, speed_sigma = draw(sigmas), draw(sigmas)
    spread = (place_sigma**2, place_sigma**2, speed_sigma**2, speed_sigma**2)
    covariance = tuple(tuple(v if i == j else 0.0 for j in range(4)) for i, v in enumerate(spread))
    state = (*draw(places), *draw(velocities))
    age_s, tracked_for_s = draw(st.floats(0.0, 3.0)), draw(st.floats(0.0, 5.0))
    return PerceivedObject(
        0.0, name, source, state, covariance, age_s, frozenset(), draw(maybe), tracked_for_s
    )


Act = Callable[[RiskMonitor, float], None]


speeds = st.builds(
    lambda at_s, speed, source: lambda m, now: m.host.receive_observation(
        Speed(now + at_s, speed, 0.28, source)
    ),
    late_s, st.sampled_from([0.0, 5.0, 15.0, 16.0, 70.0]), st.sampled_from(["obd", "dbc"]),
)  # fmt: skip
pedals = st.builds(
    lambda at_s, pressed: lambda m, now: m.host.receive_observation(
        BrakePedal(now + at_s, pressed, "dbc")
    ),
    late_s, st.booleans(),
)  # fmt: skip
leads = st.builds(
    lambda at_s, gap, closing, sigma: lambda m, now: m.receive_event(
        Lead(now + at_s, LeadIdentity.UNKNOWN, None, gap, 1.0, closing, sigma), now
    ),
    late_s, st.sampled_from([None, -1.0, 0.0, 2.0, 4.0, 8.0, 60.0]),
    st.sampled_from([None, -60.0, 0.0, 5.0, 9.0, 60.0]), st.sampled_from([None, 0.3, 10.0]),
)  # fmt: skip
warnings = st.builds(
    lambda age_s: lambda m, now: m.receive_event(lcca_warning(now - age_s, bytes(8)), now),
    st.floats(0.0, 5.0),
)
BRAKES_HARD = VehicleSafetyExtensions(events=VehicleEventFlags.HARD_BRAKING)
words = st.builds(
    lambda name, height_m, said: lambda m, now: m.receive_bsm(
        BasicSafetyMessage(CoreData(1, name, elevation_m=height_m, size=VehicleSize(0, 0)), said),
        now,
    ),
    st.sampled_from(IDS), maybe, st.none() | st.just(BRAKES_HARD),
)  # fmt: skip
positions = st.builds(
    lambda height_m: (
        lambda m, now: m.receive_event(Position(now, 47.0, 8.0, height_m, 1.0, None, None), now)
    ),
    maybe,
)
looks = st.builds(
    lambda own, others: lambda m, now: m.assess(own, others, now),
    st.none() | perceived_objects("own", ObjectSource.HOST),
    st.tuples(*(perceived_objects(name.hex(), ObjectSource.BSM) for name in IDS)),
)
acts: st.SearchStrategy[Act] = st.one_of(
    speeds, pedals, leads, leads, warnings, words, positions, looks, looks
)


@pytest.mark.long
@settings(max_examples=150)
@given(st.lists(acts, min_size=20, max_size=60))
def test_alarms_change_are_of_finite_value_say_why_and_end(acts: list[Act]) -> None:
    monitor, now = RiskMonitor(RiskSettings(), 4.8, 1.8), 100.0
    levels: defaultdict[tuple[Cause, str], Level] = defaultdict(lambda: Level.NONE)

    def look() -> None:
        for event in iter(monitor.next_event, None):
            assert isinstance(event, Alarm)
            key = event.cause, event.vehicle
            assert event.level is not levels[key]
            assert math.isfinite(event.value)
            assert bool(event.reasons) or event.level.rank < levels[key].rank
            levels[key] = event.level

    for act in acts:
        act(monitor, now)
        look()
        now += STEP_S
    monitor.receive_event(WarningOver(now, bytes(8), 7, "expired"), now)
    for _ in range(round(12.0 / STEP_S)):
        monitor.assess(None, [], now)
        look()
        now += STEP_S

    assert set(levels.values()) <= {Level.NONE}
