"""Detection from whole km/h: hard braking is found, anything else is not."""

import math
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from onboard.kinematics.units import KM_H, STANDARD_GRAVITY_M_S2
from onboard.obd.braking import CHANGE_INTERVAL_S, Braking
from onboard.observations import BrakeCause, BrakePedal, HardBrake, Speed

THRESHOLD_M_S2 = 0.4 * STANDARD_GRAVITY_M_S2


def samples(
    stamps: NDArray[np.float64] | list[float],
    speed_m_s: Callable[..., float],
    resolution_m_s: float = KM_H,
    source: str = "obd:7E8",
) -> Iterator[Speed]:
    """Samples of `speed_m_s(t)` by an ECU, cut to its resolution."""
    for t in stamps:
        cut = math.floor(speed_m_s(t) / resolution_m_s + 1e-9) * resolution_m_s
        yield Speed(t, max(cut, 0.0), resolution_m_s, source)


def changes(
    speeds: Iterator[Any] | list[Speed], threshold_g: float = 0.4, pedal: BrakePedal | None = None
) -> list[HardBrake]:
    """Every change of the braking that these speeds show."""
    braking = Braking(threshold_g)
    if pedal is not None:
        braking.receive_pedal(pedal, pedal.stamp_s)
    found: list[HardBrake] = []
    for speed in speeds:
        braking.receive_speed(speed, speed.stamp_s)
        found += iter(braking.next_event, None)
    return found


def alarms(
    speeds: Iterator[Any] | list[Speed], threshold_g: float = 0.4, pedal: BrakePedal | None = None
) -> list[HardBrake]:
    """The begin of each braking."""
    found = changes(speeds, threshold_g, pedal)
    is_begin = [True, *(change.is_over for change in found)]
    return [change for change, begins in zip(found, is_begin, strict=False) if begins]


def ends(speeds: Iterator[Speed] | list[Speed], threshold_g: float = 0.4) -> list[HardBrake]:
    return [change for change in changes(speeds, threshold_g) if change.is_over]


def every(period_s: float, end_s: float, start_s: float = 0.0) -> list[float]:
    return np.arange(start_s, end_s, period_s).tolist()


def braking(
    deceleration_m_s2: float, at_s: float = 2.0, from_m_s: float = 80 * KM_H
) -> Callable[..., Any]:
    """Constant speed, then constant deceleration to a stop."""
    return lambda t: max(0.0, from_m_s - deceleration_m_s2 * max(0.0, t - at_s))


@pytest.mark.parametrize("hz", [10, 20])
@pytest.mark.parametrize(("deceleration", "within_s"), [(5.0, 0.7), (8.0, 0.4)])
def test_hard_braking_is_found_once(hz: int, deceleration: float, within_s: float) -> None:
    (alarm,) = alarms(samples(every(1 / hz, 8.0), braking(deceleration)))
    assert 2.0 < alarm.stamp_s < 2.0 + within_s
    assert THRESHOLD_M_S2 < alarm.deceleration_m_s2 < 1.4 * deceleration
    assert alarm.source == "obd:7E8"


@pytest.mark.parametrize("phase_s", [0.0, 0.1, 0.2, 0.3, 0.4])
def test_an_ecu_that_answers_at_2_hz_shows_one_braking_within_1_5_s(phase_s: float) -> None:
    found = changes(samples(every(0.5, 10.0, phase_s), braking(8.0, from_m_s=30.0)))
    assert 2.0 < found[0].stamp_s < 3.5
    assert [change.is_over for change in found].count(True) == 1
    assert 2.0 + 30.0 / 8.0 < found[-1].stamp_s < 2.0 + 30.0 / 8.0 + 1.5


@pytest.mark.parametrize("deceleration", [5.0, 8.0])
def test_samples_at_2_hz_find_hard_braking_with_the_third(deceleration: float) -> None:
    for phase_s in (0.0, 0.1, 0.2, 0.3, 0.4):
        (alarm,) = alarms(samples(every(0.5, 8.0, phase_s), braking(deceleration)))
        assert 2.8 < alarm.stamp_s < 3.4


@pytest.mark.long
@pytest.mark.parametrize("hz", [2, 10, 20, 100])
@pytest.mark.parametrize("deceleration", [0.0, 1.0, 2.0, 3.0])
def test_ordinary_braking_is_not_hard_braking(hz: int, deceleration: float) -> None:
    assert alarms(samples(every(1 / hz, 20.0), braking(deceleration))) == []


def test_the_threshold_is_a_setting() -> None:
    light = list(samples(every(0.05, 12.0), braking(3.0)))
    assert len(alarms(light, threshold_g=0.2)) == 1
    assert alarms(light, threshold_g=0.4) == []


def test_a_fine_signal_is_faster() -> None:
    coarse = alarms(samples(every(0.05, 4.0), braking(5.0)))
    fine = alarms(samples(every(0.02, 4.0), braking(5.0), resolution_m_s=0.01 * KM_H))
    assert fine[0].stamp_s < coarse[0].stamp_s


def test_a_pressed_pedal_delays_nothing_and_is_no_braking_by_itself() -> None:
    pressed = BrakePedal(0.0, pressed=True, source="dbc:Brake.Pressed")
    coarse = list(samples(every(0.05, 4.0), braking(5.0)))
    assert alarms(coarse, pedal=pressed)[0].stamp_s <= alarms(coarse)[0].stamp_s
    assert alarms(samples(every(0.05, 20.0), braking(3.0)), pedal=pressed) == []


def test_braking_with_a_pumped_pedal_is_found_once() -> None:
    def pumping(t: float) -> float:
        """8 m/s2 for 0.5 s, released for 0.25 s, three times."""
        braked_s = sum(min(max(t - at, 0.0), 0.5) for at in (2.0, 2.75, 3.5))
        return 120 * KM_H - 8.0 * braked_s

    assert len(alarms(samples(every(0.05, 6.0), pumping))) == 1


@pytest.mark.parametrize("hz", [10, 20])
def test_hard_eased_hard_again_is_a_second_braking(hz: int) -> None:
    def eased(t: float) -> float:
        """7 m/s2, 0.8 s of 1 m/s2, 7 m/s2 again."""
        hard_s = min(max(t - 2.0, 0.0), 1.0) + min(max(t - 3.8, 0.0), 1.0)
        return 120 * KM_H - 7.0 * hard_s - 1.0 * min(max(t - 3.0, 0.0), 0.8)

    found = changes(samples(every(1 / hz, 6.5), eased))
    first, second = (change for change in found if change.is_over)
    assert len(alarms(samples(every(1 / hz, 6.5), eased))) == 2
    assert 3.0 < first.stamp_s < 3.7
    assert 4.8 < second.stamp_s < 5.5
    assert (first.deceleration_m_s2, first.cause) == (0.0, BrakeCause.DECELERATION)


def test_braking_that_eases_and_goes_on_has_a_lower_level() -> None:
    """From 7 to 2.5 m/s^2, above half the threshold: it was 7 until its end."""

    def eases(t: float) -> float:
        return 140 * KM_H - 7.0 * max(0.0, t - 2.0) + 4.5 * max(0.0, t - 4.0)

    begin, *levels = changes(samples(every(0.05, 8.0), eases))

    assert begin.deceleration_m_s2 > 5.0
    assert not levels[-1].is_over
    assert levels[-1].deceleration_m_s2 == pytest.approx(2.5, abs=0.7)
    assert levels[-1].stamp_s < 6.0


def test_the_end_of_a_braking_tells_no_lower_level_before_it() -> None:
    def ends(t: float) -> float:
        return 140 * KM_H - 7.0 * min(max(0.0, t - 2.0), 2.0)

    *_, before, end = changes(samples(every(0.05, 8.0), ends))

    assert end.is_over
    assert before.deceleration_m_s2 > 5.0


def test_harder_braking_raises_the_level_once_it_is_certain() -> None:
    def harder(t: float) -> float:
        return 140 * KM_H - 5.0 * max(0.0, t - 2.0) - 4.0 * max(0.0, t - 3.5)

    begin, *levels, end = changes(samples(every(0.05, 9.0), harder))
    assert 4.0 < begin.deceleration_m_s2 < 6.5
    assert levels
    assert levels[-1].stamp_s < 5.0
    assert 7.5 < levels[-1].deceleration_m_s2 < 10.5
    assert all(not level.is_over for level in levels)
    assert all(b.stamp_s - a.stamp_s >= CHANGE_INTERVAL_S for a, b in pairwise([begin, *levels]))
    assert end.is_over


@pytest.mark.long
@given(
    deceleration_g=st.floats(0.5, 1.0),
    from_km_h=st.floats(40.0, 180.0),
    released_to_m_s2=st.floats(0.0, 0.5),
    braked_for_s=st.floats(0.8, 10.0),
    timing=st.tuples(
        st.floats(10.0, 20.0), st.sampled_from([0.0, 0.005, 0.02]), st.integers(0, 2**32 - 1)
    ),
)
def test_a_constant_braking_begins_once_and_ends_once_at_standstill_or_release(
    deceleration_g: float,
    from_km_h: float,
    released_to_m_s2: float,
    braked_for_s: float,
    timing: tuple[float, float, int],
) -> None:
    hz, jitter_s, seed = timing
    deceleration_m_s2 = deceleration_g * STANDARD_GRAVITY_M_S2
    standstill_at = 2.0 + from_km_h * KM_H / deceleration_m_s2
    released_at = 2.0 + braked_for_s

    def reported(t: float) -> float:
        braked_s, since_s = min(max(t - 2.0, 0.0), braked_for_s), max(t - released_at, 0.0)
        return from_km_h * KM_H - deceleration_m_s2 * braked_s - released_to_m_s2 * since_s

    rng = np.random.default_rng(seed)
    times = np.arange(rng.uniform(0.0, 0.1), min(standstill_at, released_at) + 3.0, 1 / hz)
    speeds = [
        Speed(t + jitter, each.speed_m_s, KM_H, each.source)
        for t, jitter, each in zip(
            times, rng.uniform(0.0, jitter_s, len(times)), samples(times, reported), strict=True
        )
    ]
    found = changes(speeds)
    ended_at = found[-1].stamp_s
    assert [change.is_over for change in found] == [False] * (len(found) - 1) + [True]
    assert -0.1 < ended_at - min(standstill_at, released_at) <= 0.7


def test_the_next_braking_is_found_after_the_first_ended() -> None:
    def twice(t: float) -> float:
        return 120 * KM_H - 7.0 * (min(max(t - 2, 0), 1.0) + min(max(t - 6, 0), 1.0))

    first, second = alarms(samples(every(0.05, 9.0), twice))
    assert first.stamp_s < 3.0
    assert second.stamp_s > 6.0


def test_the_detector_is_rearmed_after_a_long_silence() -> None:
    before = samples(every(0.05, 3.0), braking(7.0, from_m_s=120 * KM_H))
    after = samples(every(0.05, 13.0, 10.0), braking(7.0, at_s=11.0, from_m_s=120 * KM_H))
    assert len(alarms([*before, *after])) == 2


@pytest.mark.parametrize("lasting_s", [0.05, 0.1, 0.15])
def test_a_sensor_that_drops_to_zero_and_soon_back_is_not_braking(lasting_s: float) -> None:
    dropping = samples(every(0.05, 5.0), lambda t: 0.0 if 0.0 <= t - 2.0 < lasting_s else 22.0)
    assert changes(dropping) == []


@pytest.mark.parametrize("hz", [2, 20])
def test_one_wrong_sample_is_not_braking(hz: int) -> None:
    """Two samples half a second apart, however different, are not enough."""
    speeds = list(samples(every(1 / hz, 5.0), lambda t: 20.0))
    for low_m_s in (0.0, 10.0, 15.0, 18.0, 19.0):
        wrong = Speed(2.5, low_m_s, KM_H, "obd:7E8")
        assert alarms([wrong if s.stamp_s == 2.5 else s for s in speeds]) == []


@pytest.mark.parametrize("step_km_h", [1, 2, 3, 4, 5])
def test_a_step_is_not_braking(step_km_h: int) -> None:
    """As at the end of a stop, where many sensors drop from some km/h to 0."""
    stepped = samples(every(0.05, 5.0), lambda t: (50 - step_km_h * (t >= 2.0)) * KM_H)
    assert alarms(stepped) == []


def test_the_drop_at_the_end_of_an_ordinary_stop_is_not_braking() -> None:
    def stopping(t: float) -> float:
        true = braking(2.5)(t)
        return true if true >= 3 * KM_H else 0.0

    for hz in (10, 20):
        assert alarms(samples(every(1 / hz, 14.0), stopping)) == []


def test_another_source_with_another_scale_is_not_braking() -> None:
    obd = samples(every(0.05, 2.0), lambda t: 30.0)
    wheel = samples(every(0.05, 4.0, 2.0), lambda t: 28.0, 0.01, source="dbc:Wheels.FL")
    assert alarms([*obd, *wheel, *samples(every(0.05, 5.0, 4.0), lambda t: 30.0)]) == []


def test_samples_that_arrive_in_a_burst_after_a_stall_are_not_braking() -> None:
    """The wire stalls for 0.3 s during ordinary braking, then all values come at once."""
    speeds = []
    for s in samples(every(0.05, 12.0), braking(3.0)):
        stalled = 3.0 < s.stamp_s < 3.3
        stamp_s = 3.3 + (s.stamp_s - 3.3) / 100 if stalled else s.stamp_s
        speeds.append(Speed(stamp_s, s.speed_m_s, s.resolution_m_s, s.source))
    assert alarms(speeds) == []


def test_a_stamp_that_goes_back_is_ignored() -> None:
    speeds = list(samples(every(0.05, 8.0), braking(5.0)))
    mixed = []
    for speed in speeds:
        mixed += [speed, Speed(speed.stamp_s - 0.3, 0.0, KM_H, "obd:7E8")]
    assert changes(mixed) == changes(speeds)


def test_a_clock_that_jumps_back_starts_a_new_window() -> None:
    speeds = list(samples(every(0.05, 8.0), braking(5.0)))
    assert len(alarms([*speeds, *speeds])) == 2


@pytest.mark.long
@given(
    seed=st.integers(0, 2**32 - 1),
    period_s=st.sampled_from([0.05, 0.1, 0.2, 0.5]),
    refresh_s=st.sampled_from([0.005, 0.05, 0.1]),
    loss=st.sampled_from([0.0, 0.2, 0.6]),
)
def test_no_drive_below_three_m_s2_is_ever_hard_braking(
    seed: int, period_s: float, refresh_s: float, loss: float
) -> None:
    """At any rate, jitter, loss and age of the values."""
    rng = np.random.default_rng(seed)
    grid = np.arange(0.0, 30.0, 0.005)
    acceleration = np.repeat(rng.uniform(-3.0, 3.0, 30), len(grid) // 30)
    speed = np.maximum(np.cumsum(acceleration * 0.005) + rng.uniform(0, 40), 0.0)
    stamps = np.arange(0.2, 29.5, period_s)
    stamps = np.sort(stamps + rng.uniform(0.0, 0.02, len(stamps)))[rng.random(len(stamps)) >= loss]

    def reported(t: float) -> float:
        return float(speed[int((t // refresh_s) * refresh_s / 0.005)])

    assert alarms(samples(stamps.tolist(), reported)) == []
