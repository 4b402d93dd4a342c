"""Selects the model of the radio channel."""

import numpy as np

from sim_rig.radio.air import Air, CarsAt
from sim_rig.radio.channel_air import ChannelAir
from sim_rig.radio.reach import ReachAir
from sim_rig.scenario.radio_settings import AirSettings, ReachSettings


def open_air(
    settings: AirSettings, cars_at: CarsAt, units: list[str], rng: np.random.Generator
) -> Air:
    """Return the channel that the settings select.

    Args:
        settings: model and parameters.
        cars_at: states of all cars at a `now`.
        units: names of the cars with a radio.
        rng: source of all random effects.
    """
    if isinstance(settings, ReachSettings):
        return ReachAir(settings, cars_at, units, rng)
    return ChannelAir(settings, cars_at, units, rng)
