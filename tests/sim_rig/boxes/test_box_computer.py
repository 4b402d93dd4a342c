"""The user's commands for a box: what they do, and what is said when they fail."""

import asyncio
import os
from pathlib import Path

import pytest
from aiohttp import web

from onboard.errors import UserError
from sim_rig.boxes.box_computer import BoxComputer
from tests.hmi.row import free_port
from tests.hmi.test_page_server import TOKEN, served
from tests.sim_rig.boxes.box_file import box


def shell(script: str) -> list[str]:
    return ["sh", "-c", script]


def computer(folder: Path, **commands: object) -> BoxComputer:
    settings = box(recording=str(folder / "new" / "drive"), **commands)
    return BoxComputer("red", settings, folder)


def test_a_file_without_commands_runs_none(tmp_path: Path) -> None:
    async def use() -> None:
        red = computer(tmp_path)
        await red.start()
        red.check()
        assert await red.finish() is None

    asyncio.run(use())
    assert list(tmp_path.iterdir()) == []


def test_what_was_started_is_ended(tmp_path: Path) -> None:
    async def use() -> None:
        stop = shell(f"echo stopped > {tmp_path}/stop")
        red = computer(tmp_path, start=shell("exec sleep 60"), stop=stop)
        await red.start()
        started = red._started
        assert started is not None
        await red.stop()
        assert started.returncode == -15
        (tmp_path / "stop").unlink()
        await red.stop()

    asyncio.run(use())
    assert not (tmp_path / "stop").exists()


def test_a_start_that_fails_says_what_it_printed(tmp_path: Path) -> None:
    async def use() -> None:
        red = computer(tmp_path, start=shell("echo welcome; echo no route to desk2 >&2; exit 255"))
        await red.start()
        assert red._started is not None
        await red._started.wait()
        red.check()

    with pytest.raises(UserError) as found:
        asyncio.run(use())
    assert str(found.value).startswith("red: start: sh -c ")
    assert str(found.value).endswith("exit code 255: no route to desk2")


def test_a_start_that_returns_at_once_is_no_failure(tmp_path: Path) -> None:
    async def use() -> None:
        red = computer(tmp_path, start=["true"])
        await red.start()
        assert red._started is not None
        await red._started.wait()
        red.check()
        await red.stop()

    asyncio.run(use())


@pytest.mark.parametrize(
    ("command", "mistake"),
    [
        (["no-such-program"], "fetch: no-such-program: No such file or directory"),
        (["false", "drive"], "fetch: false drive: exit code 1"),
        (["ls", "/no/such"], "fetch: ls /no/such: exit code 2: ls: "),
    ],
)
def test_a_recording_that_cannot_be_fetched_is_named(
    tmp_path: Path, command: list[str], mistake: str
) -> None:
    with pytest.raises(UserError) as found:
        asyncio.run(computer(tmp_path, fetch=command).fetch())
    assert str(found.value).startswith(mistake)


def test_what_was_started_is_ended_though_the_recording_cannot_be_copied(tmp_path: Path) -> None:
    async def use(**copied: object) -> str | None:
        red = computer(tmp_path, start=shell("exec sleep 60"), **copied)
        await red.start()
        started = red._started
        assert started is not None
        why = await red.finish()
        assert started.returncode == -15
        return why

    page = {"url": "http://127.0.0.1:1", "token_file": str(tmp_path / "none")}
    assert str(asyncio.run(use(page=page))).startswith("page: http://127.0.0.1:1/recording: ")
    assert asyncio.run(use(fetch=["false"])) == "fetch: false: exit code 1"


def test_power_is_cut_and_restored_at_times_that_are_noted(tmp_path: Path) -> None:
    async def use() -> BoxComputer:
        state = tmp_path / "state"
        red = computer(
            tmp_path, power={"cut": shell(f"echo off > {state}"), "restore": ["rm", str(state)]}
        )
        await red.cut()
        assert state.read_text() == "off\n"
        await red.restore()
        assert not state.exists()
        return red

    (cut,) = asyncio.run(use()).power_cuts
    assert cut.cut_s < cut.off_s < cut.restored_s


def test_a_relay_that_fails_is_named(tmp_path: Path) -> None:
    power = {"cut": shell("echo no relay; exit 3"), "restore": ["true"]}
    with pytest.raises(UserError, match=r"red: power\.cut: .*exit code 3: no relay"):
        asyncio.run(computer(tmp_path, power=power).cut())


def test_what_a_command_leaves_in_the_background_is_not_waited_for(tmp_path: Path) -> None:
    left = tmp_path / "left"
    restore = shell(f"sleep 60 & echo $! > {left}")
    red = computer(tmp_path, power={"cut": ["true"], "restore": restore})
    asyncio.run(red.restore())
    pid = int(left.read_text())
    asyncio.run(computer(tmp_path, fetch=["kill", str(pid)]).fetch())


def page_of(folder: Path, port: int, token: str = TOKEN) -> BoxComputer:
    (folder / "token").write_text(f"{token}\n")
    page = {"url": f"http://127.0.0.1:{port}", "token_file": str(folder / "token")}
    return computer(folder, page=page)


@pytest.fixture
def black_box(tmp_path: Path) -> Path:
    folder = tmp_path / "box"
    folder.mkdir()
    (folder / "20260101T000000.000Z-0001.mcap").write_bytes(b"of the run")
    old = folder / "20260101T000000.000Z-0000.mcap"
    old.write_bytes(b"older")
    os.utime(old, (1.0, 1.0))
    return folder


def test_a_recording_is_copied_from_the_page_of_the_box(tmp_path: Path, black_box: Path) -> None:
    async def copy() -> None:
        async with served(black_box, token=TOKEN, recordings=True) as it:
            port = int(it.address.rsplit(":", 1)[1].strip("/"))
            await page_of(tmp_path, port).download()
            with pytest.raises(UserError, match=r"page: .*/recording: 401 This is not"):
                await page_of(tmp_path, port, "another-of-16-letters").download()

    asyncio.run(copy())
    (copied,) = (tmp_path / "new" / "drive").iterdir()
    assert (copied.name, copied.read_bytes()) == ("20260101T000000.000Z-0001.mcap", b"of the run")


def test_a_page_that_does_not_answer_is_named(tmp_path: Path) -> None:
    red = page_of(tmp_path, free_port())
    with pytest.raises(UserError, match=r"page: http://127.0.0.1:\d+/recording: "):
        asyncio.run(red.download())
    (tmp_path / "token").unlink()
    with pytest.raises(UserError, match="No such file or directory"):
        asyncio.run(red.download())


@pytest.mark.parametrize(
    ("listed", "mistake"),
    [
        ([{"name": "../evil.mcap", "age_s": 0.0}], "'../evil.mcap' is no name of a segment"),
        ([{"name": "evil.sh", "age_s": 0.0}], "'evil.sh' is no name of a segment"),
        ([{"name": "a.mcap"}], "no list of segments: KeyError"),
        ({"a": 1}, "no list of segments: "),
    ],
)
def test_a_box_cannot_write_elsewhere(tmp_path: Path, listed: object, mistake: str) -> None:
    async def copy() -> None:
        async def send(request: web.Request) -> web.Response:
            return web.json_response(listed if request.path == "/recording" else {})

        app = web.Application()
        app.router.add_get("/{path:.*}", send)
        runner = web.AppRunner(app)
        await runner.setup()
        site = web.TCPSite(runner, "127.0.0.1", 0)
        await site.start()
        try:
            await page_of(tmp_path, runner.addresses[0][1]).download()
        finally:
            await runner.cleanup()

    with pytest.raises(UserError) as found:
        asyncio.run(copy())
    assert mistake in str(found.value)
    assert list((tmp_path / "new" / "drive").iterdir()) == []
