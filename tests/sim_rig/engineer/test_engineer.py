"""The data of the engineer's page: run view, camera images, and their server."""

import asyncio
import json
import time
from collections.abc import Coroutine
from pathlib import Path
from typing import Any

import aiohttp
import cv2
import numpy as np
import pytest

from sim_rig.engineer.image_store import ImageStore
from sim_rig.engineer.run_view import RunView
from sim_rig.engineer.server import EngineerServer
from sim_rig.run_log.latency_ledger import ledger
from sim_rig.run_log.run_log import RunLog
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import Scenario, load_scenario


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_scenario("fig4").model_copy(update={"duration_s": 12.0})


@pytest.fixture(scope="module")
def log(scenario: Scenario) -> RunLog:
    return run_virtual(scenario)


@pytest.fixture
def view(log: RunLog) -> RunView:
    view = RunView(log.names)
    view.receive_rig({"kind": "start", "stamp_s": 0.0})
    for record in log.rig:
        view.receive_rig(record)
    for car, records in log.traces.items():
        for record in records:
            view.receive_record(car, record)
    return view


def run(work: Coroutine[Any, Any, None]) -> None:
    asyncio.run(asyncio.wait_for(work, 20.0))


def test_ids_are_replaced_by_names(view: RunView) -> None:
    warnings = [entry for entry in view.entries if entry["kind"] == "warning"]
    warns = [
        entry
        for entry in view.entries
        if entry["kind"] == "received" and entry["message"] == "warn"
    ]

    assert {(entry["car"], entry["origin_id"]) for entry in warnings} == {
        ("red", "green"),
        ("blue", "green"),
    }
    assert {entry["content"]["sender_id"] for entry in warns} <= {"green", "red", "blue"}


def test_the_ledger_equals_that_of_the_run_log(view: RunView, log: RunLog) -> None:
    assert ledger(view.log()) == ledger(log)
    assert {line.hop for line in ledger(log)} >= {"noticed", "received", "alarm", "chain"}


def test_a_perceived_object_has_each_measurement_once_and_a_sigma() -> None:
    view = RunView({})
    view.receive_record(
        "red",
        {
            "stamp_s": 1.0,
            "kind": "perceived_object",
            "name": "3",
            "source": "shared",
            "state": [10.0, 20.0, 1.0, 2.0],
            "covariance": [[4.0, 0, 0, 0], [0, 4.0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
            "age_s": 0.1,
            "provenance": [["aabbccdd", 100], ["aabbccdd", 200], ["11223344", 150]],
        },
    )

    (entry,) = view.entries
    assert entry["sigma_m"] == 2.0
    assert "covariance" not in entry
    assert entry["provenance"] == [["aabbccdd", 100], ["aabbccdd", 200], ["11223344", 150]]


def test_the_store_finds_the_image_of_a_time() -> None:
    images = ImageStore(max_bytes=1000)
    for stamp_s in (1.0, 2.0, 3.0):
        images.add("red", stamp_s, f"red {stamp_s}".encode())
    images.add("blue", 2.5, b"blue")

    assert images.at("red", 2.9) == (2.0, b"red 2.0")
    assert images.at("red", 3.0) == (3.0, b"red 3.0")
    assert images.at("red", 0.9) is None
    assert images.at("blue", 9.0) == (2.5, b"blue")
    assert images.at("unknown", 9.0) is None


def test_a_full_store_drops_the_oldest_images() -> None:
    images = ImageStore(max_bytes=100)
    for n in range(10):
        images.add("red" if n % 2 else "blue", float(n), bytes(30))

    assert images.at("red", 5.9) is None
    assert images.at("red", 7.0) == (7.0, bytes(30))
    assert images.at("blue", 9.0) == (8.0, bytes(30))


def test_the_server_returns_new_entries_and_any_image(scenario: Scenario, tmp_path: Path) -> None:
    async def check() -> None:
        server = EngineerServer(scenario, tmp_path, camera_port=1)
        address = f"http://127.0.0.1:{await server.start()}"
        (tmp_path / "red.jsonl").write_text('{"kind":"speed","stamp_s":1.0,"speed_m_s":9}\n')
        server.run_view.receive_rig({"kind": "start", "stamp_s": 1.0})
        _, jpeg = cv2.imencode(".jpg", np.zeros((9, 16, 3), np.uint8))
        server.images.add("red", 1.5, jpeg.tobytes())
        async with aiohttp.ClientSession() as session:

            async def get(path: str, **more: Any) -> tuple[int, Any]:
                async with session.get(address + path, **more) as answer:
                    body = await answer.read()
                    is_json = answer.content_type == "application/json"
                    return answer.status, json.loads(body) if is_json else body

            _, news = await get("/entries")
            while not news["entries"]:
                await asyncio.sleep(0.01)
                _, news = await get("/entries")
            assert news["entries"] == [
                {"car": "red", "kind": "speed", "stamp_s": 1.0, "speed_m_s": 9}
            ]
            assert news["start_s"] == 1.0
            assert news["now_s"] <= time.monotonic()
            assert (await get("/entries?from=1"))[1]["entries"] == []
            assert await get("/pictures/red?at_s=2.0") == (200, jpeg.tobytes())
            _, overview = await get("/run")
            assert [car["name"] for car in overview["cars"]] == scenario.equipped
            for path, status in {
                "/": 200,
                "/fonts/OFL-1.1.txt": 200,
                "/ledger": 200,
                "/pictures/red?at_s=1.0": 404,
                "/pictures/red?at_s=x": 400,
                "/pictures/unknown?at_s=2.0": 404,
                "/entries?from=x": 400,
                "/entries?from=-5": 200,
                "/../server.py": 404,
            }.items():
                assert (await get(path))[0] == status, path
            assert (await get("/run", headers={"Host": "evil.example"}))[0] == 403
        await server.close()

    run(check())
