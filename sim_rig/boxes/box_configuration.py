"""What differs between a box and a process of the same car: build and configuration."""

from collections.abc import Iterator, Mapping
from typing import Any

from onboard.recorder.build import present_build
from onboard.recorder.header import RecordingHeader
from onboard.replay.drive_header import OF_THE_CORES
from onboard.settings import SettingsError, parse_settings
from onboard.vehicle.config import CarConfig
from sim_rig.scenario.car_config import car_config
from sim_rig.scenario.schema import Scenario

_OF_THE_BOX = (
    "car.plate",
    "security.keys_folder",
    "obd.broadcast.dbc",
    "brake_request",
    "access.driver_file",
)
"""Settings that the header of a recording has not, or with other values on purpose."""


def differences(header: RecordingHeader, scenario: Scenario, car: str) -> Iterator[str]:
    """Yield a sentence for another build, and one for the settings that differ.

    Args:
        header: of the recording of a box.
        scenario: the scenario of the run.
        car: name of the box.
    """
    if header.software != present_build().name:
        yield f"its onboard is {header.software}, the rig's {present_build().name}"
    try:
        box = parse_settings(header.config, CarConfig, "its configuration")
    except SettingsError as error:
        yield f"this version cannot read its configuration: {error}"
        return
    process = parse_settings(car_config(scenario, car, seed=0), CarConfig, car)
    own, rig = _settings(box), _settings(process)
    other = [
        f"{name} {own.get(name)} ({rig.get(name)})"
        for name in sorted(own.keys() | rig.keys())
        if own.get(name) != rig.get(name) and not name.startswith(_OF_THE_BOX)
    ]
    if other:
        yield f"its configuration (and a process's): {', '.join(other)}"


def _settings(config: CarConfig) -> dict[str, Any]:
    tree = config.model_dump(mode="json", include=set(OF_THE_CORES))
    return dict(_flat(tree, ""))


def _flat(tree: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    for key, value in tree.items():
        if isinstance(value, dict) and value:
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value
