"""802.11p frames: how long they last, and what noise does to them."""

import csv
from pathlib import Path

import numpy as np
import pytest

import sim_rig.radio.ofdm
from sim_rig.radio.ofdm import SurvivalInNoise, airtime_s, from_db, noise_mw, psdu_bytes

TABLES = Path(sim_rig.radio.ofdm.__file__).with_name("error_rates.csv")


def test_a_beacon_of_250_bytes_becomes_288_on_the_air() -> None:
    assert psdu_bytes(250) == 288


@pytest.mark.parametrize(
    ("psdu", "data_rate_mbit_s", "symbol_us", "expected_us"),
    [
        (288, 6, 8, 432.0),  # 40 us of headers, 2,326 bits in 49 symbols of 48 bits
        (288, 6, 4, 428.0),  # ns-3: 97 half symbols
        (288, 3, 8, 816.0),
        (14, 3, 8, 88.0),  # the acknowledgement that EIFS allows for
        (1500, 27, 8, 488.0),
    ],
)
def test_airtime_is_headers_and_whole_symbols(
    psdu: int, data_rate_mbit_s: int, symbol_us: int, expected_us: float
) -> None:
    assert airtime_s(psdu, data_rate_mbit_s, symbol_us) * 1e6 == pytest.approx(expected_us)


def test_noise_in_10_mhz_with_a_figure_of_7_db_is_97_dbm() -> None:
    assert 10.0 * np.log10(noise_mw(7.0)) == pytest.approx(-97.0, abs=0.05)


def survives(data_rate_mbit_s: int, sinr: np.ndarray, duration_s: float) -> np.ndarray:
    log = SurvivalInNoise(data_rate_mbit_s).log_survival(sinr[None], [False], [duration_s])
    return np.asarray(np.exp(log[0]))


@pytest.mark.parametrize("data_rate_mbit_s", [3, 6, 9, 12, 18, 24, 27])
def test_a_frame_of_the_tabled_length_survives_as_tabled(data_rate_mbit_s: int) -> None:
    with TABLES.open() as file:
        rows = [
            row for row in csv.DictReader(file) if int(row["data_rate_mbit_s"]) == data_rate_mbit_s
        ]
    assert {row["packet_bytes"] for row in rows} == {"32", "1458"}
    for row in rows:
        sinr = np.array([from_db(float(row["snr_db"]))])
        duration_s = int(row["packet_bytes"]) * 8 / data_rate_mbit_s * 1e-6
        assert survives(data_rate_mbit_s, sinr, duration_s)[0] == pytest.approx(
            1.0 - float(row["error_rate"]), abs=2e-3
        )


def test_survival_of_two_halves_equals_that_of_the_whole() -> None:
    sinr = np.array([from_db(3.3)])

    whole = survives(6, sinr, 320e-6)

    assert 0.1 < whole[0] < 0.9
    assert survives(6, sinr, 160e-6) ** 2 == pytest.approx(whole)


def test_more_signal_never_survives_less() -> None:
    sinr = 10.0 ** (np.linspace(-30.0, 40.0, 1000) / 10.0)
    for data_rate_mbit_s in (3, 6, 9, 12, 18, 24, 27):
        survive = survives(data_rate_mbit_s, sinr, 400e-6)
        assert np.all(np.diff(survive) >= 0.0)
        assert survive[0] == 0.0
        assert survive[-1] == 1.0


def test_the_plcp_header_is_read_where_the_data_is_not() -> None:
    sinr = np.full((2, 1), from_db(0.5))

    header, data = SurvivalInNoise(6).log_survival(sinr, [True, False], [8e-6, 392e-6])

    assert np.exp(header) > 0.99
    assert np.exp(data) < 0.01


def test_no_signal_at_all_does_not_survive() -> None:
    assert survives(6, np.zeros(1), 1e-4)[0] == 0.0
