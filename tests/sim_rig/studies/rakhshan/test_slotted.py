"""Each formula compared with a slot-by-slot simulation of the same assumptions."""

import numpy as np
import pytest

from sim_rig.studies.rakhshan.slotted import (
    SlottedChannel,
    SlottedLinks,
    asynchronous,
    from_db,
    opportunities,
    packet_success,
    slots_needed,
    success_after,
)

POSITION_M = np.array([0.0, 12.0, 20.0, 45.0, 51.0, 90.0])
ACCESS = np.array([0.1, 0.05, 0.3, 0.2, 0.02, 0.4])
CHANNEL = SlottedChannel(threshold=from_db(11.0), path_loss_exponent=3.0)
LINKS = SlottedLinks(np.array([0, 0, 2, 5]), np.array([2, 4, 5, 3]))
SLOTS = 200_000


def received(sender: int, receiver: int, *, slots: int = SLOTS, seed: int = 1) -> np.ndarray:
    """(slots,) whether a packet would be received if the sender sends and the receiver listens."""
    rng = np.random.default_rng(seed)
    sends = rng.uniform(size=(slots, len(ACCESS))) < ACCESS
    sends[:, [sender, receiver]] = False
    fading = rng.exponential(size=(slots, len(ACCESS)))
    distance_m = np.abs(POSITION_M - POSITION_M[receiver])
    distance_m[receiver] = np.inf
    power = fading * distance_m**-CHANNEL.path_loss_exponent
    interference = np.sum(np.where(sends, power, 0.0), axis=1)
    return np.asarray(power[:, sender] > CHANNEL.threshold * interference)


@pytest.mark.parametrize("link", range(4))
def test_theorem_1(link: int) -> None:
    formula = packet_success(POSITION_M, ACCESS, LINKS, CHANNEL)[link]

    simulated = received(LINKS.sender[link], LINKS.receiver[link]).mean()

    standard_error = np.sqrt(simulated * (1.0 - simulated) / SLOTS)
    assert formula == pytest.approx(simulated, abs=3 * standard_error)


def test_slots_needed_is_the_mean_waiting_time_until_reception() -> None:
    sender, receiver = 0, 2
    rng = np.random.default_rng(2)
    is_received = received(sender, receiver, seed=3)
    is_received &= rng.uniform(size=SLOTS) < ACCESS[sender]
    is_received &= rng.uniform(size=SLOTS) >= ACCESS[receiver]
    waits = np.diff(np.flatnonzero(is_received))

    success = packet_success(POSITION_M, ACCESS, LINKS, CHANNEL)[0]
    formula = slots_needed(success, ACCESS[sender], ACCESS[receiver])

    assert formula == pytest.approx(waits.mean(), abs=3 * waits.std() / np.sqrt(len(waits)))


def test_success_after_d_opportunities() -> None:
    rng = np.random.default_rng(4)
    slots = np.array([20.0])
    wins = rng.uniform(size=(50_000, 30)) < 1.0 / slots
    simulated = wins.any(axis=1).mean()

    assert success_after(slots, np.array(30.0))[0] == pytest.approx(simulated, abs=0.007)


def test_an_interferer_overlaps_two_asynchronous_slots() -> None:
    rng = np.random.default_rng(5)
    p = 0.2
    overlaps = (rng.uniform(size=(200_000, 2)) < p).any(axis=1).mean()

    assert asynchronous(np.array(p)) == pytest.approx(overlaps, abs=0.003)


def test_the_papers_packet_fills_an_opportunity_in_222_us() -> None:
    assert opportunities(np.array(0.1), data_rate_mbit_s=9.0, packet_bytes=250) == 450


def test_two_cars_lose_nothing_and_a_third_car_at_the_receiver_destroys_every_overlap() -> None:
    pair = SlottedLinks(np.array([0]), np.array([1]))
    two = packet_success(np.array([0.0, 30.0]), np.array([0.5, 0.5]), pair, CHANNEL)
    beside = packet_success(np.array([0.0, 30.0, 30.0]), np.array([0.5, 0.5, 0.25]), pair, CHANNEL)

    assert two[0] == 1.0
    assert beside[0] == 0.75, "only when the car beside is silent"


def test_chains_and_probabilities_are_vectorised() -> None:
    rng = np.random.default_rng(6)
    positions = np.sort(rng.uniform(0.0, 200.0, (7, 1, 6)), axis=-1)
    access = rng.uniform(0.0, 0.5, (5, 6))

    together = packet_success(positions, access, LINKS, CHANNEL)

    assert together.shape == (7, 5, 4)
    assert together[3, 2] == pytest.approx(
        packet_success(positions[3, 0], access[2], LINKS, CHANNEL)
    )


@pytest.mark.parametrize(
    ("position_m", "access", "message"),
    [
        ([0.0, 10.0], [0.5, 1.5], "probabilities are 0 to 1"),
        ([0.0, 10.0], [-0.1, 0.5], "probabilities are 0 to 1"),
        ([5.0, 5.0], [0.5, 0.5], "must not have the same position"),
    ],
)
def test_invalid_arguments_are_an_error(
    position_m: list[float], access: list[float], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        packet_success(
            np.array(position_m),
            np.array(access),
            SlottedLinks(np.array([0]), np.array([1])),
            CHANNEL,
        )
