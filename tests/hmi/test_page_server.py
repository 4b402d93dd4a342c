"""The page server on real sockets: access, and independence from slow pages."""

import asyncio
import json
from collections.abc import AsyncIterator, Coroutine
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from onboard.errors import UserError
from onboard.hmi.connection_limiter import MOST_CONNECTIONS
from onboard.hmi.guess_limiter import MOST_AT_ONCE
from onboard.hmi.metrics import Metrics
from onboard.hmi.page_files import read_page
from onboard.hmi.page_server import CLOSE_TIMEOUT_S, MOST_PAGES, PageServer
from onboard.hmi.settings import HmiSettings
from onboard.recorder.build import Build, present_build
from onboard.settings import SettingsError, parse_settings
from tests.hmi.row import free_port

BUILD = Build("0.2.0", "4f463bb4b", "20261124")

TOKEN = "aaaabbbbccccdddd"  # noqa: S105 (of this test)


class Served:
    """A running server and its client."""

    def __init__(
        self,
        server: PageServer,
        session: aiohttp.ClientSession,
        address: str,
        pressed: list[None],
        pages: AsyncExitStack,
    ) -> None:
        self.server = server
        self.session = session
        self.address = address
        self.pressed = pressed
        self._pages = pages

    async def status(self, path: str, **more: Any) -> int:
        async with self.session.get(self.address + path, allow_redirects=False, **more) as answer:
            return answer.status

    async def text(self, path: str, **more: Any) -> str:
        async with self.session.get(self.address + path, **more) as answer:
            return await answer.text()

    async def page(self, **more: Any) -> aiohttp.ClientWebSocketResponse:
        before = await self.open_pages()
        page: aiohttp.ClientWebSocketResponse = await self._pages.enter_async_context(
            self.session.ws_connect(self.address + "views", **more)
        )
        while await self.open_pages() == before:
            await asyncio.sleep(0)
        return page

    async def open_pages(self) -> float:
        name = "onboard_pages "
        lines = (await self.text("metrics")).splitlines()
        (line,) = [line for line in lines if line.startswith(name)]
        return float(line.removeprefix(name))


@asynccontextmanager
async def served(recorded: Path | None = None, **settings: object) -> AsyncIterator[Served]:
    tree = {"port": free_port()} | settings
    pressed: list[None] = []
    server = PageServer(
        parse_settings(tree, HmiSettings, "hmi"),
        Metrics(frozenset(), BUILD),
        lambda: pressed.append(None),
        recorded,
    )
    await server.start()
    headers = {"Authorization": f"Bearer {settings['token']}"} if "token" in settings else {}
    async with aiohttp.ClientSession(headers=headers) as session, AsyncExitStack() as pages:
        yield Served(server, session, f"http://127.0.0.1:{tree['port']}/", pressed, pages)
    await server.close()


def run(work: Coroutine[Any, Any, None]) -> None:
    asyncio.run(asyncio.wait_for(work, 20.0))


def test_every_file_of_the_page_is_served_with_strict_headers() -> None:
    async def check() -> None:
        async with served() as it:
            for path in ["", *read_page("onboard.hmi"), "metrics"]:
                async with it.session.get(it.address + path) as answer:
                    assert answer.status == 200, path
                    policy = answer.headers["Content-Security-Policy"]
                    assert "default-src 'none'" in policy
                    assert "unsafe" not in policy
                    assert answer.headers["X-Content-Type-Options"] == "nosniff"

    run(check())


def test_the_page_shows_the_build_that_runs() -> None:
    async def check() -> None:
        async with served() as it:
            assert await it.text("build") == present_build().name
            assert 'id="build"' in await it.text("")

    run(check())


def test_a_web_socket_whose_key_is_not_ascii_is_a_bad_request_and_no_traceback(
    capfd: pytest.CaptureFixture[str],
) -> None:
    headers = {
        "Upgrade": "websocket",
        "Connection": "Upgrade",
        "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": "\u00e9",
    }

    async def check() -> None:
        async with served() as it:
            assert await it.status("views", headers=headers) == 400

    run(check())
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.parametrize("path", ["nothing.js", "../settings.py", "%2e%2e/settings.py", "fonts/"])
def test_other_paths_are_not_found(path: str) -> None:
    async def check() -> None:
        async with served() as it:
            assert await it.status(path) == 404

    run(check())


SEGMENT = "20260101T000000.000Z-0000.mcap"


@pytest.fixture
def black_box(tmp_path: Path) -> Path:
    folder = tmp_path / "drive"
    folder.mkdir()
    (folder / SEGMENT).write_bytes(bytes(range(256)) * 1000)
    (folder / "driver.json").write_text("{}")
    (tmp_path / SEGMENT).write_text("of another folder")
    return folder


def test_recordings_are_served_to_the_token(black_box: Path) -> None:
    async def check() -> None:
        async with served(black_box, token=TOKEN, recordings=True) as it:
            (listed,) = json.loads(await it.text("recording"))
            assert (listed["name"], listed["size_bytes"]) == (SEGMENT, 256_000)
            assert 0.0 <= listed["age_s"] < 60.0
            async with it.session.get(f"{it.address}recording/{SEGMENT}") as answer:
                assert answer.headers["X-Content-Type-Options"] == "nosniff"
                assert await answer.read() == (black_box / SEGMENT).read_bytes()
            for name in ("driver.json", f"../{SEGMENT}", f"..%2f{SEGMENT}", "x.mcap"):
                assert await it.status(f"recording/{name}") == 404, name
            without = {"Authorization": ""}
            assert await it.status("recording", headers=without) == 401
            assert await it.status(f"recording/{SEGMENT}", headers=without) == 401

    run(check())


def test_recordings_are_served_only_where_they_are_configured(black_box: Path) -> None:
    async def check() -> None:
        async with served(black_box, token=TOKEN) as it:
            assert await it.status("recording") == 404
            assert await it.status(f"recording/{SEGMENT}") == 404
        async with served(None, token=TOKEN, recordings=True) as it:
            assert await it.status("recording") == 404

    run(check())
    with pytest.raises(SettingsError, match="recordings needs a token"):
        parse_settings({"recordings": True}, HmiSettings, "hmi")


def test_the_page_refers_to_no_other_origin() -> None:
    for name, (body, content_type) in read_page("onboard.hmi").items():
        if content_type.startswith(("text/html", "text/css", "text/javascript")):
            text = body.decode().replace("http://www.w3.org/2000/svg", "")
            assert "//" not in text.replace("// ", "").replace("//\n", ""), name


def test_many_connections_without_the_token_do_not_keep_a_page_out() -> None:
    async def check() -> None:
        async with served(token=TOKEN) as it:
            page = await it.page()
            port = int(it.address.rsplit(":", 1)[1].strip("/"))
            outsiders = []
            for _ in range(MOST_CONNECTIONS + 70):
                reader, writer = await asyncio.open_connection("127.0.0.1", port)
                writer.write(b"GET / HTTP/1.1\r\n")
                outsiders.append((reader, writer))
            assert await it.status("") == 200
            headers = {"Authorization": f"Bearer {TOKEN}"}
            async with (
                aiohttp.ClientSession(headers=headers) as another,
                another.get(it.address) as answer,
            ):
                assert answer.status == 200
            assert not page.closed
            for _, writer in outsiders:
                writer.close()

    run(check())


def test_a_cookie_that_is_no_text_is_a_wrong_token() -> None:
    async def check() -> None:
        async with served(token=TOKEN) as it:
            port = int(it.address.rsplit(":", 1)[1].strip("/"))
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            head = f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nCookie: onboard_{port}=".encode()
            writer.write(head + b"\xff\xfe\r\n\r\n")
            assert b" 401 " in await reader.readline()
            writer.close()

    run(check())


@pytest.mark.parametrize(
    "head",
    [b"GET / HTTP/9.9", b"GET / HTTP/1.1\r\nContent-Length: -5", b"GET http://[::1 HTTP/1.1"],
)
def test_a_malformed_request_is_counted_and_not_printed(
    head: bytes, capfd: pytest.CaptureFixture[str]
) -> None:
    async def check() -> None:
        async with served() as it:
            port = int(it.address.rsplit(":", 1)[1].strip("/"))
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(head + b"\r\n\r\n")
            assert b" 400 " in await reader.readline()
            writer.close()
            assert 'reason="malformed"} 1.0' in await it.text("metrics")

    run(check())
    assert "Traceback" not in capfd.readouterr().err


def test_another_host_name_or_origin_is_refused() -> None:
    async def check() -> None:
        async with served() as it:
            assert await it.status("", headers={"Host": "evil.example"}) == 403
            assert await it.status("metrics", headers={"Host": "evil.example"}) == 403
            with pytest.raises(aiohttp.WSServerHandshakeError, match="403"):
                await it.session.ws_connect(
                    it.address + "views", headers={"Origin": "http://evil.example"}
                )
            assert 'reason="foreign_host"} 2.0' in await it.text("metrics")

    run(check())


def test_without_the_configured_token_every_path_is_refused() -> None:
    async def check() -> None:
        async with served(token=TOKEN) as it, aiohttp.ClientSession() as unknown:
            for path in ("", "driver.js", "metrics", "views", "nothing"):
                async with unknown.get(it.address + path) as answer:
                    assert answer.status == 401
                async with unknown.get(it.address + path, params={"token": "x" * 16}) as answer:
                    assert answer.status == 401
            assert await it.status("metrics") == 200

    run(check())


@pytest.mark.parametrize("offer", ["address", "cookie", "header"])
def test_guesses_at_the_token_are_slowed_and_shut_out_nobody_else(offer: str) -> None:
    async def check() -> None:
        async with served(token=TOKEN) as it, aiohttp.ClientSession() as guesser:
            port = int(it.address.rsplit(":", 1)[1].strip("/"))
            statuses = []
            for number in range(60):
                guess = f"{number:016}"
                more: dict[str, Any] = {
                    "address": {"params": {"token": guess}},
                    "cookie": {"cookies": {f"onboard_{port}": guess}},
                    "header": {"headers": {"Authorization": f"Bearer {guess}"}},
                }[offer]
                async with guesser.get(it.address, **more) as answer:
                    statuses.append(answer.status)
            assert statuses[:MOST_AT_ONCE] == [401] * MOST_AT_ONCE
            assert statuses.count(429) > 30
            async with guesser.get(it.address, params={"token": TOKEN}) as answer:
                assert answer.status == 429, "not even the right one is told apart"
            elsewhere = aiohttp.TCPConnector(local_addr=("127.0.0.2", 0))
            async with (
                aiohttp.ClientSession(connector=elsewhere) as driver,
                driver.get(it.address, params={"token": TOKEN}, allow_redirects=False) as answer,
            ):
                assert answer.status == 303

    run(check())


def test_the_token_in_the_address_becomes_a_cookie() -> None:
    async def check() -> None:
        jar = aiohttp.CookieJar(unsafe=True)
        async with served(token=TOKEN) as it, aiohttp.ClientSession(cookie_jar=jar) as driver:
            async with driver.get(it.address, params={"token": TOKEN}) as answer:
                assert answer.status == 200
                assert TOKEN not in str(answer.url)
                (redirect,) = answer.history
                assert "HttpOnly" in redirect.headers["Set-Cookie"]
                assert "SameSite=Strict" in redirect.headers["Set-Cookie"]
            async with driver.get(it.address + "driver.js") as answer:
                assert answer.status == 200

    run(check())


def test_a_view_is_sent_to_every_page() -> None:
    async def check() -> None:
        async with served() as it:
            pages = [await it.page() for _ in range(20)]
            it.server.publish('{"n":1}')
            for page in pages:
                assert await page.receive_str() == '1 {"n":1}'
                await page.send_str("shown 1")

    run(check())


def test_a_page_without_confirmations_gets_two_views_and_then_the_latest() -> None:
    async def check() -> None:
        async with served() as it:
            slow, quick = await it.page(), await it.page()
            for number in range(1, 500):
                it.server.publish(str(number))
                assert await quick.receive_str() == f"{number} {number}"
                await quick.send_str(f"shown {number}")

            await slow.receive_str()
            second = (await slow.receive_str()).partition(" ")[0]
            await slow.send_str(f"shown {second}")

            assert await slow.receive_str() == "499 499"

    run(check())


def test_one_page_too_many_is_refused() -> None:
    async def check() -> None:
        async with served() as it:
            pages = [await it.page() for _ in range(MOST_PAGES)]
            with pytest.raises(aiohttp.WSServerHandshakeError, match="503"):
                await it.session.ws_connect(it.address + "views")
            await pages[0].close()
            while await it.open_pages() == MOST_PAGES:
                await asyncio.sleep(0)
            await it.page()

    run(check())


@pytest.mark.parametrize(("in_test_mode", "presses"), [(True, 1), (False, 0)])
def test_the_brake_button_works_in_test_mode_only(in_test_mode: bool, presses: int) -> None:
    async def press() -> None:
        async with served(brake_button=in_test_mode) as it:
            page = await it.page()
            await page.send_str("brake")
            it.server.publish("after")
            await page.receive_str()
            await page.send_str("shown 1")
            while "onboard_page_shown_seconds_count 1.0" not in await it.text("metrics"):
                await asyncio.sleep(0)
            assert len(it.pressed) == presses

    run(press())


@pytest.mark.parametrize(
    "message", ["shown", "shown x", "shown -1", "shown ²", "", "rm -rf", "shown 9999"]
)
def test_an_invalid_message_of_a_page_is_ignored(message: str) -> None:
    async def check() -> None:
        async with served(brake_button=True) as it:
            page = await it.page()
            await page.send_str(message)
            it.server.publish("view")
            assert await page.receive_str() == "1 view"
            assert it.pressed == []

    run(check())


def test_a_page_that_sends_a_too_long_message_is_closed() -> None:
    async def check() -> None:
        async with served() as it:
            page = await it.page()
            await page.send_str("x" * 10_000)
            while not page.closed:
                await page.receive()
            assert await it.status("") == 200

    run(check())


def test_pages_that_do_not_answer_do_not_delay_the_shutdown() -> None:
    async def stop() -> None:
        async with served() as it:
            pages = [await it.page(autoclose=False) for _ in range(10)]
            await asyncio.wait_for(it.server.close(), 10 * CLOSE_TIMEOUT_S)
            assert len(pages) == 10

    run(stop())


def test_a_port_in_use_is_a_user_error() -> None:
    async def start() -> None:
        async with served() as it:
            port = int(it.address.rsplit(":", 1)[1].strip("/"))
            second = PageServer(HmiSettings(port=port), Metrics(frozenset(), BUILD), lambda: None)
            with pytest.raises(
                UserError, match=f"hmi.port: 127.0.0.1:{port}: Address already in use$"
            ):
                await second.start()

    run(start())
