"""A disk that fails at the start: the fault is reported, and the vehicle drives on and warns."""

import json
import signal
import socket
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.recorder.waiting import WITHIN_S, wait_until


def free_port(kind: socket.SocketKind) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Daemon:
    """A real daemon whose files are all in one folder, with a radio and the driver's page."""

    def __init__(self, folder: Path, disk: Path, mount: str | None) -> None:
        self.wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.wire.bind(("127.0.0.1", 0))
        self.wire.settimeout(WITHIN_S)
        self.page = free_port(socket.SOCK_STREAM)
        tree = {
            "car": {"plate": "ABC123"},
            "radio": {
                "endpoint": "iwcu",
                "listen_port": free_port(socket.SOCK_DGRAM),
                "unit_port": self.wire.getsockname()[1],
            },
            "trace": {"file": str(disk / "trace.jsonl"), "capture": str(disk / "air.pcap")},
            "recorder": {"folder": str(disk / "box")},
            "access": {"driver_file": str(disk / "driver.json")},
            "hmi": {"port": self.page},
        }
        config = folder / "car.yaml"
        config.write_text(yaml.safe_dump(tree))
        command = [sys.executable, "-m", "onboard", "run", str(config)]
        if mount is not None:
            namespace = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c"]
            command = [*namespace, f'{mount} && exec "$@"', "sh", *command]
        self.process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)

    def metrics(self) -> str:
        with urllib.request.urlopen(f"http://127.0.0.1:{self.page}/metrics") as answer:
            return str(answer.read().decode())

    def release(self) -> None:
        self.process.kill()
        self.process.communicate()
        self.wire.close()


MOUNTS = {
    "a file instead of a folder": None,
    "read-only": "mount -t tmpfs -o ro tmpfs {disk}",
    "full": "mount -t tmpfs -o size=4k tmpfs {disk} && head -c 4096 /dev/zero > {disk}/much",
}


@pytest.fixture(
    params=[
        each if each == "full" else pytest.param(each, marks=pytest.mark.long) for each in MOUNTS
    ]
)
def daemon(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Daemon]:
    disk, mount = tmp_path / "disk", MOUNTS[request.param]
    if mount is None:
        disk.write_text("no folder")
    else:
        disk.mkdir()
        mount = mount.format(disk=disk)
        tried = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", mount]
        try:
            subprocess.run(tried, check=True, capture_output=True)
        except (OSError, subprocess.CalledProcessError):
            pytest.skip("this user may mount nothing")
    it = Daemon(tmp_path, disk, mount)
    yield it
    it.release()


def test_the_vehicle_drives_on_without_its_files_and_says_so(daemon: Daemon) -> None:
    """It ended with status 2, was started again for ever, and sent nothing."""
    for _ in range(5):
        assert daemon.wire.recv(2048)
    wait_until(lambda: "onboard_recording 0.0" in daemon.metrics())
    metrics = daemon.metrics()
    daemon.process.send_signal(signal.SIGTERM)
    _, log = daemon.process.communicate(timeout=WITHIN_S)

    assert daemon.process.returncode == 0
    for use in ("capture", "driver", "trace"):
        assert f'onboard_file_failed{{use="{use}"}} 1.0' in metrics
    failed = [line["use"] for line in journal(log) if line["event"] == "file failed"]
    assert set(failed) == {"capture", "driver", "trace"}
    recorder = [line["details"] for line in journal(log) if line["event"] == "recorder"]
    assert not any(state["is_recording"] for state in recorder)


def journal(log: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in log.splitlines() if line.startswith("{")]
