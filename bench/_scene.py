"""What surrounds a daemon in a benchmark: the camera's images, and ports."""

import asyncio
import itertools
import socket

import cv2
import numpy as np

from onboard.vision.settings import CameraSettings
from sim_rig.cars.camera_view import LENS
from sim_rig.rendering.scene import CameraRenderer, Scene, SceneCar

CAMERA_FPS, IMAGES = 15.0, 60
SPEED_M_S = 15.0


class LoopCamera:
    """Serves images of a car some 15 m ahead, rendered before, in a loop."""

    def __init__(self, plate: str) -> None:
        """Render the images; the lead bears `plate`."""
        renderer = CameraRenderer(CameraSettings(source="bench", **LENS.model_dump()))
        rng = np.random.default_rng(1)
        self._jpegs = []
        for number in range(IMAGES):
            ahead = SceneCar(ahead_m=15.0 + np.sin(2 * np.pi * number / IMAGES), plate=plate)
            scene = Scene(cars=(ahead,), travelled_m=number * SPEED_M_S / CAMERA_FPS)
            self._jpegs.append(cv2.imencode(".jpg", renderer.draw(scene, rng))[1].tobytes())

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve MJPEG over HTTP."""
        await reader.readuntil(b"\r\n\r\n")
        kind = b"multipart/x-mixed-replace; boundary=image"
        writer.write(b"HTTP/1.1 200 OK\r\nContent-Type: " + kind + b"\r\n\r\n")
        for number in itertools.count():
            if writer.is_closing():
                return
            jpeg = self._jpegs[number % IMAGES]
            writer.write(b"--image\r\nContent-Length: %d\r\n\r\n" % len(jpeg) + jpeg + b"\r\n")
            await asyncio.sleep(1 / CAMERA_FPS)


def port_of(server: asyncio.Server) -> int:
    """Return the TCP port at which `server` listens."""
    return int(server.sockets[0].getsockname()[1])


def free_port() -> int:
    """Return a UDP port that nothing listens at."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
