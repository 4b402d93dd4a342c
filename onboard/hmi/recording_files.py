"""Serves the segments of the black box, for who has the page's token."""

import asyncio
import contextlib
import time
from pathlib import Path

from aiohttp import web

from onboard.hmi.page_files import HEADERS
from onboard.recorder.retention import segments_in

_CONTENT_TYPE = "application/octet-stream"
_CHUNK_BYTES = 64 * 1024
"""Read at once in a thread of its own: a slow disk does not delay the daemon's loop."""


def add_recordings(app: web.Application, folder: Path) -> None:
    """Serve a list of the segments at `/recording`, and each of them at `/recording/NAME`.

    The list is JSON: `name`, `size_bytes`, and `age_s`, the time since the last write.
    """

    async def send_list(_request: web.Request) -> web.Response:
        return web.json_response(await asyncio.to_thread(_listed, folder))

    async def send(request: web.Request) -> web.StreamResponse:
        # Only what is listed is opened.
        path = folder / request.match_info["name"]
        if path not in await asyncio.to_thread(lambda: set(segments_in(folder))):
            raise web.HTTPNotFound
        try:
            opened = await asyncio.to_thread(path.open, "rb")
        except FileNotFoundError:  # deleted for its age just now
            raise web.HTTPNotFound from None
        response = web.StreamResponse(headers=HEADERS | {"Content-Type": _CONTENT_TYPE})
        with opened as file:
            await response.prepare(request)
            while chunk := await asyncio.to_thread(file.read, _CHUNK_BYTES):
                await response.write(chunk)
        return response

    app.router.add_get("/recording", send_list)
    app.router.add_get("/recording/{name}", send)


def _listed(folder: Path) -> list[dict[str, object]]:
    now, found = time.time(), []
    for path in sorted(segments_in(folder)):
        with contextlib.suppress(FileNotFoundError):  # deleted for its age just now
            status = path.stat()
            age_s = max(0.0, now - status.st_mtime)
            found.append({"name": path.name, "size_bytes": status.st_size, "age_s": age_s})
    return found
