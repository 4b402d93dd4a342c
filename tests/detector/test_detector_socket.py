"""The wire to the detector, on the loopback."""

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


def test_each_datagram_is_handed_over_as_it_came() -> None:
    async def run() -> list[bytes]:
        settings = DetectorSettings(port=free_port())
        came: asyncio.Queue[bytes] = asyncio.Queue()
        wire = await open_detector(settings, came.put_nowait)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as detector:
            for data in (b"{}", b"", b"x" * 20_000):
                detector.sendto(data, (settings.host, settings.port))
        handed = [await asyncio.wait_for(came.get(), 10.0) for _ in range(3)]
        wire.close()
        return handed

    assert asyncio.run(run()) == [b"{}", b"", b"x" * 20_000]


def test_a_port_that_another_has_is_the_user_s_to_know() -> None:
    taken, port = taken_port()
    with taken, pytest.raises(DetectorError, match=f"127.0.0.1:{port}"):
        asyncio.run(open_detector(DetectorSettings(port=port), lambda _data: None))


@pytest.mark.parametrize(
    ("data", "verdict", "says"),
    [
        (b'{"sent_s": 1.0, "age_s": 0.0, "cars": []}', FindingLevel.GOOD, "1 pictures"),
        (b"{}", FindingLevel.MISSING, "sent_s"),
        (None, FindingLevel.MISSING, "nothing at port"),
    ],
)
def test_the_doctor_listens_to_it(data: bytes | None, verdict: FindingLevel, says: str) -> None:
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
    assert finding.verdict is verdict
    assert says in finding.detail


def test_the_doctor_says_who_has_the_port() -> None:
    taken, port = taken_port()
    with taken:
        (finding,) = asyncio.run(examine_detector(DetectorSettings(port=port), 0.1))

    assert finding.verdict is FindingLevel.MISSING
