"""The configuration of the installed box that is a rung of the ladder."""

from pathlib import Path

import pytest

from deploy.vm import qemu_ladder
from deploy.vm.ladder import car_yaml, wires
from onboard.settings import parse_settings
from onboard.vehicle.config import CarConfig
from onboard.wave_udp.settings import IwcuSettings
from sim_rig.boxes.settings import BoxSettings
from sim_rig.scenario.schema import load_scenario


@pytest.mark.parametrize("scenario", ["fig4", "ar-tags", "red-light", "radar"])
def test_box_and_rig_have_the_two_ends_of_the_same_wires(scenario: str) -> None:
    loaded = load_scenario(scenario)
    car = loaded.equipped[0]

    rig = parse_settings(wires(loaded, car, "1"), BoxSettings, "rig")
    box = parse_settings(car_yaml(loaded, car), CarConfig, "box")

    assert box.car.plate == rig.plate == loaded.cars[car].identity
    assert box.can is not None
    assert (box.can.channel, box.can.port) == (rig.bus.channel, rig.bus.port)
    assert box.camera is not None
    assert box.camera.source == f"http://{rig.camera.host}:{rig.camera.port}/{car}"
    assert isinstance(box.radio, IwcuSettings)
    radio = box.radio
    assert (radio.unit_host, radio.unit_port) == (rig.radio.host, rig.radio.port)
    assert (radio.listen_host, radio.listen_port) == (rig.radio.box_host, rig.radio.box_port)
    assert (box.gnss is not None) == (loaded.gnss is not None)
    assert (box.detector is not None) == (loaded.detector is not None)
    if box.detector is not None and rig.detector is not None:
        listens = box.detector.host, box.detector.port
        assert listens == (str(rig.detector.host), rig.detector.port)


def test_the_box_in_qemu_has_slcand_s_bus_and_the_rig_its_serial_line() -> None:
    loaded = load_scenario("fig4")
    tree = qemu_ladder.wires(loaded, "red", Path("/dev/pts/7"))

    rig = parse_settings(tree, BoxSettings, "rig")
    box = parse_settings(qemu_ladder.car_in_qemu(loaded, "red"), CarConfig, "box")

    assert (rig.bus.interface, rig.bus.serial) == ("slcan", Path("/dev/pts/7"))
    assert box.can is not None
    assert (box.can.interface, box.can.channel) == ("socketcan", "can0")
    assert f"/dev/ttyS1 {box.can.channel}" in qemu_ladder.SLCAN_UNIT
    assert isinstance(box.radio, IwcuSettings)
    assert box.radio.unit_port == rig.radio.port
    assert f"hostfwd=udp:127.0.0.1:{rig.radio.box_port}-:{box.radio.listen_port}" in " ".join(
        qemu_ladder.DEVICES
    )
