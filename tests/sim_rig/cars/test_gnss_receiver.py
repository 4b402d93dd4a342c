"""The receiver's sentences, read by the car's own reader and held against where the car was."""

import numpy as np
import pytest

from onboard.gnss.nmea import NmeaReader
from onboard.gnss.settings import GnssSettings
from onboard.observations import Position
from sim_rig.cars.gnss_receiver import GnssReceiver
from sim_rig.roads.earth import ORIGIN, ORIGIN_HEIGHT_M
from sim_rig.roads.road import CarState
from sim_rig.scenario.sensor_settings import ReceiverSettings
from tests.typed import a

UTC_OFFSET_S = 1_750_000_000.04
"""So that fixes do not fall on round moments of the car's clock."""


def car_at(now: float) -> CarState:
    """Drives east with 12 m/s on a bridge."""
    return CarState(12.0 * now, 50.0, np.pi / 2, 7.0, 12.0 * now, 12.0, 0.0, 4.5, 1.8, 1.5)


def receiver(
    seed: int = 1, *, runs: bool = True, sky_seed: int = 9, **settings: float
) -> GnssReceiver:
    return GnssReceiver(
        ReceiverSettings.model_validate(settings),
        car_at if runs else lambda _now: None,
        UTC_OFFSET_S,
        np.random.default_rng(seed),
        np.random.default_rng(sky_seed),
    )


def fixes(of: GnssReceiver, until_s: float) -> list[Position]:
    reader, found = NmeaReader(GnssSettings(latency_s=0.08)), []
    while (now := of.get_timer()) <= until_s:
        reader.receive_bytes(of.bytes_to_send(now), now)
        while (event := reader.next_event()) is not None:
            assert isinstance(event, Position)
            found.append(event)
    return found


def errors_m(found: list[Position]) -> np.ndarray:
    """(n, 2) east, north: reported position less the true one at its stamp."""
    return np.array(
        [
            ORIGIN.position_m(fix.latitude_deg, fix.longitude_deg) - (12.0 * fix.stamp_s, 50.0)
            for fix in found
        ]
    )


def test_an_exact_receiver_reports_the_position_at_the_time_of_the_fix() -> None:
    found = fixes(receiver(bias_sigma_m=0.0, noise_sigma_m=0.0, speed_sigma_m_s=0.0), 5.0)

    assert len(found) >= 48
    # The receiver's clock is learnt from the stream, to the hundredth of a second of a sentence.
    assert np.abs(errors_m(found)).max() < 0.02
    for fix in found:
        assert fix.speed_m_s == pytest.approx(12.0, abs=1e-3)
        assert fix.course_rad == pytest.approx(np.pi / 2, abs=1e-4)
        assert fix.altitude_m == pytest.approx(ORIGIN_HEIGHT_M + 7.0, abs=1e-2)


def test_fixes_are_made_at_round_moments_of_utc() -> None:
    of = receiver()

    assert (of.get_timer() - 0.08 + UTC_OFFSET_S) * 10 % 1.0 == pytest.approx(0.0, abs=1e-5)


def test_errors_agree_with_the_settings_and_the_reported_sigma() -> None:
    found = [fixes(receiver(seed, sky_seed=seed + 1000), 0.5)[-1] for seed in range(300)]

    errors = errors_m(found)
    assert errors.std() == pytest.approx(np.hypot(0.7, 0.2), rel=0.15)
    assert found[0].sigma_m == pytest.approx(np.hypot(0.7, 0.2), abs=0.01)
    assert np.std([a(float, fix.altitude_m) for fix in found]) == pytest.approx(1.46, rel=0.2)


@pytest.mark.long
def test_the_bias_wanders_and_the_noise_does_not() -> None:
    east = errors_m(fixes(receiver(bias_time_s=5.0, noise_sigma_m=0.0), 400.0))[:, 0]

    together = np.corrcoef(east[:-50], east[50:])[0, 1]
    assert together == pytest.approx(np.exp(-1.0), abs=0.25)
    assert np.abs(np.diff(east)).max() < 0.9


def test_receivers_under_one_sky_share_most_of_their_bias() -> None:
    one, other = (errors_m(fixes(receiver(seed, noise_sigma_m=0.0), 0.5)) for seed in (1, 2))
    apart = [
        errors_m(fixes(receiver(2 * k, sky_seed=k, noise_sigma_m=0.0), 0.3))[-1]
        - errors_m(fixes(receiver(2 * k + 1, sky_seed=k, noise_sigma_m=0.0), 0.3))[-1]
        for k in range(150)
    ]

    assert (one != other).any()
    assert np.std(apart) == pytest.approx(0.7 * np.sqrt(2 * 0.4), rel=0.15)


def test_a_silent_receiver_sends_nothing_and_keeps_its_fix_times() -> None:
    of = receiver(runs=False)
    first = of.get_timer()

    assert of.bytes_to_send(first) == b""
    assert of.get_timer() == pytest.approx(first + 0.1, abs=1e-6)


def test_nothing_is_said_before_the_fix_is_computed() -> None:
    of = receiver()

    assert of.bytes_to_send(of.get_timer() - 1e-4) == b""
