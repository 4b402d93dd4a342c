"""An attentive observer knows of a crash when the true states show it, and no sooner."""

import math

import numpy as np
import pytest

from sim_rig.roads.cars import Cars
from sim_rig.studies.mvs.attentive_observer import AttentiveObserver

SPEED_M_S = 14.0
MEETS_S = 6.0


def cars(at_s: float, states: list[tuple[float, float, float, float, float]]) -> Cars:
    """Return cars by x, y, heading, speed and acceleration."""
    x_m, y_m, heading_rad, speed_m_s, acceleration_m_s2 = np.array(states).T
    names = ("one", "other")
    return Cars(
        at_s,
        names,
        np.stack([x_m, y_m], axis=1),
        heading_rad,
        speed_m_s,
        acceleration_m_s2,
        np.full(2, 4.5),
        np.full(2, 1.8),
    )


def known_at_s(observer: AttentiveObserver, *, runs: bool) -> float | None:
    """Two cars meet at a right angle; the one drives on, or brakes with 2 m/s^2 from 1 s on."""
    for at_s in np.arange(0.0, MEETS_S, 0.1).tolist():
        left_m = SPEED_M_S * (MEETS_S - at_s)
        braked_s = 0.0 if runs else max(at_s - 1.0, 0.0)
        speed_m_s = SPEED_M_S - 2.0 * braked_s
        observer.receive_cars(
            cars(
                at_s,
                [
                    (-left_m - braked_s**2, 0.0, 0.0, speed_m_s, -2.0 if braked_s else 0.0),
                    (0.0, -left_m, math.pi / 2, SPEED_M_S, 0.0),
                ],
            )
        )
    return observer.known_at_s


def test_who_runs_a_light_is_known_once_he_cannot_stop_any_more() -> None:
    found = known_at_s(AttentiveObserver(("one", "other"), yields="one"), runs=True)

    assert found is not None
    assert MEETS_S - found == pytest.approx(SPEED_M_S / (2 * 3.5), abs=0.5)  # v / 2a before


def test_who_brakes_enough_is_no_danger() -> None:
    assert known_at_s(AttentiveObserver(("one", "other"), yields="one"), runs=False) is None


@pytest.mark.parametrize(("gap_m", "is_known"), [(20.0, True), (150.0, False)])
def test_a_braking_ahead_is_known_at_once_if_it_ends_in_a_crash(
    gap_m: float, *, is_known: bool
) -> None:
    observer = AttentiveObserver(("one", "other"))
    for at_s in (0.0, 0.1, 0.2):
        braking_m_s2 = -6.0 if at_s >= 0.1 else 0.0
        speed_m_s = SPEED_M_S + braking_m_s2 * max(at_s - 0.1, 0.0)
        follower = (SPEED_M_S * at_s, 0.0, 0.0, SPEED_M_S, 0.0)
        lead = (gap_m + SPEED_M_S * at_s, 0.0, 0.0, speed_m_s, braking_m_s2)
        observer.receive_cars(cars(at_s, [follower, lead]))

    assert (observer.known_at_s == 0.1) is is_known
