"""Hard brakings that BSMs tell of, of vehicles far ahead, or that only seem to be ahead.

All drive as fast as the host vehicle and brake in the second half of each period, one invented
vehicle after the other.
"""

from collections.abc import Iterator

from sim_rig.studies.attacks.attack_world import SPEED_M_S, AttackedHost, Signer

PERIOD_S = 6.0
BRAKING_M_S2 = 4.5
FAR_M = 200.0
CARRIAGEWAY_M = 12.0
"""To the left, where others come towards the host."""
REPLAYED_S = 60.0
"""Age of what is sent once more."""


def far_ahead(host: AttackedHost, signer: Signer, insider: int, now: float) -> Iterator[bytes]:
    """In the host's lane, farther than EEBL looks."""
    brakes_s, name = _period(insider, now)
    place_m = 0.0, host.north_m + FAR_M - BRAKING_M_S2 * brakes_s**2 / 2.0
    velocity_m_s = 0.0, SPEED_M_S - BRAKING_M_S2 * brakes_s
    yield signer.bsm_at(place_m, velocity_m_s, now, temporary_id=name, brakes=brakes_s > 0.0)


def without_a_place(
    _host: AttackedHost, signer: Signer, insider: int, now: float
) -> Iterator[bytes]:
    """Anywhere: only its speed, which is the host's, says that it is ahead."""
    brakes_s, name = _period(insider, now)
    velocity_m_s = 0.0, SPEED_M_S - BRAKING_M_S2 * brakes_s
    yield signer.bsm_at(None, velocity_m_s, now, temporary_id=name, brakes=brakes_s > 0.0)


def replayed(host: AttackedHost, signer: Signer, insider: int, now: float) -> Iterator[bytes]:
    """The same as a minute ago, when somebody braked here."""
    brakes_s, name = _period(insider, now)
    place_m = 0.0, host.north_m + FAR_M
    velocity_m_s = 0.0, SPEED_M_S - BRAKING_M_S2 * brakes_s
    yield signer.bsm_at(
        place_m, velocity_m_s, now - REPLAYED_S, temporary_id=name, brakes=brakes_s > 0.0
    )


def other_carriageway(
    host: AttackedHost, signer: Signer, insider: int, now: float
) -> Iterator[bytes]:
    """Truly, in front of the host, and driving the other way."""
    brakes_s, name = _period(insider, now)
    into_s = (now + 1.1 * insider) % PERIOD_S
    way_m = SPEED_M_S * into_s - BRAKING_M_S2 * brakes_s**2 / 2.0
    place_m = -CARRIAGEWAY_M, host.north_m - SPEED_M_S * into_s + FAR_M - way_m
    velocity_m_s = 0.0, BRAKING_M_S2 * brakes_s - SPEED_M_S
    yield signer.bsm_at(place_m, velocity_m_s, now, temporary_id=name, brakes=brakes_s > 0.0)


def on_a_bridge(host: AttackedHost, signer: Signer, insider: int, now: float) -> Iterator[bytes]:
    """Truly, on a road that crosses the host's on a bridge."""
    brakes_s, name = _period(insider, now)
    into_s = (now + 1.1 * insider) % PERIOD_S
    place_m = (
        SPEED_M_S * (into_s - PERIOD_S / 2.0) - BRAKING_M_S2 * brakes_s**2 / 2.0,
        host.north_m - SPEED_M_S * into_s + FAR_M,
    )
    velocity_m_s = SPEED_M_S - BRAKING_M_S2 * brakes_s, 0.0
    yield signer.bsm_at(place_m, velocity_m_s, now, temporary_id=name, brakes=brakes_s > 0.0)


def towed(host: AttackedHost, signer: Signer, insider: int, now: float) -> Iterator[bytes]:
    """On a trailer ahead: its place moves, its wheels stand, and its unit says that it brakes."""
    brakes_s, name = _period(insider, now)
    place_m = 0.0, host.north_m + FAR_M
    yield signer.bsm_at(place_m, (0.0, 0.0), now, temporary_id=name, brakes=brakes_s > 0.0)


def _period(insider: int, now: float) -> tuple[float, bytes]:
    """For how long the present vehicle has braked, and its temporary ID."""
    number, into_s = divmod(now + 1.1 * insider, PERIOD_S)
    name = bytes((0xE0 + insider,)) + int(number).to_bytes(3)
    return max(into_s - PERIOD_S / 2.0, 0.0), name
