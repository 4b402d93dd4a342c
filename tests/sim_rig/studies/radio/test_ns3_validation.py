"""`sim-rig study radio`, and what it gives beside ns-3."""

import csv
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from sim_rig.cli import app
from sim_rig.propagation.path_loss import DualSlope, LogDistance, TwoRay
from sim_rig.radio.channel import Channel
from sim_rig.scenario.radio_settings import CsmaSettings
from sim_rig.studies.campaigns.campaign import Workers
from sim_rig.studies.campaigns.study import columns
from sim_rig.studies.radio.radio_study import (
    STUDY,
    DistanceLine,
    RadioSettings,
    parse_fading,
    parse_loss,
    table,
)
from tests.typed import a

SEEDS = 4
"""Few, so that it is quick; `sim-rig study radio` takes more."""


def read(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_models_are_named_with_their_numbers() -> None:
    assert parse_loss("log-distance:2.4") == LogDistance(exponent=2.4)
    assert parse_loss("log-distance:2.4:46.7") == LogDistance(exponent=2.4, reference_db=46.7)
    assert parse_loss("dual-slope:1.9:3.9:80") == DualSlope(
        near_exponent=1.9, far_exponent=3.9, breakpoint_m=80.0
    )
    assert parse_loss("two-ray:2") == TwoRay(antenna_height_m=2.0)
    assert parse_loss("two-ray:1.5:5.15") == TwoRay(antenna_height_m=1.5, frequency_ghz=5.15)
    assert parse_fading("none") is None
    assert parse_fading("rayleigh") == 1.0
    assert parse_fading("nakagami:1.5") == 1.5


def study(*words: str, out: Path) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["study", "radio", *words, "--out", str(out)])
    return result.exit_code, result.output + str(result.exception or "")


def test_one_command_writes_table_figure_and_settings(tmp_path: Path) -> None:
    words = "--cars 10 --spacing-m 60 --loss log-distance:2.75 --fading nakagami:3 --seeds 2"
    code, output = study(*words.split(), "--workers", "1", out=tmp_path)

    assert code == 0, output
    rows = read(tmp_path / "radio" / "table.csv")
    assert list(rows[0]) == columns(DistanceLine, ())
    assert [float(row["dist_lo_m"]) for row in rows] == [50, 100, 150, 200, 300, 350, 400, 450, 500]
    assert 0.95 < float(rows[0]["pdr"]) <= 1.0
    assert float(rows[-1]["pdr"]) == 0.0
    assert rows[-1]["delay_mean_us"] == ""
    assert (tmp_path / "radio" / "figure.png").stat().st_size > 10_000
    assert "nakagami:3" in (tmp_path / "radio" / "settings.yaml").read_text()


@pytest.mark.long
def test_without_receptions_no_delay_is_stated(tmp_path: Path) -> None:
    code, output = study("--cars=2", "--spacing-m=1000", "--seeds=1", "--seconds=1.2", out=tmp_path)

    assert code == 0, output
    assert "nearest 0.0000 delivered; at least half nowhere" in output


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--cars", "1"], "cars: Input should be greater than or equal to 2"),
        (["--cras", "40"], "did you mean cars?"),
        (["--loss", "tree"], "no such path loss 'tree'"),
        (["--loss", "two-ray:1:2:3"], "two-ray takes at most 2 numbers"),
        (["--fading", "rician"], "must be none, rayleigh or nakagami:M"),
        (["--fading", "nakagami:0.1"], "M from 0.5 to 50"),
        (["--fading", "nakagami:nan"], "M from 0.5 to 50"),
        (["--tx-power-dbm", "99"], "tx_power_dbm: Input should be less than or equal to 40"),
        (["--cars", "2", "--seeds", "1", "--warm-s", "5"], "no frame was sent"),
        (["--cars=4", "--cars=5"], "--cars is given twice"),
        (["--cars", "[4"], "--cars: not YAML"),
        (["--seeds"], "settings are given as --name value (given '--seeds'); radio has model, "),
        (["seeds", "3"], "seeds is a setting of radio: write --seeds VALUE"),
    ],
)
def test_an_invalid_setting_is_an_error(tmp_path: Path, words: list[str], message: str) -> None:
    code, output = study(*words, out=tmp_path)

    assert code != 0
    assert message in output


@pytest.mark.long
def test_a_setting_may_be_joined_to_its_name(tmp_path: Path) -> None:
    code, output = study("--cars=3", "--seeds=1", "--seconds=1.2", "--workers", "1", out=tmp_path)

    assert code == 0, output
    assert "\nradio: 3 cars, 1 seeds" in output


def test_what_waits_too_long_is_given_up_and_counts_as_sent() -> None:
    """Two cars with more than the channel takes: ns-3 3.37 delivers 0.630 after 409 ms (4 seeds).

    A frame of 1438 bytes at 3 Mbit/s takes 3.9 ms, and there are 333 of them each second.
    """
    settings = RadioSettings(
        cars=2, spacing_m=1.0, payload_bytes=1400, data_rate_mbit_s=3,
        interval_s=0.004, jitter_s=0.004,
    )  # fmt: skip
    (line,) = table(settings, [STUDY.one(settings, number) for number in range(2)])

    assert line.pdr == pytest.approx(0.630, abs=0.03)
    assert line.delay_mean_us == pytest.approx(409e3, rel=0.15)


@pytest.mark.long
def test_other_settings_may_follow_in_the_same_folder(tmp_path: Path) -> None:
    for cars in (3, 4):
        settings = RadioSettings(cars=cars, seeds=1, seconds=1.5)
        STUDY.write(tmp_path, settings, Workers())
        assert f"cars: {cars}\n" in (tmp_path / "settings.yaml").read_text()


def test_a_run_alone_gives_what_it_gives_among_others() -> None:
    settings = RadioSettings(cars=12, seeds=3, seconds=1.5, fading="rayleigh")

    assert STUDY.one(settings, 2) == [STUDY.one(settings, at) for at in range(3)][2]


@pytest.mark.long
@pytest.mark.realdata
@pytest.mark.parametrize(("cars", "model", "fading"), [
    (40, "three", "none"),
    (40, "threenaka_1m_1", "nakagami:1"),
    (100, "three", "none"),
    (100, "threenaka_1m_1", "nakagami:1"),
])  # fmt: skip
def test_delivery_and_delay_agree_with_ns3(
    rig_data: Path, cars: int, model: str, fading: str
) -> None:
    """Each 50 m bin: delivery within 0.03, mean delay within 15 %."""
    settings = RadioSettings(cars=cars, fading=fading, seed=1)
    rows = [STUDY.one(settings, at) for at in range(SEEDS)]
    ours = {line.dist_lo_m: line for line in table(settings, rows)}

    reference = [
        row
        for row in read(rig_data / "radio" / "pdr-and-delay-by-distance.csv")
        if (int(row["n"]), row["model"]) == (cars, model)
    ]
    assert len(reference) == len(ours)
    for row in reference:
        line = ours[float(row["dist_lo_50m"])]
        assert line.pdr == pytest.approx(float(row["pdr_mean"]), abs=0.03)
        if float(row["pdr_mean"]) > 0.001:  # of a few frames no mean can be compared
            assert line.delay_mean_us == pytest.approx(float(row["delay_mean_us"]), rel=0.15)


@pytest.mark.realdata
@pytest.mark.parametrize(
    ("file", "fading"),
    [("link-dual-slope.csv", "none"), ("link-dual-slope-nakagami-m1.csv", "nakagami:1")],
)
def test_the_link_without_interference_agrees_with_ns3(
    rig_data: Path, file: str, fading: str
) -> None:
    """One car sends, hundred listen: every 10 m, within five standard errors of both."""
    frames = 500
    settings = RadioSettings(cars=101, fading=fading)
    channel = Channel(a(CsmaSettings, settings.channel), 101, np.random.default_rng(3))
    along_m = 10.0 * np.arange(101)
    channel.receive_positions(np.column_stack([along_m, np.zeros(101)]))
    received = np.zeros(101)
    for frame in range(frames):
        channel.receive_frame(0, 250, 5, 0.01 * frame)
        channel.handle_timer(0.01 * frame + 0.005)
        event = channel.next_event()
        assert event is not None
        received[event.receivers] += 1

    text = (rig_data / "radio" / file).read_text()
    rows = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    for row in rows:
        theirs, ours = float(row["pdr"]), received[int(row["dist_lo"]) // 10] / frames
        error = np.sqrt(max(theirs * (1 - theirs), 1 / 2000) * (1 / frames + 1 / 2000))
        assert ours == pytest.approx(theirs, abs=5 * error)
