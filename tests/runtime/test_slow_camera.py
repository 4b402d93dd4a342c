"""A camera that opens slowly: the vehicle has its other sensors and its radio meanwhile."""

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

from tests.forked_daemon import ForkedDaemon
from tests.recorder.waiting import WITHIN_S
from tests.runtime.test_failing_disk import free_port


@pytest.fixture
def silent_camera() -> Iterator[int]:
    """Return the port of a camera that takes a connection and does not answer."""
    with socket.create_server(("127.0.0.1", 0)) as camera:
        yield int(camera.getsockname()[1])


def test_messages_are_sent_before_the_camera_is_open(silent_camera: int, tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as unit:
        unit.bind(("127.0.0.1", 0))
        unit.settimeout(WITHIN_S)
        tree = {
            "car": {"plate": "ABC123"},
            "camera": {"source": f"http://127.0.0.1:{silent_camera}/"},
            "radio": {
                "endpoint": "iwcu",
                "listen_port": free_port(socket.SOCK_DGRAM),
                "unit_port": unit.getsockname()[1],
            },
            "trace": {"file": str(tmp_path / "trace.jsonl")},
        }
        (tmp_path / "car.yaml").write_text(yaml.safe_dump(tree))
        daemon = ForkedDaemon(tmp_path / "car.yaml")
        assert unit.recv(2048)
        daemon.wait()

    assert daemon.returncode == 2
    assert "camera.source" in daemon.log
    assert '"kind":"ready"' not in (tmp_path / "trace.jsonl").read_text("utf-8")
