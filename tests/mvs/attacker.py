"""A car that sends false footers, and the one that receives them."""

import numpy as np

from onboard.kinematics.local_frame import LocalFrame
from onboard.messages import mvs_footer
from onboard.messages.mvs_footer import MvsFooter
from onboard.mvs.footer_coding import footer_of
from onboard.mvs.multi_vehicle_sensing import MultiVehicleSensing
from onboard.observations import Position
from onboard.tracking.evidence import Estimate, Evidence, measurement_id
from tests.mvs.world import EXACT

HERE = LocalFrame(48.1, 11.5)
NOW = 1000.0
ATTACKER, WITNESS, OWN = b"fake", b"wit.", b"-own"


def victim() -> MultiVehicleSensing:
    mvs = MultiVehicleSensing(EXACT, OWN, np.random.default_rng(0))
    mvs.receive_position(Position(NOW, 48.1, 11.5, None, 0.5, 10.0, 0.0))
    return mvs


def say(mvs: MultiVehicleSensing, footer: MvsFooter | bytes, at: float = NOW) -> list[str]:
    """The attacker drives 100 m ahead and sends `footer`; returns why it was refused."""
    data = footer if isinstance(footer, bytes) else mvs_footer.encode(footer)
    place = Position(at, 48.1009, 11.5, None, 0.5, 10.0, 0.0)
    mvs.receive_bsm(ATTACKER, place, data, at)
    mvs.update(at)
    reasons = []
    while (event := mvs.next_event()) is not None:
        reasons.append(event.reason)
    return reasons


def estimate_at(
    x_m: float, y_m: float, stamps_ms: list[int], observer: bytes = ATTACKER, sigma_m: float = 0.5
) -> Estimate:
    provenance = frozenset(measurement_id(observer, stamp_ms) for stamp_ms in stamps_ms)
    covariance = np.diag([sigma_m**2, sigma_m**2, 1.0, 1.0])
    return Estimate(provenance, np.array([x_m, y_m, 0.0, 10.0]), covariance)


def footer_with(*evidence: Evidence, reference_ms: int = 1_000_000) -> MvsFooter:
    return footer_of(enumerate(evidence), reference_ms, HERE, HERE)


RECENT = [999_700, 999_800, 999_900]
"""Stamps in ms, just before `NOW`."""
