"""The scenario pack against a box: its table and its number."""

import csv
from pathlib import Path

import pytest

from onboard.errors import UserError
from sim_rig.reporting.verdict import Outcome
from sim_rig.studies.score import score
from sim_rig.studies.score.score import ScoredScenario, score_scenarios, sentence


def row(outcome: str) -> ScoredScenario:
    return ScoredScenario("fig4", outcome, 1, "")


def test_the_number_is_the_share_that_passed_with_its_interval() -> None:
    rows = [row("passed")] * 9 + [row("failed"), row("invalid"), row("left out")]

    assert sentence(rows) == (
        "score 0.90 (95 % interval 0.60 to 0.98): 9 of 10 passed; 1 invalid, 1 left out"
    )


def test_without_a_judged_scenario_there_is_no_number() -> None:
    with pytest.raises(UserError, match="no scenario could be judged"):
        sentence([row("invalid"), row("left out")])


def test_a_box_is_left_out_of_scenarios_without_its_plate(tmp_path: Path) -> None:
    box = tmp_path / "red.yaml"
    box.write_text(
        "plate: NOBODY1\nbus: {port: 31001}\ncamera: {port: 31002}\nkeys: keys\n"
        "radio: {port: 31003, box_port: 31004}\n"
    )
    with pytest.raises(UserError, match="no scenario could be judged"):
        score_scenarios(box, ["fig4"], tmp_path)

    with (tmp_path / "score.csv").open() as file:
        (left_out,) = csv.DictReader(file)
    assert (left_out["outcome"], left_out["why"]) == ("left out", "no car has the plate NOBODY1")


def test_an_interrupted_score_keeps_what_was_judged_and_says_first_how_much_there_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def judged(name: str, *_: object) -> ScoredScenario:
        if name == "chain":
            raise KeyboardInterrupt
        return row("passed")

    monkeypatch.setattr(score, "_row", judged)
    with pytest.raises(KeyboardInterrupt):
        score_scenarios(None, ["fig4", "chain"], tmp_path)

    with (tmp_path / "score.csv").open() as file:
        assert [each["scenario"] for each in csv.DictReader(file)] == ["fig4"]
    assert capsys.readouterr().out.startswith("2 scenarios, at most ")


@pytest.mark.long
def test_this_build_is_scored_in_virtual_time(tmp_path: Path) -> None:
    outcome = score_scenarios(None, ["standing-car", "stop-at-line"], tmp_path)

    assert outcome is Outcome.PASSED
    assert (tmp_path / "stop-at-line" / "rig.jsonl").exists()
