"""The rig's cameras over HTTP, seen through the car's own frame source."""

import asyncio
import subprocess
import sys
from itertools import islice
from pathlib import Path

import aiohttp
import numpy as np
import pytest

from onboard.vision.camera import open_frames
from onboard.vision.frames import Image
from onboard.vision.settings import CameraSettings
from sim_rig.cars.camera_server import Camera, CameraServer
from sim_rig.cars.camera_view import LENS
from sim_rig.cars.mjpeg_server import turn_after
from sim_rig.roads.breakpoints import BreakpointRoad
from sim_rig.scenario.schema import Scenario, load_scenario


@pytest.fixture(scope="module")
def scenario_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("cameras") / "scenario.yaml"
    path.write_text(
        """
title: A car follows another, and its camera fails in two ways.
seed: 1
duration_s: 10
radio: {reach_m: 100}
cars:
  ann: {plate: AN123KB, lane: 1, start_m: 20, speed_m_s: 15}
  ben: {plate: BN456HX, lane: 1, start_m: 0, speed_m_s: 15}
faults:
  - {what: camera_frozen, car: ben, from_s: 1, until_s: 2}
  - {what: camera_dark, car: ben, from_s: 3, until_s: 4}
expect: []
"""
    )
    return path


@pytest.fixture(scope="module")
def scenario(scenario_file: Path) -> Scenario:
    return load_scenario(str(scenario_file))


def test_a_frozen_camera_repeats_its_last_image_and_a_dark_one_is_black(
    scenario: Scenario,
) -> None:
    camera = Camera(scenario, BreakpointRoad(scenario), "ben", np.random.SeedSequence(1))

    before, frozen, still, after = (camera.jpeg(at_s) for at_s in (0.9, 1.0, 1.9, 2.0))
    assert before == frozen == still != after
    assert len(camera.jpeg(3.5)) < len(after) / 4


def test_the_same_seed_gives_the_same_images(scenario: Scenario) -> None:
    def pictures(seed: int) -> list[bytes]:
        camera = Camera(scenario, BreakpointRoad(scenario), "ben", np.random.SeedSequence(seed))
        return [camera.jpeg(at_s) for at_s in (0.0, 0.1)]

    assert pictures(1) == pictures(1) != pictures(2)


def test_the_car_reads_the_stream_at_its_rate_and_size(scenario: Scenario) -> None:
    def watch(port: int) -> list[Image]:
        source = f"http://127.0.0.1:{port}/ben"
        frames = open_frames(CameraSettings(source=source, **LENS.model_dump()))
        try:
            return [frame.image for frame in islice(frames, 3)]
        finally:
            frames.close()

    async def serve() -> list[Image]:
        server = CameraServer(scenario, seed=1)
        port = await server.start()
        try:
            return await asyncio.to_thread(watch, port)
        finally:
            await server.close()

    images = asyncio.run(serve())
    assert [image.shape for image in images] == [(LENS.height_px, LENS.width_px, 3)] * 3
    assert not np.array_equal(images[0], images[1])


@pytest.mark.parametrize("late_s", [0.0, 0.07, 0.13, 1.04])
def test_cameras_keep_their_turns_however_late_one_was(late_s: float) -> None:
    """Of four at 10 Hz, each has its quarter of 0.1 s; pictures that were missed are left out."""
    due = [turn_after(56.02 + late_s, turn, 0.1) for turn in (0.0, 0.25, 0.5, 0.75)]
    assert all(0.0 < at - (56.02 + late_s) <= 0.1 for at in due)
    assert [at % 0.1 for at in due] == pytest.approx([0.1, 0.025, 0.05, 0.075])


def test_a_car_that_is_not_there_is_not_found(scenario: Scenario) -> None:
    async def ask() -> int:
        server = CameraServer(scenario, seed=1)
        port = await server.start()
        try:
            async with (
                aiohttp.ClientSession() as session,
                session.get(f"http://127.0.0.1:{port}/eve") as answer,
            ):
                return answer.status
        finally:
            await server.close()

    assert asyncio.run(ask()) == 404


def test_the_process_prints_its_port_and_ends_with_its_input(scenario_file: Path) -> None:
    run = subprocess.run(
        [sys.executable, "-m", "sim_rig.cars.camera_server", str(scenario_file), "1"],
        input="12.5\n",
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )

    assert 1024 < int(run.stdout) < 65536
