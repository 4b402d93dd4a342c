"""Recording by the daemon: killed, stopped, and with a full disk."""

import json
import secrets
import signal
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
import yaml

from onboard.recorder.reader import RecordedDrive, is_finished
from onboard.replay.replay import compare
from tests.forked_daemon import ForkedDaemon
from tests.recorder.waiting import WITHIN_S, wait_until

FULL_BYTES = 65_536
"""Of a file, after which the disk counts as full."""


class Daemon:
    """A real daemon with a radio and a black box."""

    def __init__(self, folder: Path, most_file_bytes: int | None) -> None:
        folder.mkdir(exist_ok=True)
        self.box = folder / "box"
        self.trace = folder / "trace.jsonl"
        self.wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.wire.bind(("127.0.0.1", 0))
        self.wire.settimeout(WITHIN_S)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = probe.getsockname()[1]
        tree = {
            "car": {"plate": "ABC123"},
            "radio": {
                "endpoint": "iwcu",
                "listen_port": self.port,
                "unit_port": self.wire.getsockname()[1],
            },
            "trace": {"file": str(self.trace)},
            "recorder": {"folder": str(self.box)},
        }
        (folder / "car.yaml").write_text(yaml.safe_dump(tree))
        self.process = ForkedDaemon(folder / "car.yaml", most_file_bytes=most_file_bytes)

    def receive(self) -> bytes:
        """Return the next BSM of the daemon."""
        return self.wire.recv(2048)

    def send(self, wsm: bytes) -> None:
        self.wire.sendto(wsm, ("127.0.0.1", self.port))

    def traced(self, kind: str) -> list[dict[str, object]]:
        lines = self.trace.read_text().split("\n")[:-1]
        return [record for record in map(json.loads, lines) if record["kind"] == kind]

    def end(self, number: signal.Signals) -> int:
        self.process.send_signal(number)
        self.wire.close()
        return self.process.wait()

    def release(self) -> None:
        """End the process and close the socket."""
        self.process.release()
        self.wire.close()


@pytest.fixture
def start_daemon(tmp_path: Path) -> Iterator[Callable[..., Daemon]]:
    """Start daemons and wait for their first BSM; end them after the test."""
    with ExitStack() as stack:

        def start(most_file_bytes: int | None = None) -> Daemon:
            daemon = Daemon(tmp_path, most_file_bytes)
            stack.callback(daemon.release)
            daemon.receive()
            return daemon

        yield start


@pytest.mark.long
def test_a_killed_daemon_loses_at_most_the_last_second(start_daemon: Callable[..., Daemon]) -> None:
    daemon = start_daemon()
    received_at = [time.time() for _ in range(25) if daemon.receive()]
    daemon.end(signal.SIGKILL)

    drive = RecordedDrive([daemon.box])
    sent = [entry.utc_s for entry in drive.entries() if entry.topic == "/out/wsm"]
    assert sent[-1] > received_at[-1] - 1.0
    assert compare(drive).difference is None


def test_a_stopped_daemon_finishes_its_recording(start_daemon: Callable[..., Daemon]) -> None:
    daemon = start_daemon()
    wait_until(lambda: bool(daemon.traced("recorder")))
    began_at = time.monotonic()
    assert daemon.end(signal.SIGTERM) == 0

    assert time.monotonic() - began_at < 2.0
    assert is_finished(next(daemon.box.iterdir()))
    assert [state["is_recording"] for state in daemon.traced("recorder")] == [True]


def test_a_daemon_with_a_full_disk_reports_it_and_keeps_sending(
    start_daemon: Callable[..., Daemon],
) -> None:
    daemon = start_daemon(most_file_bytes=FULL_BYTES)
    for _ in range(150):
        daemon.send(secrets.token_bytes(1000))
        time.sleep(0.002)
    wait_until(lambda: len(daemon.traced("recorder")) > 1)
    stopped = daemon.traced("recorder")[1]
    for _ in range(5):
        assert daemon.receive()

    assert daemon.end(signal.SIGTERM) == 0
    assert (stopped["is_recording"], stopped["reason"]) == (False, "File too large")


def test_a_stopped_daemon_with_a_full_disk_reports_the_final_number_of_lost_records(
    start_daemon: Callable[..., Daemon],
) -> None:
    """The last traced state includes the records that were still in the queue."""
    daemon = start_daemon(most_file_bytes=FULL_BYTES)

    def has_filled_the_disk() -> bool:
        daemon.send(secrets.token_bytes(1000))
        return len(daemon.traced("recorder")) > 1

    wait_until(has_filled_the_disk)
    for _ in range(5):
        assert daemon.receive()
    assert daemon.end(signal.SIGTERM) == 0

    _, stopped, at_the_end = (state["dropped"] for state in daemon.traced("recorder"))
    assert isinstance(stopped, int)
    assert isinstance(at_the_end, int)
    assert at_the_end > stopped
