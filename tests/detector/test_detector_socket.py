"""The detector's socket, on the loopback interface."""

import asyncio
import socket

import pytest

from onboard.detector.detector_socket import DetectorError, open_detector
from onboard.detector.settings import DetectorSettings
from onboard.tools.doctor.detector import examine_detector
from onboard.tools.doctor.finding import Finding, FindingLevel


def taken_port() -> tuple[socket.socket, int]:
    taken = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    taken.bind(("127.0.0.1", 0))
    return taken, int(taken.getsockname()[1])


def free_port() -> int:
    taken, port = taken_port()
    taken.close()
    return port


def is_free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as trial:
        try:
            trial.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True


def test_each_datagram_is_passed_on_unchanged() -> None:
    async def run() -> list[bytes]:
        settings = DetectorSettings(port=free_port())
        received: asyncio.Queue[bytes] = asyncio.Queue()
        wire = await open_detector(settings, received.put_nowait)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as detector:
            for data in (b"{}", b"", b"x" * 20_000):
                detector.sendto(data, (settings.host, settings.port))
        datagrams = [await asyncio.wait_for(received.get(), 10.0) for _ in range(3)]
        wire.close()
        return datagrams

    assert asyncio.run(run()) == [b"{}", b"", b"x" * 20_000]


def test_a_port_in_use_is_an_error_that_names_it() -> None:
    taken, port = taken_port()
    with taken, pytest.raises(DetectorError, match=f"127.0.0.1:{port}"):
        asyncio.run(open_detector(DetectorSettings(port=port), lambda _data: None))


@pytest.mark.parametrize(
    ("data", "level", "detail"),
    [
        (b'{"sent_s": 1.0, "age_s": 0.0, "cars": []}', FindingLevel.GOOD, "1 images"),
        (b"{}", FindingLevel.MISSING, "sent_s"),
        (None, FindingLevel.MISSING, "nothing at port"),
    ],
)
def test_the_doctor_reports_what_it_receives(
    data: bytes | None, level: FindingLevel, detail: str
) -> None:
    async def run() -> list[Finding]:
        settings = DetectorSettings(port=free_port())
        examining = asyncio.create_task(examine_detector(settings, 0.1))
        while is_free(settings.port):
            await asyncio.sleep(0)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as detector:
            if data is not None:
                detector.sendto(data, (settings.host, settings.port))
        return await examining

    (finding,) = asyncio.run(run())
    assert finding.level is level
    assert detail in finding.detail


def test_the_doctor_reports_a_port_in_use() -> None:
    taken, port = taken_port()
    with taken:
        (finding,) = asyncio.run(examine_detector(DetectorSettings(port=port), 0.1))

    assert finding.level is FindingLevel.MISSING
