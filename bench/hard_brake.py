"""Delay and false alarms of hard braking from whole km/h, in simulated and real driving.

Delays count from the time at which the true deceleration exceeds the threshold, falls below half of
it, or a collision begins, so they include the sampling. The reference of the first is a detector
with the true speed and time of each sample. The reference of false alarms is the difference of two
successive samples.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench import Figure
from onboard.kinematics.units import KM_H, STANDARD_GRAVITY_M_S2
from onboard.obd.braking import Braking
from onboard.obd.can_log import read_can_log
from onboard.obd.settings import ObdSettings
from onboard.obd.vehicle_bus import VehicleBus
from onboard.observations import BrakeCause, BrakePedal, HardBrake, Speed

STEP_S = 0.005
JERK_M_S3 = 20.0
"""Jerk of decided braking."""
BRAKINGS = 100
CITY_HOURS = 2.0
REAL_DRIVES = ("drive-a", "drive-b-requests-and-answers", "drive-c")
RECORDINGS = Path(__file__).parents[2] / "shared" / "data" / "can"

COLLISION_S = 0.1
"""Time in which a collision stops the car."""
ENDED_AFTER_S = 1.2
"""Time after which the driver releases the brake."""

Track = np.ndarray[tuple[int], np.dtype[np.float64]]


@dataclass(frozen=True, slots=True)
class Source:
    """How a car reports its speed."""

    name: str
    hz: float
    resolution_m_s: float = KM_H
    refresh_s: float = 0.02
    """Update interval of the value: its largest age when it is sampled."""
    jitter_s: float = 0.005
    """Mean of the exponential delay on the bus and in the computer."""
    pedal: bool = False

    def times(self, track: Track, rng: np.random.Generator) -> Track:
        """Sampling times: periodic, with a random phase."""
        return np.arange(rng.uniform(0.0, 1 / self.hz), len(track) * STEP_S - 0.01, 1 / self.hz)

    def samples(self, track: Track, times: Track, rng: np.random.Generator) -> Iterator[Speed]:
        """Received samples: delayed, with noise of 0.1 km/h, quantised, and with jitter.

        Args:
            track: true speeds every `STEP_S`.
            times: sampling times.
            rng: source of noise and jitter.
        """
        updated_s = np.floor(times / self.refresh_s) * self.refresh_s
        noisy = track[(updated_s / STEP_S).astype(int)] + rng.normal(0, 0.1 * KM_H, len(times))
        reported = np.floor(np.maximum(noisy, 0.0) / self.resolution_m_s) * self.resolution_m_s
        stamps = np.sort(times + rng.exponential(self.jitter_s, len(times)))
        for stamp_s, speed_m_s in zip(stamps.tolist(), reported.tolist(), strict=True):
            yield Speed(stamp_s, speed_m_s, self.resolution_m_s, self.name)


POLLED = (Source("obd_10_hz", 10.0), Source("obd_20_hz", 20.0))
OTHERS = (
    Source("obd_20_hz_stale_100_ms", 20.0, refresh_s=0.1),
    Source("obd_20_hz_and_pedal", 20.0, pedal=True),
    Source("wheel_50_hz", 50.0, resolution_m_s=0.01 * KM_H, jitter_s=0.001),
)


def measure() -> Iterator[Figure]:
    """Yield delays of alarms, ends and collisions, then false alarms."""
    for source in POLLED:
        # 3 m/s2 is below the default threshold of 0.4 g, and must not raise it.
        yield from _delays(source, 3.0, threshold_g=0.2)
        yield _raised_below(source, 3.0, threshold_g=0.4)
        for deceleration_m_s2 in (5.0, 8.0):
            yield from _delays(source, deceleration_m_s2, threshold_g=0.4)
    for source in OTHERS:
        for deceleration_m_s2 in (5.0, 8.0):
            yield from _delays(source, deceleration_m_s2, threshold_g=0.4)
    for source in (*POLLED, *OTHERS):
        yield from _end_delays(source, 8.0)
        yield from _collision_delays(source)
    city = _city(np.random.default_rng(1), CITY_HOURS)
    for source in (*POLLED, *OTHERS):
        yield _city_alarms(source, city)
    if RECORDINGS.is_dir():
        yield _real_alarms()


def _delays(source: Source, deceleration_m_s2: float, threshold_g: float) -> Iterator[Figure]:
    def delays_s(rng: np.random.Generator) -> tuple[float, float]:
        track, passed_at = _braking(deceleration_m_s2, threshold_g, rng)
        times = source.times(track, rng)
        raised = _alarms(_braking_core(source, threshold_g), source.samples(track, times, rng))
        raised_at = raised[0].stamp_s if raised else np.inf
        return raised_at - passed_at, _ideal_alarm_at(track, times, threshold_g) - passed_at

    name = f"hard_brake_delay_{deceleration_m_s2:.0f}_m_s2_{source.name}_above_{threshold_g}_g"
    yield from _percentiles(name, delays_s, "two successive true speeds")


def _raised_below(source: Source, deceleration_m_s2: float, threshold_g: float) -> Figure:
    rng = np.random.default_rng(2)
    raised = naive = 0
    for _ in range(BRAKINGS):
        track, _ = _braking(deceleration_m_s2, threshold_g, rng)
        samples = list(source.samples(track, source.times(track, rng), rng))
        raised += bool(_alarms(_braking_core(source, threshold_g), samples))
        naive += bool(_alarms(_differencing(threshold_g), samples))
    return Figure(
        name=f"hard_brake_raised_by_{deceleration_m_s2:.0f}_m_s2_{source.name}_above_{threshold_g}_g",
        value=raised / BRAKINGS,
        unit="of brakings",
        n=BRAKINGS,
        reference="difference of two samples",
        reference_value=naive / BRAKINGS,
    )


def _end_delays(source: Source, deceleration_m_s2: float) -> Iterator[Figure]:
    """Of a braking that the driver ends before standstill."""
    half_m_s2 = 0.4 * STANDARD_GRAVITY_M_S2 / 2

    def delays_s(rng: np.random.Generator) -> tuple[float, float]:
        track, _ = _braking(deceleration_m_s2, 0.4, rng, ENDED_AFTER_S)
        steep = np.flatnonzero(-np.diff(track) / STEP_S > half_m_s2)
        released_at = float(steep[-1] + 1) * STEP_S
        times = source.times(track, rng)
        ends = [each for each in _all_changes(source, track, times, rng) if each.is_over]
        ended_at = ends[0].stamp_s if len(ends) == 1 else np.inf
        ideal_at = times[np.searchsorted(times, released_at) + 1]
        return ended_at - released_at, ideal_at - released_at

    yield from _percentiles(f"hard_brake_end_delay_{source.name}", delays_s)


def _collision_delays(source: Source) -> Iterator[Figure]:
    """Of a collision at 30 to 100 km/h."""

    def delays_s(rng: np.random.Generator) -> tuple[float, float]:
        collides_at = 2.0 + rng.uniform(0.0, 1.0)
        after_s = np.arange(0.0, 5.0, STEP_S) - collides_at
        track = rng.uniform(30.0, 100.0) * KM_H * np.clip(1.0 - after_s / COLLISION_S, 0.0, 1.0)
        times = source.times(track, rng)
        raised = [
            each.stamp_s
            for each in _all_changes(source, track, times, rng)
            if each.cause is BrakeCause.COLLISION
        ]
        ideal_at = times[np.searchsorted(times, collides_at) + 1]
        return (raised[0] if raised else np.inf) - collides_at, ideal_at - collides_at

    yield from _percentiles(f"collision_delay_{source.name}", delays_s)


def _all_changes(
    source: Source, track: Track, times: Track, rng: np.random.Generator
) -> list[HardBrake]:
    changes = _changes(source, 0.4)
    return [each for sample in source.samples(track, times, rng) for each in changes(sample)]


def _percentiles(
    name: str,
    delays_s: Callable[[np.random.Generator], tuple[float, float]],
    reference: str = "second sample after it",
) -> Iterator[Figure]:
    """Median and 95 % of delay and ideal delay."""
    rng = np.random.default_rng(2)
    measured = np.array([delays_s(rng) for _ in range(BRAKINGS)])
    for suffix, percent in (("", 50), ("_p95", 95)):
        value, ideal = np.percentile(measured, percent, axis=0, method="nearest")
        yield Figure(
            name=name + suffix,
            value=float(value),
            unit="s",
            n=BRAKINGS,
            reference=reference,
            reference_value=float(ideal),
        )


def _city_alarms(source: Source, city: Track) -> Figure:
    rng = np.random.default_rng(3)
    samples = list(source.samples(city, source.times(city, rng), rng))
    return Figure(
        name=f"hard_brake_false_alarms_city_{source.name}",
        value=len(_alarms(_braking_core(source, 0.4), samples)) / CITY_HOURS,
        unit="1/h",
        n=len(samples),
        reference="difference of two samples",
        reference_value=len(_alarms(_differencing(0.4), samples)) / CITY_HOURS,
    )


def _real_alarms() -> Figure:
    """All braking in the recordings is below 0.23 g, so every alarm is false."""
    speeds = alarms = 0
    for drive in REAL_DRIVES:
        bus = VehicleBus(ObdSettings(polling_hz=None))
        for frame in read_can_log(RECORDINGS / f"{drive}.log"):
            bus.receive_frame(frame, frame.stamp_s)
            while (event := bus.next_event()) is not None:
                speeds += isinstance(event, Speed)
                alarms += isinstance(event, HardBrake)
    return Figure(
        name="hard_brake_false_alarms_real_drives",
        value=alarms,
        unit="alarms",
        n=len(REAL_DRIVES),
        reference="speeds read",
        reference_value=speeds,
    )


def _braking_core(source: Source, threshold_g: float) -> Callable[[Speed], HardBrake | None]:
    """The car's core: what each speed begins."""
    changes = _changes(source, threshold_g)
    is_braking = False

    def receive(speed: Speed) -> HardBrake | None:
        nonlocal is_braking
        begun = None
        for change in changes(speed):
            if not is_braking:
                begun = change
            is_braking = not change.is_over
        return begun

    return receive


def _changes(source: Source, threshold_g: float) -> Callable[[Speed], list[HardBrake]]:
    """The car's core: every change of the braking."""
    braking = Braking(threshold_g)
    if source.pedal:
        braking.receive_pedal(BrakePedal(0.0, pressed=True, source=source.name), 0.0)

    def receive(speed: Speed) -> list[HardBrake]:
        braking.receive_speed(speed, speed.stamp_s)
        return list(iter(braking.next_event, None))

    return receive


def _alarms(
    receive: Callable[[Speed], HardBrake | None], samples: Iterable[Speed]
) -> list[HardBrake]:
    return [alarm for sample in samples if (alarm := receive(sample)) is not None]


def _differencing(threshold_g: float) -> Callable[[Speed], HardBrake | None]:
    """The naive detector: the difference of two samples, inhibited for 1 s after each alarm."""
    last: Speed | None = None
    quiet_until = 0.0

    def receive(speed: Speed) -> HardBrake | None:
        nonlocal last, quiet_until
        before, last = last, speed
        if before is None or speed.stamp_s <= before.stamp_s or speed.stamp_s < quiet_until:
            return None
        mean = (before.speed_m_s - speed.speed_m_s) / (speed.stamp_s - before.stamp_s)
        if mean <= threshold_g * STANDARD_GRAVITY_M_S2:
            return None
        quiet_until = speed.stamp_s + 1.0
        return HardBrake(speed.stamp_s, mean, speed.source)

    return receive


def _ideal_alarm_at(track: Track, times: Track, threshold_g: float) -> float:
    speeds = track[(times / STEP_S).astype(int)]
    decelerations = -np.diff(speeds) / np.diff(times)
    return float(times[1:][np.argmax(decelerations > threshold_g * STANDARD_GRAVITY_M_S2)])


def _braking(
    deceleration_m_s2: float, threshold_g: float, rng: np.random.Generator, for_s: float = np.inf
) -> tuple[Track, float]:
    """Braking from 80 km/h to 10 km/h, and the time at which it exceeds the threshold.

    The brake is released after `for_s`.
    """
    started_at = 2.0 + rng.uniform(0.0, 1.0)
    braking_s = np.arange(0.0, 12.0, STEP_S) - started_at
    deceleration = np.clip(
        np.minimum(braking_s, for_s - braking_s) * JERK_M_S3, 0.0, deceleration_m_s2
    )
    track = rng.uniform(80.0, 81.0) * KM_H - np.cumsum(deceleration) * STEP_S
    passed_at = started_at + threshold_g * STANDARD_GRAVITY_M_S2 / JERK_M_S3
    return track[track > 10 * KM_H], passed_at


def _city(rng: np.random.Generator, hours: float) -> Track:
    """City driving: accelerate, cruise, brake (one in seven above 2.5 m/s2), sometimes stop."""
    parts: list[Track] = []
    speed_m_s = 0.0
    steps = 0
    while steps < hours * 3600 / STEP_S:
        target_m_s = rng.uniform(20.0, 60.0) * KM_H
        accelerating = np.arange(
            speed_m_s, max(target_m_s, speed_m_s), rng.uniform(0.8, 2.5) * STEP_S
        )
        rolling_s = rng.uniform(2.0, 15.0)
        rolling = target_m_s + 0.3 * np.sin(
            np.arange(0.0, rolling_s, STEP_S) * rng.uniform(0.2, 1.0)
        )
        firm = rng.random() < 1 / 7
        peak_m_s2 = rng.uniform(2.5, 3.5) if firm else rng.uniform(1.0, 2.5)
        end_m_s = 0.0 if rng.random() < 0.5 else rng.uniform(5.0, 15.0) * KM_H
        ramp = np.minimum(np.arange(0.0, 20.0, STEP_S) * rng.uniform(4.0, 15.0), peak_m_s2)
        falling = rolling[-1] - np.cumsum(ramp) * STEP_S
        braking = falling[falling > end_m_s]
        waiting = np.zeros(int(rng.uniform(1.0, 10.0) / STEP_S) if end_m_s == 0.0 else 0)
        round_trip = [accelerating, rolling, braking, waiting]
        parts += round_trip
        steps += sum(map(len, round_trip))
        speed_m_s = end_m_s
    return np.concatenate(parts)
