"""The cameras of a run, at `http://127.0.0.1:PORT/CAR` (`mjpeg_server.py`).

Runs as a process of its own, so that rendering does not delay the radio. It prints its port, and
then for each image `CAR LATE_S`: how late it left, in s. It reads lines of JSON from standard
input: the start time of the scenario (`scenario_clock.py`), and how cars brake that obey requests
(the arguments of `BreakpointRoad.brake`). For boxes it listens at further addresses.

    python -m sim_rig.cars.camera_server SCENARIO SEED [HOST:PORT...]
"""

import asyncio
import contextlib
import json
import sys
from collections.abc import Callable, Sequence
from functools import partial

import cv2
import numpy as np
import numpy.typing as npt

from onboard.vision.settings import CameraSettings
from sim_rig.cars.camera_view import CameraView, calibration
from sim_rig.cars.mjpeg_server import MjpegServer
from sim_rig.rendering.scene import CameraRenderer
from sim_rig.roads.breakpoints import BreakpointRoad
from sim_rig.scenario.scenario_clock import ScenarioClock
from sim_rig.scenario.schema import Scenario, load_scenario

_JPEG_QUALITY = 90


class Camera:
    """The camera of one car, with its faults."""

    def __init__(
        self, scenario: Scenario, road: BreakpointRoad, car: str, seed: np.random.SeedSequence
    ) -> None:
        """Start without a picture.

        Args:
            scenario: the scenario.
            road: with all cars.
            car: name of the car.
            seed: source of all random numbers.
        """
        self._rng = np.random.default_rng(seed)
        self._view = CameraView(scenario, road, car, self._rng)
        lens = calibration(scenario.lens)
        self._picture = CameraRenderer(CameraSettings(source="rig", **lens.model_dump()))
        self._last: bytes = b""

    def jpeg(self, at_s: float) -> bytes:
        """Return the image of the camera at `at_s`."""
        if self._last and self._view.is_frozen(at_s):
            return self._last
        image = self._picture.draw(self._view.scene(at_s), self._rng)
        if self._view.is_dark(at_s):
            image[:] = 0
        self._last = as_jpeg(image)
        return self._last


class CameraServer:
    """Serves all cameras of a scenario."""

    def __init__(
        self,
        scenario: Scenario,
        seed: int,
        on_sent: Callable[[str, float], None] = lambda _car, _late_s: None,
    ) -> None:
        """Prepare the cameras.

        Args:
            scenario: the scenario.
            seed: seed of all random numbers.
            on_sent: called after each image with its car and its lateness, s.
        """
        self.road = BreakpointRoad(scenario)
        self.clock = ScenarioClock(scenario.run_up_s)
        seeds = np.random.SeedSequence(seed).spawn(len(scenario.equipped))
        cameras = {
            car: partial(self._jpeg, Camera(scenario, self.road, car, seed))
            for car, seed in zip(scenario.equipped, seeds, strict=True)
        }
        lens_widths = scenario.lens.focal_px / scenario.lens.width_px
        self._server = MjpegServer(cameras, scenario.lens.rate_hz, on_sent, lens_widths)

    async def start(self, addresses: Sequence[tuple[str, int]] = ()) -> int:
        """Listen on 127.0.0.1 and at further `addresses`, and return the port of the former."""
        return await self._server.start([("127.0.0.1", 0), *addresses])

    def receive_line(self, line: str) -> None:
        """Take a line of the testbench; see the docstring of this module."""
        match json.loads(line):
            case [car, begin_s, until_s, deceleration_m_s2]:
                self.road.brake(car, begin_s, until_s, deceleration_m_s2)
            case start_s:
                self.clock.start_s = float(start_s)

    async def close(self) -> None:
        """End all streams."""
        await self._server.close()

    def _jpeg(self, camera: Camera, now: float) -> bytes:
        return camera.jpeg(self.clock.at_s(now))


def as_jpeg(image: npt.NDArray[np.uint8]) -> bytes:
    """Encode an image as the rig's cameras do."""
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    return data.tobytes()


async def serve(scenario: Scenario, seed: int, addresses: Sequence[tuple[str, int]]) -> None:
    """Serve until standard input ends."""
    server = CameraServer(scenario, seed, _print)
    _print(await server.start(addresses))
    try:
        while line := await asyncio.to_thread(sys.stdin.readline):
            server.receive_line(line)
    finally:
        await server.close()


def _print(*words: object) -> None:
    """Print a line for the testbench, which may have ended already."""
    with contextlib.suppress(BrokenPipeError):
        print(*words, flush=True)  # noqa: T201 (read by the testbench)


def main() -> None:
    """Run as a process; see the docstring of this module."""
    cv2.setNumThreads(1)
    scenario, seed, *given = sys.argv[1:]
    split = (address.rpartition(":") for address in given)
    addresses = [(host, int(port)) for host, _, port in split]
    asyncio.run(serve(load_scenario(scenario), int(seed), addresses))


if __name__ == "__main__":
    main()
