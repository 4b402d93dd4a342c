"""`sim-rig doctor`: whether a box hears and is heard on each of its wires, before a run."""

from pathlib import Path

import typer

from onboard.settings import load_settings
from onboard.tools.doctor.computer import examine_program
from onboard.tools.doctor.finding import Finding
from sim_rig.boxes.contact import BoxNotReadyError
from sim_rig.boxes.doctor import doctor_scenario, findings_of_drive
from sim_rig.boxes.settings import BoxSettings, load_boxes
from sim_rig.runs.live import LiveTestbench
from sim_rig.runs.terminated import run_until_terminated


def examine_box(file: Path, out: Path) -> list[Finding]:
    """Drive a short scenario with a box.

    Args:
        file: of the box; its name without `.yaml` is the car's.
        out: folder of the run's folder.

    Returns:
        the rig's build; a finding for each wire; if the box uses all of them, what the drive shows.

    Raises:
        UserError: the file has mistakes, or the rig cannot run.
    """
    car = file.stem
    scenario = doctor_scenario(car, load_settings(file, BoxSettings))
    boxes = load_boxes([f"{car}={file}"], scenario)
    typer.echo(
        f"{car} has {boxes[car].ready_within_s:g} s to use all wires; then it follows another car"
        f" for {scenario.duration_s:g} s."
    )
    prepared = LiveTestbench(
        scenario, scenario.seed, out / f"doctor-{car}", boxes, virtual_others=True
    )

    async def drive() -> bool:
        async with prepared as testbench:
            try:
                await testbench.run()
            except BoxNotReadyError:
                return False
        return True

    is_ready = run_until_terminated(drive())
    wires = [examine_program(), *prepared.contact(car).findings(car, boxes[car], scenario)]
    return [*wires, *findings_of_drive(car, prepared.log())] if is_ready else wires
