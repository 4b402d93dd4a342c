"""The edge: HTTP for browsers and Prometheus, and a web socket that pushes views to every page.

A page confirms each view (`shown NUMBER`). So views do not queue for a page that is slow or gone
(see `feed.py`), and the delay to the page is measured.
"""

import asyncio
import contextlib
import logging
import os
import time
from collections.abc import Callable
from pathlib import Path

import structlog
from aiohttp import WSMsgType, web
from aiohttp.http_exceptions import HttpProcessingError
from typing_extensions import override

from onboard.errors import UserError
from onboard.hmi.access_check import AccessCheck
from onboard.hmi.connection_limiter import ConnectionLimiter
from onboard.hmi.feed import Feed, FeedReader
from onboard.hmi.guess_limiter import GuessLimiter
from onboard.hmi.metrics import Metrics
from onboard.hmi.page_files import HEADERS, Handler, add_page, read_page, with_headers
from onboard.hmi.recording_files import add_recordings
from onboard.hmi.settings import HmiSettings
from onboard.recorder.build import present_build

log = structlog.get_logger()

MOST_PAGES = 64
"""Open web sockets; more are refused."""
SILENT_S = 10.0
"""Time without a confirmation after which a page is closed."""
CLOSE_TIMEOUT_S = 0.5
"""For a page's answer to the closing of its web socket, so that shutting down takes no longer."""
_MESSAGE_BYTES = 64
"""Largest message from a page; a confirmation is shorter."""
_SENT_VIEWS = 256
"""Views whose times of sending are kept for the delay; later confirmations are not measured."""
_PROBE_S = 0.1
"""Between two samples of the loop's delay."""

_REFUSALS = {
    "no_token": (401, "This page needs its token: open it once with ?token=..."),
    "wrong_token": (401, "This is not the token of this page."),
    "too_many_guesses": (429, "Too many wrong tokens came from this address: wait."),
}
"""Status and text, by reason."""


class _MalformedRequests(logging.Filter):
    """Counts requests that are no HTTP: aiohttp would print a traceback for each."""

    def __init__(self, metrics: Metrics) -> None:
        super().__init__()
        self._metrics = metrics

    @override
    def filter(self, record: logging.LogRecord) -> bool:
        error = record.exc_info[1] if record.exc_info else None
        if not isinstance(error, HttpProcessingError):
            return True
        self._metrics.count_refusal("malformed")
        return False


class PageServer:
    """Serves the driver's page and the metrics."""

    def __init__(
        self,
        settings: HmiSettings,
        metrics: Metrics,
        on_brake: Callable[[], None],
        recordings: Path | None = None,
    ) -> None:
        """Build the server; nothing is served yet.

        Args:
            settings: address, token and test mode.
            metrics: served at `/metrics`.
            on_brake: called when the page's button is pressed, in test mode only.
            recordings: folder of the black box, served if `settings` has `recordings`.
        """
        self._recordings = recordings if settings.recordings else None
        self._settings = settings
        self._metrics = metrics
        self._on_brake = on_brake
        token = settings.token
        self._token = None if token is None else token.get_secret_value()
        self._access_check = AccessCheck(self._token)
        self._guess_limiter = GuessLimiter()
        self._cookie = f"onboard_{settings.port}"
        self._feed: Feed[str] = Feed()
        self._pages: set[web.WebSocketResponse] = set()
        self._sent_at: dict[int, float] = {}
        self._number = 0

    @property
    def has_pages(self) -> bool:
        """Whether a page is open."""
        return bool(self._pages)

    async def start(self) -> None:
        """Listen.

        Raises:
            UserError: the address cannot be opened.
        """
        app = web.Application(middlewares=[self._guard])
        app.router.add_get("/views", self._serve_views)
        app.router.add_get("/metrics", self._serve_metrics)
        app.router.add_get("/build", self._serve_build)
        if self._recordings is not None:
            add_recordings(app, self._recordings)
        add_page(app, read_page("onboard.hmi"))
        errors = logging.Logger(__name__)  # noqa: LOG001 (its filter is of this server only)
        errors.addFilter(_MalformedRequests(self._metrics))
        self._runner = web.AppRunner(app, access_log=None, logger=errors, shutdown_timeout=0.2)
        await self._runner.setup()
        host, port = str(self._settings.host), self._settings.port
        server = self._runner.server
        assert server is not None  # noqa: S101 (after setup)
        self._limiter = ConnectionLimiter(server)
        loop = asyncio.get_running_loop()
        try:
            self._listener = await loop.create_server(self._limiter, host, port, backlog=128)
        except OSError as error:
            await self._runner.cleanup()
            raise UserError(f"hmi.port: {host}:{port}: {os.strerror(error.errno or 0)}") from error
        self._probe = asyncio.create_task(self._sample_loop_delay())
        log.info("page", address=f"http://{host}:{port}/")

    async def close(self) -> None:
        """Close all pages and stop listening."""
        self._probe.cancel()
        self._limiter.close()
        self._listener.close()
        pages = list(self._pages)
        await asyncio.gather(*(page.close() for page in pages), return_exceptions=True)
        await self._runner.cleanup()

    def publish(self, view: str) -> None:
        """Push a view, as JSON, to every page."""
        self._number += 1
        self._sent_at[self._number] = time.monotonic()
        self._sent_at.pop(self._number - _SENT_VIEWS, None)
        self._feed.publish(view)

    @web.middleware
    async def _guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        offered = request.query.get("token")
        if not self._guess_limiter.may_offer(request.remote, time.monotonic()):
            return self._refuse(request, "too_many_guesses")
        if self._token is not None and request.path == "/" and offered is not None:
            return self._set_cookie(request, offered)
        headers = request.headers
        refusal = self._access_check.refusal(
            request.host,
            headers.get("Origin"),
            request.cookies.get(self._cookie),
            headers.get("Authorization"),
        )
        if refusal is not None:
            return self._refuse(request, refusal)
        self._limiter.accept(request.transport)
        return await with_headers(request, handler)

    def _set_cookie(self, request: web.Request, offered: str) -> web.Response:
        """Turn the token into a cookie, and redirect, so that it does not stay in the address."""
        if not self._access_check.is_token(offered):
            return self._refuse(request, "wrong_token")
        response = web.Response(status=303, headers={"Location": "/"} | HEADERS)
        response.set_cookie(self._cookie, offered, httponly=True, samesite="Strict", path="/")
        return response

    def _refuse(self, request: web.Request, reason: str) -> web.Response:
        self._metrics.count_refusal(reason)
        if reason == "wrong_token":
            self._guess_limiter.receive_wrong(request.remote, time.monotonic())
        status, text = _REFUSALS.get(reason, (403, "This page is not served under this name."))
        return web.Response(status=status, text=text + "\n", headers=HEADERS)

    async def _serve_metrics(self, _request: web.Request) -> web.Response:
        body, content_type = self._metrics.exposition()
        return web.Response(body=body, headers={"Content-Type": content_type})

    async def _serve_build(self, _request: web.Request) -> web.Response:
        return web.Response(text=present_build().name)

    async def _serve_views(self, request: web.Request) -> web.StreamResponse:
        if len(self._pages) >= MOST_PAGES:
            raise web.HTTPServiceUnavailable(text="too many pages are open\n")
        page = web.WebSocketResponse(
            timeout=CLOSE_TIMEOUT_S, max_msg_size=_MESSAGE_BYTES, compress=False
        )
        try:
            await page.prepare(request)
        except ValueError:  # by base64, of a Sec-WebSocket-Key that is not ASCII
            raise web.HTTPBadRequest from None
        self._pages.add(page)
        self._metrics.set_open_pages(len(self._pages))
        reader = FeedReader(self._feed)
        pushing = asyncio.create_task(self._push_all(page, reader))
        try:
            await self._listen(page, reader)
        finally:
            pushing.cancel()
            self._pages.discard(page)
            self._metrics.set_open_pages(len(self._pages))
        return page

    async def _push_all(self, page: web.WebSocketResponse, reader: FeedReader[str]) -> None:
        with contextlib.suppress(ConnectionError):
            while True:
                number, text = await reader.next()
                await page.send_str(f"{number} {text}")

    async def _listen(self, page: web.WebSocketResponse, reader: FeedReader[str]) -> None:
        """Handle the messages of a page until it closes or has been silent for `SILENT_S`."""
        while True:
            try:
                message = await page.receive(timeout=SILENT_S)
            except TimeoutError:
                await page.close()
                return
            if message.type is not WSMsgType.TEXT:
                return
            command, _, number = message.data.partition(" ")
            if command == "shown" and number.isascii() and number.isdigit():
                reader.confirm(int(number))
                sent_at = self._sent_at.get(int(number))
                if sent_at is not None:
                    self._metrics.observe_page_delay(time.monotonic() - sent_at)
            elif command == "brake" and self._settings.brake_button:
                self._on_brake()

    async def _sample_loop_delay(self) -> None:
        """Measure how late a timer of this loop is; warnings wait as long."""
        loop = asyncio.get_running_loop()
        while True:
            due_at = loop.time() + _PROBE_S
            await asyncio.sleep(_PROBE_S)
            self._metrics.observe_loop_delay(max(loop.time() - due_at, 0.0))
