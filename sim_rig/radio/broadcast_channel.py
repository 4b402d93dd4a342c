"""Channels with access, by their settings."""

import numpy as np

from sim_rig.radio.channel import Channel
from sim_rig.radio.sidelink import SidelinkChannel
from sim_rig.scenario.radio_settings import ChannelSettings, CsmaSettings


def broadcast_channel(
    settings: ChannelSettings, stations: int, rng: np.random.Generator
) -> Channel | SidelinkChannel:
    """Open the channel that the settings select.

    Args:
        settings: model and parameters.
        stations: number of stations.
        rng: source of all random effects.
    """
    if isinstance(settings, CsmaSettings):
        return Channel(settings, stations, rng)
    return SidelinkChannel(settings, stations, rng)
