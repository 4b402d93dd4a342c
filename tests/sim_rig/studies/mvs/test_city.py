"""The paper's city as cars can drive it: what its tables rest on."""

from pathlib import Path

import numpy as np
import pytest

from sim_rig.roads.drivability import drivability
from sim_rig.roads.recording import STEP_S
from sim_rig.studies.mvs.scenes import SceneName, open_scene


@pytest.mark.long
def test_the_city_s_cars_overlap_nowhere_and_move_at_the_speeds_that_they_show(
    rig_data: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """15 pairs overlapped; in corners some moved at 5 m/s less than their buses said."""
    monkeypatch.setenv("RIG_DATA", str(rig_data))
    city = open_scene.__wrapped__(SceneName.CITY).recording

    assert drivability(city).can_be_driven
    for drive in city.drives:
        moved_m_s = np.hypot(*np.diff(drive.middle_m, axis=0).T) / STEP_S
        shown_m_s = (drive.speed_m_s[1:] + drive.speed_m_s[:-1]) / 2.0
        assert np.abs(moved_m_s - shown_m_s).max() < 0.1
