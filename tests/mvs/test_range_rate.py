"""Range rates in the filter: the velocity along the line of sight, at once."""

import math

import numpy as np
import pytest

from onboard.mvs.multi_vehicle_sensing import MultiVehicleSensing
from onboard.mvs.settings import MvsSettings, SensingSettings
from onboard.observations import Position, VehicleDetection
from onboard.tracking.evidence import Measurement
from tests.mvs.world import to_degrees

RATE_SIGMA_M_S = 0.1
OWN_M_S = 20.0


def drive(
    lead_m_s: float, until_s: float, *, has_rate: bool, seed: int = 1
) -> tuple[MultiVehicleSensing, float]:
    """North, behind a vehicle at 40 m when the drive begins; ten fixes and sweeps a second."""
    rng = np.random.default_rng(seed)
    sensing = SensingSettings(face_to_centre_m=0.0, face_to_centre_sigma_m=0.01)
    mvs = MultiVehicleSensing(MvsSettings(sensing=sensing), b"--me", np.random.default_rng(1))
    now = 0.0
    for k in range(round(until_s * 10) + 1):
        now = k / 10
        place = to_degrees(*(np.array([0.0, OWN_M_S * now]) + rng.normal(0.0, 0.3, 2)))
        east, north = np.array([0.0, OWN_M_S]) + rng.normal(0.0, 0.1, 2)
        mvs.receive_position(
            Position(now, *place, None, 0.3, math.hypot(east, north), math.atan2(east, north))
        )
        rate_m_s = lead_m_s - OWN_M_S + RATE_SIGMA_M_S * rng.normal()
        range_m = 40.0 + (lead_m_s - OWN_M_S) * now + 0.3 * rng.normal()
        mvs.receive_detection(
            VehicleDetection(
                now,
                1,
                range_m,
                0.3,
                0.005 * rng.normal(),
                0.005,
                range_rate_m_s=rate_m_s if has_rate else None,
                range_rate_sigma_m_s=RATE_SIGMA_M_S if has_rate else None,
            )
        )
        mvs.update(now)
    return mvs, now


@pytest.mark.parametrize("lead_m_s", [0.0, 12.0, 25.0])
def test_after_three_sweeps_the_speed_is_known(lead_m_s: float) -> None:
    mvs, now = drive(lead_m_s, 0.2, has_rate=True)

    (lead,) = mvs.kinematic_info(now)

    assert lead.state[3] == pytest.approx(lead_m_s, abs=0.6)
    assert math.sqrt(lead.covariance[3][3]) < 0.5


def test_without_range_rate_it_takes_longer() -> None:
    mvs, now = drive(12.0, 0.2, has_rate=False)

    (lead,) = mvs.kinematic_info(now)

    assert math.sqrt(lead.covariance[3][3]) > 1.5


def test_the_stated_covariance_of_the_speed_is_right_or_large() -> None:
    """Normalised squared errors along the line of sight, over 40 drives."""
    squared = []
    for seed in range(40):
        mvs, now = drive(12.0, 1.0, has_rate=True, seed=seed)
        (lead,) = mvs.kinematic_info(now)
        squared.append((lead.state[3] - 12.0) ** 2 / lead.covariance[3][3])

    assert np.mean(squared) < 1.4


def test_a_sweep_that_is_sent_again_counts_once() -> None:
    """Of a detector that repeats its last sweep until the next one."""
    mvs, now = drive(12.0, 0.2, has_rate=True)
    (known,) = mvs.kinematic_info(now)
    sweep = VehicleDetection(now + 0.1, 1, 39.2, 0.3, 0.0, 0.005, None, -8.0, RATE_SIGMA_M_S)
    once, _ = drive(12.0, 0.2, has_rate=True)
    for mvs_, times in ((mvs, 3), (once, 1)):
        for _ in range(times):
            mvs_.receive_detection(sweep)
        mvs_.update(now + 0.1)
    (again,), (single,) = mvs.kinematic_info(now + 0.1), once.kinematic_info(now + 0.1)
    assert again.state == single.state != known.state
    assert again.covariance == single.covariance


def test_a_shared_measurement_has_no_velocity() -> None:
    """A receiver cannot check a speed that one measurement states."""
    mvs, _ = drive(12.0, 0.2, has_rate=True)

    (track,) = mvs.reported_tracks()

    assert all(isinstance(piece, Measurement) for piece in track.pieces)
    assert all(stored.is_measurement for stored in track.stored)
