"""Driver-based access: simulated highways a second, and cost of the core on board.

The reference of the Monte Carlo simulation is plain Python with the same formulas, for one drop,
link and car at a time. Both compute the same drops and must agree.
"""

import math
import timeit
from collections.abc import Iterator
from statistics import median

import numpy as np

from bench import Figure
from onboard.access.adaptation import AccessAdaptation
from onboard.access.driver_model import DEFAULT_POPULATION, DriverModel
from onboard.access.rear_end import tolerable_lag_s
from onboard.observations import Lead, LeadIdentity, Speed
from onboard.sensors.host_state import HostState
from sim_rig.studies.rakhshan.highway import Drops, RakhshanHighwaySettings, collision_share, draw
from sim_rig.studies.rakhshan.slotted import from_db, slot_s

ROUNDS = 5
DROPS, PLAIN_DROPS = 50, 2
ACCESS = 0.03
PAIRS = np.geomspace(0.002, 0.4, 20)
"""Access probabilities whose pairs make the surface of figure 10."""
CALLS = 500


def measure() -> Iterator[Figure]:
    """Yield chains/s, and microseconds for a lead update and for a reaction."""
    settings = RakhshanHighwaySettings()
    drops = draw(settings, DROPS, np.random.default_rng(1))
    few = draw(settings, PLAIN_DROPS, np.random.default_rng(2))
    access = np.array([ACCESS])
    if list(collision_share(settings, few, access, access)[0, 0]) != _plain(settings, few):
        raise AssertionError("results differ from the reference's")
    plain_rates, rates, surface_rates = [], [], []
    for _ in range(ROUNDS):
        plain_s = timeit.timeit(lambda: _plain(settings, few), number=1)
        one_s = (
            timeit.timeit(lambda: collision_share(settings, drops, access, access), number=4) / 4
        )
        surface_s = timeit.timeit(lambda: collision_share(settings, drops, PAIRS, PAIRS), number=1)
        plain_rates.append(PLAIN_DROPS * settings.lanes / plain_s)
        rates.append(DROPS * settings.lanes / one_s)
        surface_rates.append(DROPS * settings.lanes * len(PAIRS) ** 2 / surface_s)
    for name, measured in (("chains", rates), ("chains_of_a_surface", surface_rates)):
        yield Figure(
            f"access.{name}",
            median(measured),
            "chains/s",
            ROUNDS,
            "the same formulas in plain Python",
            median(plain_rates),
        )
    yield from _on_board()


def _on_board() -> Iterator[Figure]:
    host = HostState()
    core = AccessAdaptation(DriverModel(DEFAULT_POPULATION), host)
    host.receive_observation(Speed(0.0, 20.0, 0.28, "bench"))
    lead = Lead(0.0, LeadIdentity.UNKNOWN, None, 20.0, 0.5, 1.0, 0.1)

    def one_pair_at_a_time() -> None:
        for lead_m_s2 in (4.25 + 0.5 * k for k in range(8)):
            for own_m_s2 in (4.25 + 0.5 * k for k in range(8)):
                tolerable_lag_s(np.float64(20.0), 19.0, 20.0, lead_m_s2, own_m_s2)  # type: ignore[arg-type]

    driver = core.driver
    x = np.array([1.0, math.log(1.4)])

    def regression_again() -> None:
        """Solve the normal equations of 200 reactions, which the closed form avoids."""
        rows = np.repeat(x[None], 200, axis=0)
        np.linalg.solve(np.eye(2) + rows.T @ rows, rows.T @ np.ones(200))

    for name, call, reference, other in (
        (
            "look_at_lead",
            lambda: core.receive_lead(lead, 0.0),
            "only its 64 lags, one at a time",
            one_pair_at_a_time,
        ),
        (
            "reaction",
            lambda: driver.receive_reaction(1.1, 1.4),
            "a regression over 200 reactions",
            regression_again,
        ),
    ):
        value_us, reference_us = (
            [1e6 * timeit.timeit(work, number=CALLS) / CALLS for _ in range(ROUNDS)]
            for work in (call, other)
        )
        yield Figure(
            f"access.{name}", median(value_us), "us", ROUNDS, reference, median(reference_us)
        )


def _plain(settings: RakhshanHighwaySettings, drops: Drops) -> list[float]:
    """Share of the cars of each drop that collide."""
    beta, length_s = (
        from_db(settings.threshold_db),
        slot_s(settings.data_rate_mbit_s, settings.packet_bytes),
    )
    cars = settings.cars_per_lane
    parts = []
    for drop in range(len(drops.position_m)):
        positions_m = [float(at_m) for lane in drops.position_m[drop] for at_m in lane]
        hits = 0
        for lane in range(settings.lanes):
            reaction_s = drops.reaction_s[drop, lane].tolist()
            delay_s = [0.0] * cars
            for i in range(2, cars):
                informed_s = [delay_s[i - 1] + reaction_s[i - 1]]
                for j in range(i - 1):
                    slots = _slots(positions_m, lane * cars + j, lane * cars + i, beta, settings)
                    waited_s = delay_s[j] + reaction_s[j] if j else 0.0
                    informed_s.append(waited_s + slots * length_s)
                delay_s[i] = min(informed_s)
            begins_s = [0.0] + [delay_s[i] + reaction_s[i] for i in range(1, cars)]
            hits += sum(
                begins_s[i] - begins_s[i - 1] > drops.lag_s[drop, lane, i] for i in range(1, cars)
            )
        parts.append(hits / (settings.lanes * (cars - 1)))
    return parts


def _slots(
    positions_m: list[float],
    sender: int,
    receiver: int,
    beta: float,
    settings: RakhshanHighwaySettings,
) -> float:
    link_m = abs(positions_m[sender] - positions_m[receiver])
    success = 1.0
    for other, position_m in enumerate(positions_m):
        if other not in (sender, receiver):
            relative = (
                abs(position_m - positions_m[receiver]) / link_m
            ) ** settings.path_loss_exponent
            success *= 1.0 - ACCESS / (1.0 + relative / beta)
    return 1.0 / (success * ACCESS * (1.0 - ACCESS))
