"""Mean received power between all stations: path loss and shadowing."""

import numpy as np
from numpy.typing import NDArray

from sim_rig.propagation.path_loss import LIGHT_M_S
from sim_rig.propagation.shadowing import VehicleShadowing
from sim_rig.radio.ofdm import from_db
from sim_rig.scenario.radio_settings import LinkSettings

Array = NDArray[np.float64]

_SHADOWED_FROM = 0.01
"""Shadowing is computed for links above the sensitivity times this factor."""


class Links:
    """All links of a channel at one time; links are symmetric."""

    def __init__(
        self, settings: LinkSettings, position_m: Array, vehicles: VehicleShadowing | None = None
    ) -> None:
        """Compute all links.

        Args:
            settings: parameters of the channel.
            position_m: (stations, 2), m; NaN for absent stations.
            vehicles: vehicles that shadow links, if the settings enable it.
        """
        apart_m = np.linalg.norm(position_m[:, None] - position_m[None], axis=-1)
        loss_db = settings.path_loss.loss_db(apart_m)
        mean_mw = 10.0 ** ((settings.tx_power_dbm - loss_db) / 10.0)
        np.fill_diagonal(mean_mw, 0.0)
        self.mean_mw = np.nan_to_num(mean_mw)
        """(sender, receiver), mean received power."""
        self.delay_s = np.nan_to_num(apart_m / LIGHT_M_S)
        """(sender, receiver), propagation delay."""
        shadowing = bool(settings.buildings) or (settings.vehicles_shadow and vehicles is not None)
        if shadowing:
            self._shadow(settings, position_m, vehicles)

    def _shadow(
        self, settings: LinkSettings, position_m: Array, vehicles: VehicleShadowing | None
    ) -> None:
        shadowed_mw = _SHADOWED_FROM * from_db(settings.sensitivity_dbm)
        one, other = np.nonzero(np.triu(self.mean_mw >= shadowed_mw))
        from_m, to_m = position_m[one], position_m[other]
        loss_db = np.zeros(len(one))
        for building in settings.buildings:
            loss_db += building.loss_db(from_m, to_m)
        if vehicles is not None and settings.vehicles_shadow:
            wave_m = LIGHT_M_S / (1e9 * settings.frequency_ghz)
            loss_db += vehicles.loss_db(from_m, to_m, settings.antenna_height_m, wave_m)
        passes = 10.0 ** (-loss_db / 10.0)
        self.mean_mw[one, other] *= passes
        self.mean_mw[other, one] *= passes
