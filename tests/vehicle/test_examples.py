"""The configurations in `examples/` are valid, and that of the desk shows what it says."""

from pathlib import Path

import pytest

from onboard.observations import HardBrake
from onboard.settings import load_settings
from onboard.tools.replay import RawRecording, replay
from onboard.vehicle.config import CarConfig

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    "example", sorted((ROOT / "examples").glob("*.yaml")), ids=lambda p: p.name
)
def test_an_example_is_a_valid_configuration(example: Path) -> None:
    assert load_settings(example, CarConfig).car.plate


def test_the_car_at_the_desk_brakes_hard_at_10_and_15_seconds() -> None:
    config = load_settings(ROOT / "examples" / "desk.yaml", CarConfig)
    assert config.can is not None
    assert config.can.file is not None

    events = list(replay(RawRecording(ROOT / config.can.file), CarConfig(car=config.car)))

    began_s = [each.stamp_s for each in events if isinstance(each, HardBrake) and not each.is_over]
    assert [round(stamp_s - events[0].stamp_s) for stamp_s in began_s] == [10, 15]
