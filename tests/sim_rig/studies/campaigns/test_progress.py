"""What is said of a study's progress: how many runs, and when they will be done."""

from pathlib import Path

import pytest

from sim_rig.studies.campaigns.campaign import Workers
from sim_rig.studies.campaigns.catalogue import find_study, run_study, study_names
from sim_rig.studies.campaigns.progress import ProgressLines, duration, run_progress


def test_the_first_line_says_how_many_runs_there_are() -> None:
    assert ProgressLines("chain", 18_000, 0, 0.0).first() == "chain: 18000 runs"
    assert ProgressLines("chain", 30, 12, 0.0).first() == "chain: 30 runs, 12 of them stored"


def test_the_time_left_follows_from_the_runs_of_this_campaign_alone() -> None:
    lines = ProgressLines("chain", 100, 60, 1000.0)

    assert lines.receive_run(1001.0) is None
    assert lines.receive_run(1004.0) == "chain: 62 of 100 runs, about 76 s left"


def test_lines_become_ever_rarer() -> None:
    lines = ProgressLines("chain", 10_000, 0, 0.0)
    due_s = [second for second in range(1, 1000) if lines.receive_run(float(second))]

    assert due_s == [3, 6, 12, 24, 48, 96, 192, 384, 768]


def test_the_last_run_needs_no_line() -> None:
    lines = ProgressLines("chain", 1, 0, 0.0)

    assert lines.receive_run(100.0) is None


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.2, "1 s"), (76.0, "76 s"), (600.0, "10 min"), (9000.0, "2.5 h")]
)
def test_a_duration_has_the_unit_in_which_it_is_read(seconds: float, text: str) -> None:
    assert duration(seconds) == text


def test_a_campaign_tells_its_runs_before_the_first_and_a_study_of_one_run_its_duration(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = {"runs": 1, "cars": 2, "shares": 0.0, "sights": "rig", "reaction_medians_s": 1.0}
    run_study("lcca-chain", tmp_path / "chain", None, Workers(), given)
    assert capsys.readouterr().err == "lcca-chain: 1 run\n"

    run_study("rakhshan-figure7", tmp_path / "figure7", None, Workers())
    assert capsys.readouterr().err == "rakhshan-figure7: takes about 2 s\n"


def test_an_interrupted_study_of_one_run_says_that_nothing_is_kept(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(KeyboardInterrupt), run_progress("joerer", 120.0):
        raise KeyboardInterrupt

    assert capsys.readouterr().err.splitlines() == [
        "joerer: takes about 2 min",
        "joerer: interrupted, and nothing of it is stored",
    ]


@pytest.mark.parametrize("name", study_names())
def test_a_study_of_one_run_says_how_long_it_takes(name: str) -> None:
    study = find_study(name)

    assert study.row is not None or study.about_s(study.settings()) >= 1.0
