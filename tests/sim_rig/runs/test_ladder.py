"""The rungs of a ladder that have boxes."""

from pathlib import Path

import pytest
import yaml

from onboard.settings import SettingsError
from sim_rig.runs.ladder import rungs_of_boxes
from sim_rig.scenario.schema import Scenario, load_scenario

PLATES = {"red": "RD288HX", "blue": "BL635TN"}


@pytest.fixture
def fig4() -> Scenario:
    return load_scenario("fig4")


def written(folder: Path, kind: str, car: str, port: int, plate: str | None = None) -> str:
    """Write the file of a box, with its radio unit at `port`, and return the option for it.

    Ports are below those that the kernel gives to whoever asks for any.
    """
    box = {
        "plate": plate or PLATES[car],
        "bus": {"port": port + 1},
        "camera": {"port": port + 2},
        "radio": {"port": port, "box_port": port + 3},
        "keys": str(folder / "keys"),
        "recording": str(folder / kind / car),
    }
    (folder / kind).mkdir(exist_ok=True)
    file = folder / kind / f"{car}.yaml"
    file.write_text(yaml.safe_dump(box))
    return f"{car}={file}"


def test_each_further_file_of_a_car_is_for_one_more_rung(fig4: Scenario, tmp_path: Path) -> None:
    given = [
        written(tmp_path, "namespaces", "red", 27110),
        written(tmp_path, "systemd", "red", 27120),
        written(tmp_path, "namespaces", "blue", 27130),
    ]

    rungs = rungs_of_boxes(given, fig4)

    ports = {
        rung: {car: box.radio.port for car, box in boxes.items()} for rung, boxes in rungs.items()
    }
    assert ports == {"box": {"red": 27110, "blue": 27130}, "box-2": {"red": 27120}}


def test_without_boxes_there_is_no_such_rung(fig4: Scenario) -> None:
    assert rungs_of_boxes((), fig4) == {}


def test_a_mistake_of_a_later_rung_ends_the_ladder_at_its_foot(
    fig4: Scenario, tmp_path: Path
) -> None:
    given = [
        written(tmp_path, "namespaces", "red", 27110),
        written(tmp_path, "systemd", "red", 27120, plate="YW903MS"),
    ]

    with pytest.raises(SettingsError, match="red: plate: red has RD288HX"):
        rungs_of_boxes(given, fig4)
