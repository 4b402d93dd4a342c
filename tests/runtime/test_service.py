"""The daemon as a service: notifications to systemd, and new configurations."""

import asyncio
import itertools
import json
import signal
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from onboard.runtime import daemon as daemon_module
from onboard.runtime.daemon import Daemon
from onboard.runtime.output_sinks import OutputSinks
from onboard.runtime.systemd import Systemd
from onboard.runtime.wires import Wires
from onboard.settings import parse_settings
from onboard.vehicle.config import CarConfig
from tests.forked_daemon import ForkedDaemon
from tests.recorder.waiting import wait_until


class NotifySocket:
    """The socket that systemd listens on."""

    def __init__(self, folder: Path) -> None:
        self.address = str(folder / "notify")
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(self.address)
        self.socket.settimeout(20.0)

    def notification(self) -> dict[str, str]:
        lines = self.socket.recv(4096).decode().splitlines()
        return dict(line.split("=", 1) for line in lines)

    def next_with(self, name: str) -> dict[str, str]:
        while name not in (values := self.notification()):
            pass
        return values

    def is_empty(self) -> bool:
        self.socket.setblocking(False)
        try:
            return not self.socket.recv(4096)
        except BlockingIOError:
            return True


@pytest.fixture
def systemd(tmp_path: Path) -> Iterator[NotifySocket]:
    it = NotifySocket(tmp_path)
    yield it
    it.socket.close()


@pytest.fixture
def daemon(systemd: NotifySocket, tmp_path: Path) -> Iterator[ForkedDaemon]:
    config = tmp_path / "car.yaml"
    config.write_text("car: {plate: OLD1}\n")
    started = ForkedDaemon(
        config,
        {"NOTIFY_SOCKET": systemd.address, "WATCHDOG_USEC": "400000", "JOURNAL_STREAM": "8:1"},
    )
    yield started
    started.release()


def test_systemd_is_notified_of_readiness_progress_and_end(
    daemon: ForkedDaemon, systemd: NotifySocket
) -> None:
    assert "OLD1" in systemd.next_with("READY")["STATUS"]
    systemd.next_with("WATCHDOG")
    systemd.next_with("WATCHDOG")
    daemon.send_signal(signal.SIGTERM)
    systemd.next_with("STOPPING")

    assert daemon.wait() == 0
    assert all(line.startswith("<6>{") for line in daemon.log.splitlines()), daemon.log
    assert '"event": "stopped"' in daemon.log


def test_a_valid_configuration_takes_effect_and_an_invalid_one_is_refused(
    daemon: ForkedDaemon, systemd: NotifySocket, tmp_path: Path
) -> None:
    config = tmp_path / "car.yaml"
    systemd.next_with("READY")

    def after(text: str) -> str:
        config.write_text(text)
        daemon.send_signal(signal.SIGHUP)
        systemd.next_with("RELOADING")
        return systemd.next_with("READY")["STATUS"]

    assert "refused" in after("car: {plate: lower case}\n")
    assert "refused" in after("car: {plate: NEW1}\nsecurity: {keys_folder: /nonexistent}\n")
    assert "NEW1" in after("car: {plate: NEW1}\n")
    assert "NEW1" in after("car: {plate: NEW2}\ncan: {interface: socketcan, channel: nosuchcan9}\n")
    assert "NEW3" in after("car: {plate: NEW3}\n")

    assert daemon.end() == 0
    refused = [line for line in daemon.log.splitlines() if line.startswith("<3>")]
    reasons = ("car.plate: is written in", "/nonexistent", "nosuchcan9 cannot be opened")
    for line, reason in zip(refused, reasons, strict=True):
        assert reason in line


def test_a_driver_file_that_cannot_be_written_does_not_stop_the_daemon(
    daemon: ForkedDaemon, systemd: NotifySocket, tmp_path: Path
) -> None:
    config, disk = tmp_path / "car.yaml", tmp_path / "disk"
    disk.mkdir()
    systemd.next_with("READY")
    config.write_text(f"car: {{plate: NEW1}}\naccess: {{driver_file: {disk}/driver.json}}\n")
    daemon.send_signal(signal.SIGHUP)
    assert "NEW1" in systemd.next_with("READY")["STATUS"]
    (disk / "driver.json").unlink()
    disk.rmdir()

    config.write_text("car: {plate: NEW2}\n")
    daemon.send_signal(signal.SIGHUP)

    assert "NEW2" in systemd.next_with("READY")["STATUS"]
    assert daemon.end() == 0
    assert daemon.log.count("driver.json: cannot be written: No such file or directory") == 2


SILENT_CAMERA = """
car: {{plate: NEW2}}
camera:
  source: http://127.0.0.1:{port}/car
  width_px: 640
  height_px: 360
  focal_x_px: 1600.0
  focal_y_px: 1600.0
  principal_x_px: 320.0
  principal_y_px: 180.0
"""


def test_the_watchdog_is_fed_while_a_new_configuration_waits_for_its_camera(
    daemon: ForkedDaemon, systemd: NotifySocket, tmp_path: Path
) -> None:
    """It opens in a process of its own, which takes longer than the watchdog's timeout."""
    systemd.next_with("READY")
    with socket.create_server(("127.0.0.1", 0)) as camera:
        port = camera.getsockname()[1]
        (tmp_path / "car.yaml").write_text(SILENT_CAMERA.format(port=port))
        daemon.send_signal(signal.SIGHUP)
        systemd.next_with("RELOADING")
        connection, _ = camera.accept()
        with connection:
            fed = [systemd.notification() for _ in range(10)]
    assert fed == [{"WATCHDOG": "1"}] * 10


def test_the_watchdog_is_fed_several_times_in_its_interval_and_not_in_each_step(
    systemd: NotifySocket,
) -> None:
    manager = Systemd({"NOTIFY_SOCKET": systemd.address, "WATCHDOG_USEC": "2000000"})

    for step in range(101):
        manager.feed(5.0 + step * 0.01)

    assert [systemd.notification() for _ in range(3)] == [{"WATCHDOG": "1"}] * 3
    assert systemd.is_empty()


def test_the_watchdog_is_fed_between_the_parts_of_a_start(monkeypatch: pytest.MonkeyPatch) -> None:
    """A reload takes no steps, and longer than a part of it does."""
    order: list[str] = []
    parts = [
        (daemon_module, "read_own_credentials"),
        (daemon_module, "recorded_stack"),
        (OutputSinks, "open_files"),
        (Wires, "open"),
        (OutputSinks, "open_interface"),
        (OutputSinks, "open_page"),
    ]
    for owner, name in parts:
        do = getattr(owner, name)

        def part(*arguments: Any, do: Any = do, name: str = name) -> Any:
            order.append(name)
            return do(*arguments)

        monkeypatch.setattr(owner, name, part)
    manager = Systemd({})
    monkeypatch.setattr(manager, "feed", lambda _: order.append("fed"))

    async def started() -> None:
        order.append("started")

    asyncio.run(
        Daemon(parse_settings({"car": {"plate": "NEW1"}}, CarConfig, "test"), manager).run(started)
    )

    for part_name, following in itertools.pairwise([name for _, name in parts]):
        assert "fed" in order[order.index(part_name) : order.index(following)], following


def test_without_systemd_nothing_is_sent() -> None:
    manager = Systemd({})
    manager.ready("")
    manager.reloading()
    manager.feed(0.0)
    manager.stopping()


def test_an_abstract_socket_is_notified() -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as abstract:
        abstract.bind("")  # The kernel chooses a name.
        name = abstract.getsockname().decode()
        Systemd({"NOTIFY_SOCKET": "@" + name[1:]}).stopping()
        assert abstract.recv(64) == b"STOPPING=1"


def test_a_program_gets_the_events_of_the_daemon(tmp_path: Path) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    config = tmp_path / "car.yaml"
    config.write_text(
        f"car: {{plate: OLD1}}\ninterface: {{port: {port}, accepts: [brake_button]}}\n"
    )
    daemon = ForkedDaemon(config)
    try:
        wait_until(lambda: '"event": "interface"' in daemon.log)
        with socket.create_connection(("127.0.0.1", port), timeout=20.0) as program:
            program.sendall(b'{"kind": "brake_button"}\n')
            kinds = (json.loads(line)["kind"] for line in program.makefile())
            assert next(kinds) == "interface"
            assert "hard_brake" in kinds
    finally:
        daemon.release()
