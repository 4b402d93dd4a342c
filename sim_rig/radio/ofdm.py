"""802.11p's OFDM in 10 MHz: how long a frame lasts, and how likely it survives noise.

IEEE 802.11-2016, clause 17. Error rates are those of link simulations in white noise, tabled for
packets of 32 and of 1458 bytes (`error_rates.csv`: the figures that ns-3 uses, R. Patidar et al.,
"Link-to-System Mapping for ns-3 Wi-Fi OFDM Error Models", 2017). Another length L follows from the
tabled L0 as 1 - (1 - rate)^(L / L0).
"""

import csv
import math
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PREAMBLE_S = 32e-6
SIGNAL_S = 8e-6
"""The PLCP header, one symbol of the lowest rate."""
HEADERS_S = PREAMBLE_S + SIGNAL_S
_SIGNAL_MBIT_S = 3
_SERVICE_AND_TAIL_BITS = 16 + 6

LLC_BYTES = 8
MAC_BYTES = 26 + 4
"""Header of a QoS data frame, and frame check sequence."""

_TABLES = Path(__file__).with_name("error_rates.csv")
_LARGE_BYTES = 400
"""From here the table of the large packets is taken."""
_STEP_DB = 0.01


def psdu_bytes(payload_bytes: int) -> int:
    """What is transmitted for a payload of the upper layers."""
    return payload_bytes + LLC_BYTES + MAC_BYTES


def airtime_s(psdu: int, data_rate_mbit_s: float, symbol_us: int = 8) -> float:
    """How long a frame of `psdu` bytes is on the air (17.4.3)."""
    bits = _SERVICE_AND_TAIL_BITS + 8 * psdu
    symbols = math.ceil(bits / (data_rate_mbit_s * symbol_us))
    return HEADERS_S + symbols * symbol_us * 1e-6


def noise_mw(noise_figure_db: float, bandwidth_hz: float = 10e6) -> float:
    """Thermal noise at 290 K with the receiver's own on top."""
    return 1e3 * 1.380649e-23 * 290.0 * bandwidth_hz * from_db(noise_figure_db)


def from_db(ratio_db: float) -> float:
    """Decibels as a ratio; dBm as milliwatts."""
    return float(10.0 ** (ratio_db / 10.0))


class SurvivalInNoise:
    """How likely a stretch of a frame survives, by its signal to noise and interference ratio."""

    def __init__(self, data_rate_mbit_s: int) -> None:
        self._bytes_per_s = data_rate_mbit_s * 1e6 / 8.0
        self._small = _log_survival_per_byte(data_rate_mbit_s, 32)
        self._large = _log_survival_per_byte(data_rate_mbit_s, 1458)
        self._signal = _log_survival_per_byte(_SIGNAL_MBIT_S, 32)

    def of_data(self, sinr: Array, duration_s: float) -> Array:
        """For `duration_s` of the data field."""
        size = max(1, int(duration_s * self._bytes_per_s + 1e-6))
        table = self._small if size < _LARGE_BYTES else self._large
        survival: Array = np.exp(size * _look_up(table, sinr))
        return survival

    def of_signal(self, sinr: Array, duration_s: float = SIGNAL_S) -> Array:
        """For `duration_s` of the PLCP header."""
        size = max(1, int(duration_s * _SIGNAL_MBIT_S * 1e6 / 8.0 + 1e-6))
        survival: Array = np.exp(size * _look_up(self._signal, sinr))
        return survival

    def sure_from_sinr(self) -> float:
        """From this ratio on (not in dB) nothing is lost to noise."""
        return from_db(
            max(table[0] + _STEP_DB * len(table[1]) for table in (self._small, self._large))
        )


def _look_up(table: tuple[float, Array], sinr: Array) -> Array:
    least_db, values = table
    with np.errstate(divide="ignore"):
        steps = (10.0 * np.log10(sinr) - least_db) / _STEP_DB + 0.5
    # Below the table nothing survives, above it all does: its ends say so.
    found: Array = values[np.clip(steps, 0, len(values) - 1).astype(np.int64)]
    return found


@cache
def _log_survival_per_byte(data_rate_mbit_s: int, packet_bytes: int) -> tuple[float, Array]:
    """First SNR in dB of a table in steps of `_STEP_DB`, and ln(1 - error rate) / bytes."""
    with _TABLES.open(newline="", encoding="utf-8") as file:
        points = [
            (float(row["snr_db"]), float(row["error_rate"]))
            for row in csv.DictReader(file)
            if (int(row["data_rate_mbit_s"]), int(row["packet_bytes"]))
            == (data_rate_mbit_s, packet_bytes)
        ]
    snr_db, error_rate = np.array(points).T
    steps_db = np.linspace(snr_db[0], snr_db[-1], 1 + round((snr_db[-1] - snr_db[0]) / _STEP_DB))
    with np.errstate(divide="ignore"):
        return float(snr_db[0]), np.log1p(-np.interp(steps_db, snr_db, error_rate)) / packet_bytes
