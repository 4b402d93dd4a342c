"""Everything that a vehicle's cores are given before the first input."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from onboard.access.driver_model import DriverModel
from onboard.observations import Sensor
from onboard.security.credentials import Credentials
from onboard.security.plate_digest import PlateDigest
from onboard.security.pseudonyms import FreshEntropy
from onboard.vehicle.config import CarConfig
from onboard.vehicle.stack import Stack

if TYPE_CHECKING:
    from onboard.obd.broadcast import BroadcastSignals


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InitialState:
    """Arguments of `Stack` that a recording holds: see there."""

    config: CarConfig
    sensors: frozenset[Sensor]
    seed: np.random.SeedSequence
    """Seed of all random draws until the first change of the pseudonym."""
    now: float
    utc_s: float
    credentials: Credentials | None = None
    driver: DriverModel | None = None
    signals: "BroadcastSignals | None" = None

    def stack(
        self, digest: PlateDigest | None = None, fresh_entropy: FreshEntropy | None = None
    ) -> Stack:
        """Return new cores with this initial state."""
        return Stack(
            self.config,
            self.sensors,
            np.random.default_rng(self.seed),
            now=self.now,
            utc_s=self.utc_s,
            credentials=self.credentials,
            driver=self.driver,
            digest=digest,
            signals=self.signals,
            fresh_entropy=fresh_entropy,
        )
