"""Radio endpoints: real sockets on 127.0.0.1, and a veth pair where permitted."""

import asyncio
import contextlib
import os
import socket
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from ipaddress import IPv4Address

import pytest

from onboard.wave_udp import immediate_forward, wsmp
from onboard.wave_udp.drained_socket import RadioError
from onboard.wave_udp.endpoint import open_endpoint
from onboard.wave_udp.settings import IwcuSettings, RawSettings, Rsu41Settings
from onboard.wave_udp.wsmp import WaveShortMessage

WSM = wsmp.encode(WaveShortMessage(0x20, bytes.fromhex("0380 04 00140100")))


@pytest.fixture
def unit() -> Iterator[socket.socket]:
    """The radio unit's socket."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        wire.bind(("127.0.0.1", 0))
        wire.setsockopt(socket.IPPROTO_IP, socket.IP_RECVTOS, 1)
        wire.settimeout(5.0)
        yield wire


@pytest.fixture
def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        wire.bind(("127.0.0.1", 0))
        return int(wire.getsockname()[1])


def iwcu(unit_port: int, listen_port: int) -> IwcuSettings:
    return IwcuSettings(endpoint="iwcu", unit_port=unit_port, listen_port=listen_port)


async def received(
    settings: IwcuSettings | Rsu41Settings, datagrams: list[bytes], count: int
) -> list[bytes]:
    """Return what an endpoint passes on when `datagrams` are sent to its port."""
    loop = asyncio.get_running_loop()
    got, all_there = [], asyncio.Event()

    def on_wsm(data: bytes) -> None:
        got.append(data)
        if len(got) == count:
            all_there.set()

    with contextlib.closing(open_endpoint(settings, on_wsm)) as endpoint:
        endpoint.start(loop)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as unit:
            for datagram in datagrams:
                unit.sendto(datagram, ("127.0.0.1", settings.listen_port))
        await asyncio.wait_for(all_there.wait(), 10.0)
    return got


@pytest.mark.parametrize("user_priority", range(8))
def test_iwcu_sends_the_wsm_alone_with_its_priority_as_ip_precedence(
    unit: socket.socket, free_port: int, user_priority: int
) -> None:
    with contextlib.closing(open_endpoint(iwcu(unit.getsockname()[1], free_port), print)) as wire:
        wire.send(WSM, user_priority)
        datagram, ancillary, _, _ = unit.recvmsg(65_535, socket.CMSG_SPACE(1))
    assert datagram == WSM
    assert ancillary == [(socket.IPPROTO_IP, socket.IP_TOS, bytes((user_priority << 5,)))]


def test_iwcu_passes_on_datagrams_in_order_malformed_ones_included(free_port: int) -> None:
    datagrams = [WSM, b"", b"garbage", WSM + b"\0"]
    assert asyncio.run(received(iwcu(9, free_port), datagrams, 4)) == datagrams


def test_datagrams_of_another_host_than_the_units_are_not_taken(free_port: int) -> None:
    """On loopback, every address of 127.0.0.0/8 is a host."""
    settings = IwcuSettings(endpoint="iwcu", unit_port=9, listen_port=free_port)

    async def taken() -> list[bytes]:
        got, arrived = [], asyncio.Event()

        def on_wsm(data: bytes) -> None:
            got.append(data)
            arrived.set()

        with contextlib.closing(open_endpoint(settings, on_wsm)) as endpoint:
            endpoint.start(asyncio.get_running_loop())
            for host, datagram in (("127.0.0.2", b"foreign"), ("127.0.0.1", WSM)):
                with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
                    sender.bind((host, 0))
                    sender.sendto(datagram, ("127.0.0.1", free_port))
            await asyncio.wait_for(arrived.wait(), 10.0)
        return got

    assert asyncio.run(taken()) == [WSM]


def test_a_burst_of_2000_is_drained_without_loss(free_port: int) -> None:
    datagrams = [n.to_bytes(4) + bytes(300) for n in range(2000)]

    async def burst() -> list[bytes] | None:
        loop = asyncio.get_running_loop()
        got, all_there = [], asyncio.Event()

        def on_wsm(data: bytes) -> None:
            got.append(data)
            if len(got) == len(datagrams):
                all_there.set()

        with contextlib.closing(open_endpoint(iwcu(9, free_port), on_wsm)) as endpoint:
            endpoint.start(loop)
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as unit:
                for start in range(0, len(datagrams), 100):
                    for datagram in datagrams[start : start + 100]:
                        unit.sendto(datagram, ("127.0.0.1", free_port))
                    await asyncio.sleep(0)
            await asyncio.wait_for(all_there.wait(), 10.0)
        return got

    assert asyncio.run(burst()) == datagrams


def test_an_unreachable_unit_does_not_stop_sending(free_port: int) -> None:
    async def talk() -> bytes:
        got = asyncio.get_running_loop().create_future()
        with contextlib.closing(
            open_endpoint(iwcu(unit_port=9, listen_port=free_port), got.set_result)
        ) as endpoint:
            endpoint.start(asyncio.get_running_loop())
            endpoint.send(WSM, 7)
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as unit:
                unit.sendto(WSM, ("127.0.0.1", free_port))
            return await asyncio.wait_for(got, 10.0)

    assert asyncio.run(talk()) == WSM


@pytest.mark.parametrize(
    "settings",
    [
        IwcuSettings(endpoint="iwcu", unit_port=9, listen_port=1),
        Rsu41Settings(endpoint="rsu41", unit_port=9, listen_port=1),
    ],
    ids=lambda each: each.endpoint,
)
def test_an_unreachable_unit_is_reported_once_a_datagram(
    settings: IwcuSettings | Rsu41Settings, free_port: int
) -> None:
    """An ICMP error wakes the loop once, not again and again."""
    settings = settings.model_copy(update={"listen_port": free_port})

    async def talk() -> tuple[list[str], int]:
        reports = asyncio.Queue[str]()
        loop = asyncio.get_running_loop()
        with contextlib.closing(open_endpoint(settings, print, reports.put_nowait)) as wire:
            wire.start(loop)
            whys = []
            for _ in range(2):
                wire.send(WSM, 7)
                whys.append(await asyncio.wait_for(reports.get(), 10.0))
            for _ in range(20):
                await asyncio.sleep(0)
            return whys, reports.qsize()

    whys, more = asyncio.run(talk())
    assert whys == ["Connection refused"] * 2
    assert more == 0


def test_no_callback_comes_after_close(free_port: int) -> None:
    async def talk() -> list[bytes]:
        got = list[bytes]()

        def receive(data: bytes) -> None:
            got.append(data)
            endpoint.close()

        endpoint = open_endpoint(iwcu(9, free_port), receive)
        endpoint.start(asyncio.get_running_loop())
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as unit:
            for _ in range(3):
                unit.sendto(WSM, ("127.0.0.1", free_port))
        while not got:
            await asyncio.sleep(0)
        for _ in range(10):
            await asyncio.sleep(0)
        return got

    assert asyncio.run(talk()) == [WSM]


def test_a_port_in_use_is_an_error_of_one_line(unit: socket.socket) -> None:
    port = unit.getsockname()[1]
    with pytest.raises(RadioError) as refused:
        open_endpoint(iwcu(9, port), print)
    assert str(refused.value) == (
        f"radio: cannot listen on UDP 127.0.0.1:{port}: Address already in use"
    )


def test_a_foreign_address_is_an_error_of_one_line(free_port: int) -> None:
    settings = Rsu41Settings(
        endpoint="rsu41", listen_host=IPv4Address("192.0.2.1"), listen_port=free_port
    )
    with pytest.raises(RadioError, match=r"192\.0\.2\.1:\d+: Cannot assign requested address"):
        open_endpoint(settings, print)


def test_rsu41_sends_the_text_datagram(unit: socket.socket, free_port: int) -> None:
    settings = Rsu41Settings(
        endpoint="rsu41", unit_port=unit.getsockname()[1], listen_port=free_port
    )
    with contextlib.closing(open_endpoint(settings, print)) as endpoint:
        endpoint.send(WSM, 7)
        message = immediate_forward.decode(unit.recv(65_535))
    assert (message.type, message.psid, message.priority) == ("BSM", 0x20, 7)
    assert message.payload == wsmp.decode(WSM).payload


def test_rsu41_passes_on_forwarded_packets_with_and_without_header(free_port: int) -> None:
    settings = Rsu41Settings(endpoint="rsu41", listen_port=free_port, forwarded_psid=0x20)
    forwarded = [WSM, wsmp.decode(WSM).payload]
    assert asyncio.run(received(settings, forwarded, 2)) == [WSM, WSM]


needs_root = pytest.mark.skipif(os.geteuid() != 0, reason="link-layer sockets need root")


@needs_root
def test_a_missing_interface_is_an_error_of_one_line() -> None:
    with pytest.raises(RadioError) as refused:
        open_endpoint(RawSettings(endpoint="raw", interface="nosuch0"), print)
    assert str(refused.value) == "radio: no interface nosuch0: No such device"


RAW_TALK = textwrap.dedent(
    """
    import asyncio, contextlib, subprocess, sys
    from onboard.wave_udp.endpoint import open_endpoint
    from onboard.wave_udp.settings import RawSettings

    async def talk(wsms):
        loop = asyncio.get_running_loop()
        got, all_there = [], asyncio.Event()

        def on_wsm(data):
            got.append(data)
            if len(got) == len(wsms):
                all_there.set()

        def echo(data):
            sys.exit("a car hears itself")

        with (
            contextlib.closing(open_endpoint(RawSettings(endpoint="raw", interface="car0"), echo))
                as sender,
            contextlib.closing(open_endpoint(RawSettings(endpoint="raw", interface="car1"), on_wsm))
                as receiver,
        ):
            sender.start(loop)
            receiver.start(loop)
            for number, wsm in enumerate(wsms):
                sender.send(wsm, number % 8)
            await asyncio.wait_for(all_there.wait(), 10.0)
            subprocess.run(["ip", "link", "set", "car1", "down"], check=True)
            sender.send(wsms[0], 7)  # lost, as it is on the air
            for _ in range(5):
                await asyncio.sleep(0)
            subprocess.run(["ip", "link", "set", "car1", "up"], check=True)
            all_there.clear()
            got.pop()
            # The kernel carries frames some time after the link is up.
            for _ in range(200):
                sender.send(wsms[-1], 7)
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(all_there.wait(), 0.05)
                    break
            return got[: len(wsms)]

    wsms = [bytes.fromhex(argument) for argument in sys.argv[1:]]
    assert asyncio.run(talk(wsms)) == wsms
    """
)


@needs_root
def test_raw_carries_wsms_over_a_veth_pair_of_any_size_and_priority() -> None:
    make = "ip link add car0 type veth peer name car1 && ip link set car0 up && ip link set car1 up"
    allowed = subprocess.run(["unshare", "-n", "sh", "-c", make], capture_output=True, check=False)
    if allowed.returncode:
        pytest.skip(f"no network namespace with a veth pair here: {allowed.stderr.decode()}")
    wsms = [
        wsmp.encode(WaveShortMessage(0x20, bytes((n,)) + bytes(size)))
        for n, size in enumerate([0, 1, 127, 128, 255, 256, 1400, 300])
    ]
    command = f'{make} && exec "$0" -c "$@"'
    hexes = [wsm.hex() for wsm in wsms]
    talk = subprocess.run(
        ["unshare", "-n", "sh", "-c", command, sys.executable, RAW_TALK, *hexes],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert talk.returncode == 0, talk.stderr
