"""Serves the engineer's page of a run on 127.0.0.1, as a process of its own.

It reads the cars' traces as they are written and the cameras' pictures as the cars get them. On its
standard input come the rig's own records, on its standard output goes the port.

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
from sim_rig.run_log.run_log import Record
from sim_rig.scenario.car_config import names_by_id
from sim_rig.scenario.schema import Scenario, load_scenario

MOST_PICTURE_BYTES = 256 * 2**20
"""Some three minutes of four cameras."""
READ_S = 0.2
LEDGER_S = 1.0
MOST_ENTRIES = 5000
"""In one answer; the page asks again."""


class TraceReader:
    """The lines that have been added to a trace since it was last read."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._read = 0

    def records(self) -> list[Record]:
        """The new ones; a line that is not yet whole is left for the next time."""
        if not self._path.exists():
            return []
        with self._path.open("rb") as trace:
            trace.seek(self._read)
            data = trace.read()
        whole = data[: data.rfind(b"\n") + 1]
        self._read += len(whole)
        return [json.loads(line) for line in whole.splitlines()]


class EngineerServer:
    """The page and what it asks for."""

    def __init__(self, scenario: Scenario, folder: Path, camera_port: int) -> None:
        self._scenario = scenario
        self._camera_port = camera_port
        now_utc_s = time.time()
        names = names_by_id(scenario, now_utc_s - 60.0, now_utc_s + scenario.duration_s + 60.0)
        self.story = RunView(names)
        self.album = ImageStore(MOST_PICTURE_BYTES)
        self._traces = {car: TraceReader(folder / f"{car}.jsonl") for car in scenario.equipped}
        self._door = AccessCheck(None)
        self._ledger: list[dict[str, object]] = []
        self._ledger_at = 0.0
        self._tasks: list[asyncio.Task[None]] = []

    async def start(self) -> int:
        """Listen, and return the port."""
        app = web.Application(middlewares=[self._guard])
        app.router.add_get("/run", self._run)
        app.router.add_get("/entries", self._entries)
        app.router.add_get("/ledger", self._tell_ledger)
        app.router.add_get("/pictures/{car}", self._picture)
        drivers = read_page("onboard.hmi")
        fonts = {name: drivers[name] for name in drivers if name.startswith("fonts/")}
        add_page(app, read_page("sim_rig.engineer") | fonts)
        self._runner = web.AppRunner(app, access_log=None, shutdown_timeout=0.2)
        await self._runner.setup()
        await web.TCPSite(self._runner, "127.0.0.1", 0).start()
        self._tasks = [asyncio.create_task(self._look(car)) for car in self._scenario.equipped]
        self._tasks.append(asyncio.create_task(self._read()))
        return int(self._runner.addresses[0][1])

    async def close(self) -> None:
        """End."""
        for task in self._tasks:
            task.cancel()
        await self._runner.cleanup()

    @web.middleware
    async def _guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        origin = request.headers.get("Origin")
        if self._door.refusal(request.host, origin, None, None) is not None:
            return web.Response(status=403, text="not under that name\n")
        return await with_headers(request, handler)

    async def _run(self, _request: web.Request) -> web.Response:
        cars = [
            {
                "name": name,
                "identity": car.identity,
                "colour": car.colour,
                "page": self.story.pages.get(name),
            }
            for name, car in self._scenario.cars.items()
            if car.equipped
        ]
        return web.json_response(
            {"title": self._scenario.title, "duration_s": self._scenario.duration_s, "cars": cars}
        )

    async def _entries(self, request: web.Request) -> web.Response:
        """What is new since the entry number `from`."""
        try:
            first = max(int(request.query.get("from", "0")), 0)
        except ValueError:
            raise web.HTTPBadRequest(text="from: a number\n") from None
        entries = self.story.entries[first : first + MOST_ENTRIES]
        return web.json_response(
            {
                "start_s": self.story.start_s,
                "now_s": time.monotonic(),
                "next": first + len(entries),
                "entries": entries,
            },
            dumps=as_json,
        )

    async def _tell_ledger(self, _request: web.Request) -> web.Response:
        if time.monotonic() - self._ledger_at > LEDGER_S:
            self._ledger = [
                {"hop": line.hop, "n": line.n, "p50_s": line.p50_s, "p99_s": line.p99_s}
                for line in ledger(self.story.log())
            ]
            self._ledger_at = time.monotonic()
        return web.json_response(self._ledger)

    async def _picture(self, request: web.Request) -> web.Response:
        """The picture of a car at the stamp `at_s`."""
        try:
            at_s = float(request.query["at_s"])
        except (KeyError, ValueError):
            raise web.HTTPBadRequest(text="at_s: a stamp\n") from None
        found = self.album.at(request.match_info["car"], at_s)
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
                    self.story.receive(car, record)
            await asyncio.sleep(READ_S)

    async def _look(self, car: str) -> None:
        """Over the shoulder of a car, until its camera ends."""
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
                        self.album.add(car, time.monotonic(), jpeg)


async def serve(scenario: Scenario, folder: Path, camera_port: int) -> None:
    """Serve until standard input ends."""
    server = EngineerServer(scenario, folder, camera_port)
    print(await server.start(), flush=True)  # noqa: T201 (the answer to who started us)
    try:
        while line := await asyncio.to_thread(sys.stdin.readline):
            server.story.receive_rig(json.loads(line))
    finally:
        await server.close()


def main() -> None:
    """Run as a process; see the head of this file."""
    scenario, folder, camera_port = sys.argv[1:]
    asyncio.run(serve(load_scenario(scenario), Path(folder), int(camera_port)))


if __name__ == "__main__":
    main()
