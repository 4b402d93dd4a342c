"""The model of the air that the settings name."""

import numpy as np

from sim_rig.radio.air import Air, CarsAt
from sim_rig.radio.csma_air import CsmaAir
from sim_rig.radio.reach import ReachAir
from sim_rig.scenario.radio_settings import AirSettings, ReachSettings


def open_air(
    settings: AirSettings, cars_at: CarsAt, units: list[str], rng: np.random.Generator
) -> Air:
    """Join `units`, the cars that have a radio; `cars_at(now)` says where they are."""
    if isinstance(settings, ReachSettings):
        return ReachAir(settings, cars_at, units, rng)
    return CsmaAir(settings, cars_at, units, rng)
