"""The eavesdropper that links pseudonyms across a change."""

from pathlib import Path

import numpy as np
import pytest

from sim_rig.studies.attacks.linker_study import (
    STUDY,
    LinkerSettings,
    count_linked,
    motion_cost,
    phase_cost,
)
from sim_rig.studies.campaigns.campaign import Workers
from sim_rig.studies.mvs.scenes import SceneName


def test_vehicles_that_go_on_as_before_are_linked_and_those_that_swap_places_are_not() -> None:
    before = np.array([[0.0, 0.0, 10.0, 0.0], [0.0, 4.0, 20.0, 0.0]])
    after = before + np.array([[10.0, 0.0, 0.0, 0.0], [20.0, 0.0, 0.0, 0.0]])
    elapsed_s = np.ones((2, 2))
    assert count_linked(motion_cost(before, after, elapsed_s)) == 2
    assert count_linked(motion_cost(before, after[::-1], elapsed_s)) == 0


def test_a_phase_is_the_same_after_any_number_of_intervals() -> None:
    sent_s = np.array([0.01, 0.05, 0.09])
    assert phase_cost(sent_s, sent_s + 0.7).diagonal().max() < 1e-9
    assert count_linked(phase_cost(sent_s, sent_s + 0.702)) == 3


@pytest.mark.long
def test_silence_makes_linking_harder_and_a_phase_drawn_anew_tells_nothing(tmp_path: Path) -> None:
    settings = LinkerSettings(scene=SceneName.OWN_CROSSING, changes=3, silences_s=(0.0, 10.0))
    STUDY.write(tmp_path, settings, Workers())
    lines = [line.split(",") for line in (tmp_path / "table.csv").read_text().splitlines()]
    column = {name: at for at, name in enumerate(lines[0])}
    shares = {
        (line[column["linker"]], line[column["silence_s"]]): float(line[column["share"]])
        for line in lines[1:]
        if len(line) == len(lines[0])
    }
    assert shares["motion", "0"] > 0.9 > shares["motion", "10"]
    assert shares["phase", "0"] < 0.1
