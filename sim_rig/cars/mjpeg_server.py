"""Images of cameras as MJPEG over HTTP: `http://HOST:PORT/CAR`.

`/CAR/copy` repeats the images that the daemon gets, without making them again. `/CAR/screen` is a
page that shows them on a monitor, for a real camera in front of it.
"""

import asyncio
import contextlib
import math
import time
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from aiohttp import web

from onboard.hmi.feed import Feed

_BOUNDARY = "picture"
STREAM_TYPE = f"multipart/x-mixed-replace; boundary={_BOUNDARY}"
_SCREEN = Path(__file__).with_name("screen.html")


class MjpegServer:
    """Serves one camera for each car."""

    def __init__(
        self,
        jpegs: Mapping[str, Callable[[float], bytes]],
        fps: float,
        on_sent: Callable[[str, float], None] = lambda _car, _late_s: None,
        lens_widths: float | None = None,
    ) -> None:
        """Prepare the cameras.

        Args:
            jpegs: by car: returns its image at a `now`; called in one other thread.
            fps: rate of the images.
            on_sent: called after each image with its car and its lateness, s.
            lens_widths: focal length in widths of an image; there is no screen without it.
        """
        self._jpegs = jpegs
        self._interval_s = 1 / fps
        self._on_sent = on_sent
        self._lens_widths = lens_widths
        self._taken: dict[str, Feed[bytes]] = {car: Feed() for car in jpegs}
        self._painter = ThreadPoolExecutor(max_workers=1)

    async def start(self, addresses: Iterable[tuple[str, int]]) -> int:
        """Listen at `addresses`, host and port (0: any), and return the port of the first."""
        app = web.Application()
        app.router.add_get("/{car}", self._stream)
        app.router.add_get("/{car}/copy", self._copy)
        if self._lens_widths is not None:
            app.router.add_get("/{car}/screen", self._screen)
        self._runner = web.AppRunner(app, access_log=None, shutdown_timeout=0.2)
        await self._runner.setup()
        for host, port in addresses:
            await web.TCPSite(self._runner, host, port).start()
        return int(self._runner.addresses[0][1])

    async def close(self) -> None:
        """End all streams."""
        await self._runner.cleanup()
        self._painter.shutdown(cancel_futures=True)

    async def _stream(self, request: web.Request) -> web.StreamResponse:
        car, response = await self._answer(request)
        turn = list(self._jpegs).index(car) / len(self._jpegs)
        next_at = turn_after(time.monotonic(), turn, self._interval_s)
        loop = asyncio.get_running_loop()
        while not (request.transport is None or request.transport.is_closing()):
            await asyncio.sleep(next_at - time.monotonic())
            now = time.monotonic()
            jpeg = await loop.run_in_executor(self._painter, self._jpegs[car], now)
            self._taken[car].publish(jpeg)
            try:
                await response.write(part(jpeg))
            except ConnectionError:
                break
            self._on_sent(car, time.monotonic() - next_at)
            now = max(time.monotonic(), next_at + self._interval_s / 2)
            next_at = turn_after(now, turn, self._interval_s)
        return response

    async def _copy(self, request: web.Request) -> web.StreamResponse:
        car, response = await self._answer(request)
        number, taken = self._taken[car].number, self._taken[car]
        with contextlib.suppress(ConnectionError):
            while True:
                number, jpeg = await taken.after(number)
                await response.write(part(jpeg))
        return response

    async def _screen(self, request: web.Request) -> web.Response:
        """Tell where a lens sees the monitor's picture as the camera sees the road."""
        page = _SCREEN.read_text("utf-8").replace("DISTANCE", f"{self._lens_widths:.2f}")
        page = page.replace("CAR", self._car(request))
        return web.Response(text=page, content_type="text/html")

    def _car(self, request: web.Request) -> str:
        car = request.match_info["car"]
        if car not in self._jpegs:
            raise web.HTTPNotFound
        return car

    async def _answer(self, request: web.Request) -> tuple[str, web.StreamResponse]:
        car = self._car(request)
        response = web.StreamResponse(headers={"Content-Type": STREAM_TYPE})
        await response.prepare(request)
        return car, response


def turn_after(now: float, turn: float, interval_s: float) -> float:
    """When a camera's next image is due.

    Cameras are staggered over an interval to spread the load, also after one was late.

    Args:
        now: the present.
        turn: when in the interval its images are due, from 0 to 1.
        interval_s: between two images of one camera.
    """
    return (math.floor(now / interval_s - turn) + 1 + turn) * interval_s


def part(jpeg: bytes) -> bytes:
    """Return an image as part of a stream."""
    head = f"--{_BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}\r\n\r\n"
    return head.encode() + jpeg + b"\r\n"
