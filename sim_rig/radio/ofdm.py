"""OFDM of 802.11p in 10 MHz channels: airtime and survival of frames.

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
"""Duration of the PLCP header, one symbol at the lowest rate."""
HEADERS_S = PREAMBLE_S + SIGNAL_S
_HEADER_MBIT_S = 3
_SERVICE_AND_TAIL_BITS = 16 + 6

LLC_BYTES = 8
MAC_BYTES = 26 + 4
"""Header of a QoS data frame, and frame check sequence."""

_TABLES = Path(__file__).with_name("error_rates.csv")
_LARGE_BYTES = 400
"""From this size on, the table of large packets is used."""
_STEP_DB = 0.01
_LEAST_DB, _MOST_DB = -4.0, 24.0
"""Range of the tables, which contains the transitions of all rates."""


def psdu_bytes(payload_bytes: int) -> int:
    """Size of the PSDU of a payload of the upper layers."""
    return payload_bytes + LLC_BYTES + MAC_BYTES


def airtime_s(psdu: int, data_rate_mbit_s: float, symbol_us: int = 8) -> float:
    """Airtime of a frame (17.4.3), s.

    Args:
        psdu: size of the PSDU, bytes.
        data_rate_mbit_s: data rate.
        symbol_us: granularity of the duration, 8 us or 4 us.
    """
    bits = _SERVICE_AND_TAIL_BITS + 8 * psdu
    symbols = math.ceil(bits / (data_rate_mbit_s * symbol_us))
    return HEADERS_S + symbols * symbol_us * 1e-6


def noise_mw(noise_figure_db: float, bandwidth_hz: float = 10e6) -> float:
    """Noise power of a receiver: thermal noise at 290 K times its noise figure."""
    return 1e3 * 1.380649e-23 * 290.0 * bandwidth_hz * from_db(noise_figure_db)


def from_db(ratio_db: float) -> float:
    """Convert dB to a ratio, or dBm to mW."""
    return float(10.0 ** (ratio_db / 10.0))


_LEAST_SINR = from_db(_LEAST_DB)


class SurvivalInNoise:
    """Probability that segments of a frame survive, by their SINR."""

    def __init__(self, data_rate_mbit_s: int) -> None:
        self._data_rate_mbit_s = data_rate_mbit_s
        # One table per row: PLCP header, small and large segments of data.
        self._tables = np.stack(
            [
                _log_survival_per_byte(rate, size)
                for rate, size in ((3, 32), (data_rate_mbit_s, 32), (data_rate_mbit_s, 1458))
            ]
        )

    def log_survival(self, sinr: Array, of_header: list[bool], durations_s: list[float]) -> Array:
        """Logarithm of the survival probability of each segment.

        Args:
            sinr: (segments, receivers), as a ratio; (1, receivers) if equal for all segments.
            of_header: (segments,) whether the segment is of the PLCP header or of the data.
            durations_s: (segments,), s.

        Returns:
            (segments, receivers).
        """
        rates = [_HEADER_MBIT_S if header else self._data_rate_mbit_s for header in of_header]
        sizes = [
            max(1, int(rate * duration_s * 1e6 / 8.0 + 1e-6))
            for rate, duration_s in zip(rates, durations_s, strict=True)
        ]
        table = [
            0 if header else 1 + (size >= _LARGE_BYTES)
            for header, size in zip(of_header, sizes, strict=True)
        ]
        # The ends of the tables hold outwards: nothing survives below, everything above.
        sinr = np.maximum(sinr, _LEAST_SINR)
        step = (10.0 / _STEP_DB) * np.log10(sinr) + (0.5 - _LEAST_DB / _STEP_DB)
        np.minimum(step, self._tables.shape[1] - 1, out=step)
        found = self._tables[np.array(table)[:, None], step.astype(np.int64)]
        log: Array = np.array(sizes)[:, None] * found
        return log

    def lossless_sinr(self) -> float:
        """Least SINR, as a ratio, without losses."""
        steps = np.flatnonzero(self._tables.min(axis=0) < 0.0)[-1] + 1
        return from_db(_LEAST_DB + _STEP_DB * float(steps))


@cache
def _log_survival_per_byte(data_rate_mbit_s: int, packet_bytes: int) -> Array:
    """ln(1 - error rate) / bytes at each `_STEP_DB` from `_LEAST_DB` to `_MOST_DB`."""
    with _TABLES.open(newline="", encoding="utf-8") as file:
        points = [
            (float(row["snr_db"]), float(row["error_rate"]))
            for row in csv.DictReader(file)
            if (int(row["data_rate_mbit_s"]), int(row["packet_bytes"]))
            == (data_rate_mbit_s, packet_bytes)
        ]
    snr_db, error_rate = np.array(points).T
    steps_db = np.linspace(_LEAST_DB, _MOST_DB, 1 + round((_MOST_DB - _LEAST_DB) / _STEP_DB))
    with np.errstate(divide="ignore"):
        log: Array = np.log1p(-np.interp(steps_db.round(3), snr_db, error_rate)) / packet_bytes
    return log
