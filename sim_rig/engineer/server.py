"""Serves the engineer's page of a run on 127.0.0.1, as a process of its own.

It follows the cars' traces and the camera streams. It reads the rig's own records from standard
input and prints its port.

    python -m sim_rig.engineer.server SCENARIO FOLDER CAMERA_PORT
"""

import asyncio
import contextlib
import json
import sys
import time
from pathlib import Path

import aiohttp
from aiohttp import web

from onboard.hmi.access_check import AccessCheck
from onboard.hmi.page_files import Handler, add_page, read_page, with_headers
from onboard.trace.trace_line import as_json
from onboard.vision.mjpeg import MjpegParts
from sim_rig.engineer.image_store import ImageStore
from sim_rig.engineer.run_view import RunView
from sim_rig.run_log.latency_ledger import ledger
from sim_rig.run_log.trace_reader import TraceReader
from sim_rig.scenario.car_config import names_by_id
from sim_rig.scenario.schema import Scenario, load_scenario

MAX_IMAGE_BYTES = 256 * 2**20
"""About three minutes of four cameras."""
READ_S = 0.2
LEDGER_S = 1.0
MAX_ENTRIES = 5000
"""Limit of one response; the page requests the rest."""


class EngineerServer:
    """Serves the page and its data."""

    def __init__(self, scenario: Scenario, folder: Path, camera_port: int) -> None:
        """Serve one run.

        Args:
            scenario: the scenario of the run.
            folder: folder of the traces.
            camera_port: port of the camera server.
        """
        self._scenario = scenario
        self._camera_port = camera_port
        now_utc_s = time.time()
        names = names_by_id(scenario, now_utc_s - 60.0, now_utc_s + scenario.duration_s + 60.0)
        self.run_view = RunView(names)
        self.images = ImageStore(MAX_IMAGE_BYTES)
        self._traces = {car: TraceReader(folder / f"{car}.jsonl") for car in scenario.equipped}
        self._access_check = AccessCheck(None)
        self._ledger: list[dict[str, object]] = []
        self._ledger_at = 0.0
        self._tasks: list[asyncio.Task[None]] = []

    async def start(self) -> int:
        """Listen, and return the port."""
        app = web.Application(middlewares=[self._guard])
        app.router.add_get("/run", self._run)
        app.router.add_get("/entries", self._entries)
        app.router.add_get("/ledger", self._get_ledger)
        app.router.add_get("/pictures/{car}", self._image)
        drivers = read_page("onboard.hmi")
        fonts = {name: drivers[name] for name in drivers if name.startswith("fonts/")}
        add_page(app, read_page("sim_rig.engineer") | fonts)
        self._runner = web.AppRunner(app, access_log=None, shutdown_timeout=0.2)
        await self._runner.setup()
        await web.TCPSite(self._runner, "127.0.0.1", 0).start()
        self._tasks = [
            asyncio.create_task(self._follow_camera(car)) for car in self._scenario.equipped
        ]
        self._tasks.append(asyncio.create_task(self._read()))
        return int(self._runner.addresses[0][1])

    async def close(self) -> None:
        """Stop serving."""
        for task in self._tasks:
            task.cancel()
        await self._runner.cleanup()

    @web.middleware
    async def _guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        origin = request.headers.get("Origin")
        if self._access_check.refusal(request.host, origin, None, None) is not None:
            return web.Response(status=403, text="this host name or origin is not allowed\n")
        return await with_headers(request, handler)

    async def _run(self, _request: web.Request) -> web.Response:
        cars = [
            {
                "name": name,
                "identity": car.identity,
                "colour": car.colour,
                "page": self.run_view.pages.get(name),
            }
            for name, car in self._scenario.cars.items()
            if car.equipped
        ]
        return web.json_response(
            {"title": self._scenario.title, "duration_s": self._scenario.duration_s, "cars": cars}
        )

    async def _entries(self, request: web.Request) -> web.Response:
        """Return `MAX_ENTRIES` entries at most from number `from` on, and if there are more."""
        try:
            first = max(int(request.query.get("from", "0")), 0)
        except ValueError:
            raise web.HTTPBadRequest(text="from: a number\n") from None
        entries = self.run_view.entries[first : first + MAX_ENTRIES]
        return web.json_response(
            {
                "start_s": self.run_view.start_s,
                "now_s": time.monotonic(),
                "next": first + len(entries),
                "more": first + len(entries) < len(self.run_view.entries),
                "entries": entries,
            },
            dumps=as_json,
        )

    async def _get_ledger(self, _request: web.Request) -> web.Response:
        if time.monotonic() - self._ledger_at > LEDGER_S:
            self._ledger = [
                {"hop": line.hop, "n": line.n, "p50_s": line.p50_s, "p99_s": line.p99_s}
                for line in ledger(self.run_view.log())
            ]
            self._ledger_at = time.monotonic()
        return web.json_response(self._ledger)

    async def _image(self, request: web.Request) -> web.Response:
        """Return the image of a car at the stamp `at_s`."""
        try:
            at_s = float(request.query["at_s"])
        except (KeyError, ValueError):
            raise web.HTTPBadRequest(text="at_s: a stamp\n") from None
        found = self.images.at(request.match_info["car"], at_s)
        if found is None:
            raise web.HTTPNotFound
        stamp_s, jpeg = found
        return web.Response(
            body=jpeg, headers={"Content-Type": "image/jpeg", "X-Stamp": str(stamp_s)}
        )

    async def _read(self) -> None:
        while True:
            for car, trace in self._traces.items():
                for record in trace.records():
                    self.run_view.receive_record(car, record)
            await asyncio.sleep(READ_S)

    async def _follow_camera(self, car: str) -> None:
        """Store the images of a car until its camera stream ends."""
        address = f"http://127.0.0.1:{self._camera_port}/{car}/copy"
        with contextlib.suppress(aiohttp.ClientError):
            async with (
                aiohttp.ClientSession(timeout=aiohttp.ClientTimeout(total=None)) as session,
                session.get(address) as stream,
            ):
                parts = MjpegParts(b"picture")
                async for data in stream.content.iter_any():
                    parts.receive_bytes(data)
                    while (jpeg := parts.next_body()) is not None:
                        self.images.add(car, time.monotonic(), jpeg)


async def serve(scenario: Scenario, folder: Path, camera_port: int) -> None:
    """Serve until standard input ends.

    Args:
        scenario: the scenario that runs.
        folder: folder of the run.
        camera_port: TCP port of the rig's camera server.
    """
    server = EngineerServer(scenario, folder, camera_port)
    print(await server.start(), flush=True)  # noqa: T201 (read by `EngineerPage`)
    try:
        while line := await asyncio.to_thread(sys.stdin.readline):
            server.run_view.receive_rig(json.loads(line))
    finally:
        await server.close()


def main() -> None:
    """Run as a process; see the docstring of this module."""
    scenario, folder, camera_port = sys.argv[1:]
    asyncio.run(serve(load_scenario(scenario), Path(folder), int(camera_port)))


if __name__ == "__main__":
    main()
