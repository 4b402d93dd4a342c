"""Daemons of a live run, before they start."""

from pathlib import Path

from sim_rig.processes.processes import Processes
from sim_rig.runs.daemons import Daemons
from sim_rig.scenario.schema import load_scenario


def test_no_port_is_given_twice(tmp_path: Path) -> None:
    """Nothing binds them at once, so the system alone gives some of these 1,800 again."""
    daemons = Daemons(load_scenario("fig4"), 1, tmp_path, Processes(tmp_path))
    wires = [daemons.wires(camera_port=1).model_dump() for _ in range(300)]
    ports = [
        port
        for car in wires
        for name, wire in car.items()
        if wire is not None and name != "camera"
        for port in (wire.get("port"), wire.get("box_port"))
        if port is not None
    ]

    assert len(set(ports)) == len(ports) == 1800
