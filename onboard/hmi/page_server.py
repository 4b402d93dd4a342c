"""The edge: HTTP for browsers and Prometheus, a web socket that pushes each view to every page.

The page confirms each view (`shown NUMBER`), so that one that is slow or gone gets no queue (see
`feed.py`), and so that it is known how long views take to get there.
"""

import asyncio
import contextlib
import time
from collections.abc import Callable

import structlog
from aiohttp import WSMsgType, web

from onboard.errors import UserError
from onboard.hmi.access_check import AccessCheck
from onboard.hmi.connection_limiter import ConnectionLimiter
from onboard.hmi.feed import Feed, FeedReader
from onboard.hmi.metrics import Metrics
from onboard.hmi.page_files import HEADERS, Handler, add_page, read_page, under_rules
from onboard.hmi.settings import HmiSettings

log = structlog.get_logger()

MOST_PAGES = 64
"""Web sockets at a time; more are turned away."""
SILENT_S = 10.0
"""A page that confirms nothing for so long is gone, whatever the network says."""
GOODBYE_S = 0.5
"""For a page to answer that it is closed; a car that is switched off does not wait longer."""
_LONGEST_WORD = 64
_PROBE_S = 0.1


class PageServer:
    """Serves the driver's page and the metrics."""

    def __init__(
        self, settings: HmiSettings, metrics: Metrics, on_brake: Callable[[], None]
    ) -> None:
        """`on_brake` is called when the page's button is pressed, in test mode only."""
        self._settings = settings
        self._metrics = metrics
        self._on_brake = on_brake
        token = settings.token
        self._token = None if token is None else token.get_secret_value()
        self._door = AccessCheck(self._token)
        self._cookie = f"onboard_{settings.port}"
        self._feed: Feed[str] = Feed()
        self._pages: set[web.WebSocketResponse] = set()
        self._sent_at: dict[int, float] = {}
        self._number = 0

    @property
    def has_readers(self) -> bool:
        """Whether anybody looks."""
        return bool(self._pages)

    async def start(self) -> None:
        """Listen.

        Raises:
            UserError: the address cannot be had.
        """
        app = web.Application(middlewares=[self._guard])
        app.router.add_get("/views", self._push)
        app.router.add_get("/metrics", self._tell_metrics)
        add_page(app, read_page("onboard.hmi"))
        self._runner = web.AppRunner(app, access_log=None, shutdown_timeout=0.2)
        await self._runner.setup()
        host, port = str(self._settings.host), self._settings.port
        server = self._runner.server
        assert server is not None  # noqa: S101 (it has been set up)
        self._doorkeeper = ConnectionLimiter(server)
        loop = asyncio.get_running_loop()
        try:
            self._listener = await loop.create_server(self._doorkeeper, host, port, backlog=128)
        except OSError as error:
            await self._runner.cleanup()
            raise UserError(f"hmi: {host}:{port}: {error.strerror}") from error
        self._probe = asyncio.create_task(self._note_delays())
        log.info("page", address=f"http://{host}:{port}/")

    async def close(self) -> None:
        """Say goodbye to every page."""
        self._probe.cancel()
        self._doorkeeper.close()
        self._listener.close()
        pages = list(self._pages)
        await asyncio.gather(*(page.close() for page in pages), return_exceptions=True)
        await self._runner.cleanup()

    def publish(self, view: str) -> None:
        """Push a view, as JSON."""
        self._number += 1
        self._sent_at[self._number] = time.monotonic()
        self._sent_at.pop(self._number - 256, None)
        self._feed.publish(view)

    @web.middleware
    async def _guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        offered = request.query.get("token")
        if self._token is not None and request.path == "/" and offered is not None:
            return self._hand_over_cookie(offered)
        headers = request.headers
        refusal = self._door.refusal(
            request.host,
            headers.get("Origin"),
            request.cookies.get(self._cookie),
            headers.get("Authorization"),
        )
        if refusal is not None:
            return self._refuse(refusal)
        return await under_rules(request, handler)

    def _hand_over_cookie(self, offered: str) -> web.Response:
        """So that the token stands in the address once only, and not in the page's history."""
        if not self._door.is_right(offered):
            return self._refuse("wrong_token")
        response = web.Response(status=303, headers={"Location": "/"} | HEADERS)
        response.set_cookie(self._cookie, offered, httponly=True, samesite="Strict", path="/")
        return response

    def _refuse(self, reason: str) -> web.Response:
        self._metrics.refused(reason)
        text = {
            "no_token": "This page needs its token: open it once with ?token=...",
            "wrong_token": "This is not the token of this page.",
        }.get(reason, "This page is not served under that name.")
        status = 401 if reason.endswith("token") else 403
        return web.Response(status=status, text=text + "\n", headers=HEADERS)

    async def _tell_metrics(self, _request: web.Request) -> web.Response:
        body, content_type = self._metrics.exposition()
        return web.Response(body=body, headers={"Content-Type": content_type})

    async def _push(self, request: web.Request) -> web.StreamResponse:
        if len(self._pages) >= MOST_PAGES:
            raise web.HTTPServiceUnavailable(text="too many pages are open\n")
        page = web.WebSocketResponse(timeout=GOODBYE_S, max_msg_size=_LONGEST_WORD, compress=False)
        await page.prepare(request)
        self._pages.add(page)
        self._metrics.pages(len(self._pages))
        reader = FeedReader(self._feed)
        pushing = asyncio.create_task(self._push_all(page, reader))
        try:
            await self._listen(page, reader)
        finally:
            pushing.cancel()
            self._pages.discard(page)
            self._metrics.pages(len(self._pages))
        return page

    async def _push_all(self, page: web.WebSocketResponse, reader: FeedReader[str]) -> None:
        with contextlib.suppress(ConnectionError):
            while True:
                number, text = await reader.next()
                await page.send_str(f"{number} {text}")

    async def _listen(self, page: web.WebSocketResponse, reader: FeedReader[str]) -> None:
        """Hear the page out until it closes, or has been silent for too long."""
        while True:
            try:
                message = await page.receive(timeout=SILENT_S)
            except TimeoutError:
                await page.close()
                return
            if message.type is not WSMsgType.TEXT:
                return
            word, _, number = message.data.partition(" ")
            if word == "shown" and number.isascii() and number.isdigit():
                reader.confirm(int(number))
                sent_at = self._sent_at.get(int(number))
                if sent_at is not None:
                    self._metrics.shown(time.monotonic() - sent_at)
            elif word == "brake" and self._settings.brake_button:
                self._on_brake()

    async def _note_delays(self) -> None:
        """How late this loop comes to what is due: so long a warning waits, too."""
        loop = asyncio.get_running_loop()
        while True:
            due_at = loop.time() + _PROBE_S
            await asyncio.sleep(_PROBE_S)
            self._metrics.loop_delay(max(loop.time() - due_at, 0.0))
