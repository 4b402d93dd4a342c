"""Records the drives in this folder anew: `make drives`, after a change of the cores that is meant.

All but one are driven in virtual time. `live` is one car of real daemons, with a camera that sees
pictures, and signed messages.
"""

import asyncio
import shutil
import tempfile
from pathlib import Path

from sim_rig.runs.live import LiveTestbench
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import load_scenario

HERE = Path(__file__).parent
VIRTUAL = {
    "warned": ("fig4", "red", 17.0),
    "ecu-stopped": ("stopped-ecu", "red", 24.0),
    "plate-misread": ("misread-plate", "blue", 21.0),
    "lossy-radio": ("packet-loss", "car5", 12.0),
}
"""By name: scenario, car, and after how many seconds it ends."""
LIVE = ("ar-tags", "red", 13.0)


def record_all() -> None:
    """Write every drive over the old one."""
    for name, (scenario, car, until_s) in VIRTUAL.items():
        story = load_scenario(scenario).model_copy(update={"duration_s": until_s})
        with tempfile.TemporaryDirectory() as folder:
            run_virtual(story, recordings_folder=Path(folder))
            _take(Path(folder) / car, name)
    scenario, car, until_s = LIVE
    story = load_scenario(scenario).model_copy(update={"duration_s": until_s})
    with tempfile.TemporaryDirectory() as folder:
        asyncio.run(_drive(LiveTestbench(story, story.seed, Path(folder))))
        _take(Path(folder) / "box" / car, "live")


async def _drive(desk: LiveTestbench) -> None:
    async with desk:
        await desk.run()


def _take(box: Path, name: str) -> None:
    (segment,) = box.glob("*.mcap")
    shutil.copyfile(segment, HERE / f"{name}.mcap")


if __name__ == "__main__":
    record_all()
