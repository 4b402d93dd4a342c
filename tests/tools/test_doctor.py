"""Findings of the doctor, with simulated devices on 127.0.0.1 and their failures."""

import asyncio
import json
import socket
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from onboard.gnss.settings import GnssSettings
from onboard.kinematics.units import KM_H
from onboard.obd.settings import CanSettings, ObdSettings
from onboard.security.key_files import write_credentials
from onboard.security.security_services import SecurityServices
from onboard.security.settings import PlateDigestSettings, SecuritySettings
from onboard.tools.cli import main
from onboard.tools.doctor import camera, can_bus, computer, gnss_receiver, radio
from onboard.tools.doctor.cli import examine
from onboard.tools.doctor.finding import SUBJECTS, Finding, FindingLevel, best_levels
from onboard.tools.test_ca.authority import make_trial
from onboard.vehicle.config import CarConfig, CarSettings
from onboard.vision.settings import CameraSettings
from onboard.wave_udp import psid, wsmp
from onboard.wave_udp.settings import IwcuSettings
from onboard.wave_udp.wsmp import WaveShortMessage
from sim_rig.cars.camera_server import CameraServer
from sim_rig.cars.camera_view import LENS
from sim_rig.cars.ecu import Ecu
from sim_rig.cars.socketcand_server import SocketcandServer
from sim_rig.rendering.scene import CameraRenderer, Scene
from sim_rig.scenario.schema import load_scenario
from tests.gnss.test_gpsd import REPORT, free_port
from tests.security.trial import ALICE, BOB, UTC_S
from tests.terminal import Ended, Terminal

GOOD, DOUBTFUL, MISSING = FindingLevel.GOOD, FindingLevel.DOUBTFUL, FindingLevel.MISSING
PATIENCE_S = 0.4


def levels(findings: list[Finding]) -> dict[str, FindingLevel]:
    return {finding.subject: finding.level for finding in findings}


# ---- bus and ECU ------------------------------------------------------------------------------


def bus_findings(ecu: Ecu, *, other_traffic: bool = False) -> list[Finding]:
    async def run() -> list[Finding]:
        server = SocketcandServer(ecu, "can0", lambda frame: None)
        port = await server.start()
        can = CanSettings(interface="socketcand", channel="can0", port=port)
        other_node = asyncio.create_task(send_other_traffic(port)) if other_traffic else None
        try:
            # In a loop of its own, since opening a bus blocks.
            examined = can_bus.examine_bus(can, ObdSettings(), PATIENCE_S)
            return await asyncio.to_thread(asyncio.run, examined)
        finally:
            if other_node is not None:
                other_node.cancel()
            await server.close()

    async def send_other_traffic(port: int) -> None:
        """Send frames of another node."""
        _, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(b"< open can0 >< rawmode >")
        try:
            while True:
                writer.write(b"< send 123 2 DE AD >")
                await asyncio.sleep(0.02)
        finally:
            writer.close()

    return asyncio.run(run())


def test_an_ecu_that_answers_is_reported_with_its_speed() -> None:
    findings = bus_findings(Ecu(lambda _now: 50 * KM_H))

    assert levels(findings) == {"bus": GOOD, "ECU": GOOD}
    assert findings[1].detail == "50 km/h from obd:7E8"


def test_for_a_silent_bus_the_advice_is_ignition_and_bit_rate() -> None:
    findings = bus_findings(Ecu(lambda _now: 0.0, runs=lambda _now: False))

    assert levels(findings) == {"bus": MISSING, "ECU": MISSING}
    assert all("ignition" in finding.advice for finding in findings)
    assert "bit rate" in findings[0].advice


def test_for_a_bus_with_traffic_and_no_answer_the_advice_is_another() -> None:
    findings = bus_findings(Ecu(lambda _now: 0.0, runs=lambda _now: False), other_traffic=True)

    assert levels(findings) == {"bus": GOOD, "ECU": MISSING}
    assert "gateway" in findings[1].advice


def test_a_bus_that_cannot_be_opened_is_reported_with_the_error_of_the_system() -> None:
    can = CanSettings(interface="socketcan", channel="nosuchcan9")

    findings = asyncio.run(can_bus.examine_bus(can, ObdSettings(), PATIENCE_S))

    assert levels(findings) == {"bus": MISSING, "ECU": MISSING}
    assert "nosuchcan9 cannot be opened" in findings[0].detail


# ---- camera, light, calibration -----------------------------------------------------------------


def image_folder(folder: Path, draw: Callable[[int], np.ndarray]) -> str:
    for number in range(5):
        cv2.imwrite(str(folder / f"{number}.png"), draw(number))
    return str(folder)


def road(number: int) -> np.ndarray:
    drawn = CameraRenderer(CameraSettings(source="rig", **LENS.model_dump()))
    return drawn.draw(Scene(travelled_m=float(number)), np.random.default_rng(number))


def camera_findings(source: str, fps: float = 15.0, **lens: float) -> dict[str, Finding]:
    settings = CameraSettings(source=source, fps=fps, **(LENS.model_dump() | lens))
    return {finding.subject: finding for finding in camera.examine_camera(settings, PATIENCE_S)}


def test_the_camera_of_the_rig_is_good() -> None:
    async def run() -> list[Finding]:
        scenario = load_scenario("fig4")
        server = CameraServer(scenario, 1)
        port = await server.start()
        source = f"http://127.0.0.1:{port}/red"
        settings = CameraSettings(source=source, **LENS.model_dump())
        try:
            return await asyncio.to_thread(camera.examine_camera, settings, 2.0)
        finally:
            await server.close()

    findings = asyncio.run(run())

    assert levels(findings) | {"camera": GOOD} == dict.fromkeys(
        ("camera", "light", "calibration"), GOOD
    )
    assert findings[0].detail.startswith("640 x 360, ")


@pytest.mark.parametrize(
    ("draw", "subject", "level", "detail"),
    [
        (road, "light", GOOD, "mean grey"),
        (lambda number: road(1), "camera", MISSING, "all equal"),
        (lambda number: road(number) // 8, "light", DOUBTFUL, "mean grey"),
        (lambda number: 255 - road(number) // 8, "light", DOUBTFUL, "mean grey"),
        (lambda number: cv2.blur(road(number), (9, 1)), "camera", DOUBTFUL, "blurred"),
        (lambda number: np.full((360, 640, 3), number, np.uint8), "light", MISSING, "one colour"),
        (
            lambda number: road(number)[:, :480],
            "calibration",
            MISSING,
            "the camera sends 480 x 360",
        ),
    ],
)
def test_findings_from_images(
    tmp_path: Path,
    draw: Callable[[int], np.ndarray],
    subject: str,
    level: FindingLevel,
    detail: str,
) -> None:
    finding = camera_findings(image_folder(tmp_path, draw))[subject]

    assert finding.level is level
    assert detail in finding.detail
    assert bool(finding.advice) == (level is not GOOD)


def test_a_low_frame_rate_is_doubtful(tmp_path: Path) -> None:
    assert camera_findings(image_folder(tmp_path, road), fps=5.0)["camera"].level is DOUBTFUL


def test_a_camera_whose_images_cannot_be_decoded_is_missing(tmp_path: Path) -> None:
    (tmp_path / "0.jpg").write_bytes(b"\xff\xd8 not really")

    findings = camera_findings(str(tmp_path))

    assert findings["camera"].detail == "no image can be decoded"
    assert findings["light"].level is MISSING


def test_without_a_camera_the_calibration_is_still_reported() -> None:
    findings = camera_findings("/dev/video77")

    assert {name: each.level for name, each in findings.items()} == {
        "camera": MISSING,
        "light": MISSING,
        "calibration": GOOD,
    }


def test_a_camera_without_a_calibration_is_doubtful(tmp_path: Path) -> None:
    settings = CameraSettings(source=image_folder(tmp_path, road))

    finding = camera.examine_camera(settings, PATIENCE_S)[-1]

    assert finding.level is DOUBTFUL
    assert finding.detail.startswith("default values: ")


# ---- gpsd ---------------------------------------------------------------------------------------


def gnss_finding(report: bytes) -> Finding:
    async def run() -> Finding:
        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            writer.write(report)
            await reader.read()
            writer.close()
            closed.set()

        closed = asyncio.Event()
        server = await asyncio.start_server(serve, "127.0.0.1", 0)
        gnss = GnssSettings(port=server.sockets[0].getsockname()[1])
        async with server:
            (finding,) = await gnss_receiver.examine_gnss_receiver(gnss, PATIENCE_S)
            await closed.wait()
            return finding

    return asyncio.run(run())


@pytest.mark.parametrize(
    ("report", "level", "detail"),
    [
        (REPORT, GOOD, "fix, good to 2.0 m"),
        (REPORT.replace(b"4.9", b"49"), DOUBTFUL, "fix, good to 20.0 m"),
        (b'{"class":"TPV","mode":1}\r\n', MISSING, "no fix"),
    ],
)
def test_a_fix_is_reported_with_its_accuracy(
    report: bytes, level: FindingLevel, detail: str
) -> None:
    finding = gnss_finding(report)

    assert finding.level is level
    assert finding.detail.startswith(detail)


def test_a_missing_gpsd_is_distinguished_from_a_missing_fix() -> None:
    gnss = GnssSettings(port=free_port())

    (finding,) = asyncio.run(gnss_receiver.examine_gnss_receiver(gnss, PATIENCE_S))

    assert finding.level is MISSING
    assert finding.detail.endswith("Connection refused")
    assert "systemctl start gpsd" in finding.advice


# ---- radio --------------------------------------------------------------------------------------


def radio_finding(unit_port: int, listen_port: int, *, message_count: int = 0) -> Finding:
    settings = IwcuSettings(endpoint="iwcu", unit_port=unit_port, listen_port=listen_port)

    async def run() -> Finding:
        examined = asyncio.create_task(radio.examine_radio(settings, PATIENCE_S))
        await asyncio.sleep(PATIENCE_S / 4)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as unit:
            for _ in range(message_count):
                unit.sendto(b"a message", ("127.0.0.1", listen_port))
        (finding,) = await examined
        return finding

    return asyncio.run(run())


def test_a_unit_with_messages_is_good_and_a_silent_one_doubtful() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as unit:
        unit.bind(("127.0.0.1", 0))
        unit_port = unit.getsockname()[1]

        received = radio_finding(unit_port, free_port(socket.SOCK_DGRAM), message_count=3)
        silent = radio_finding(unit_port, free_port(socket.SOCK_DGRAM))

        assert (received.level, received.detail[:10]) == (GOOD, "3 messages")
        assert silent.level is DOUBTFUL
        # Only empty datagrams were sent, which the unit cannot transmit.
        unit.setblocking(False)
        assert {unit.recv(100) for _ in range(4)} == {b""}


def signed_frames(ahead_s: float) -> list[bytes]:
    """WSMs of two vehicles whose clocks are ahead of `UTC_S`."""
    senders = [SecurityServices(UTC_S + ahead_s, keys) for keys in (ALICE, BOB)]
    return [
        wsmp.encode(WaveShortMessage(psid.BSM, sender.secure(b"bsm", psid.BSM, 0.0)))
        for sender in senders
    ]


@pytest.mark.parametrize("ahead_s", [600.0, -600.0])
def test_messages_of_several_vehicles_show_that_the_clock_is_wrong(ahead_s: float) -> None:
    frames = [b"noise", *signed_frames(ahead_s)]

    assert radio.clock_error_s(frames, UTC_S) == pytest.approx(-ahead_s, abs=0.001)
    assert radio.clock_error_s(frames[:2], UTC_S) is None


def test_messages_of_now_show_no_error_of_the_clock() -> None:
    assert radio.clock_error_s(signed_frames(1.0), UTC_S) is None


def test_a_unit_whose_host_refuses_is_missing() -> None:
    finding = radio_finding(free_port(socket.SOCK_DGRAM), free_port(socket.SOCK_DGRAM))

    assert finding.level is MISSING
    assert "Connection refused" in finding.detail


def test_a_port_in_use_is_reported_with_the_advice_to_stop_the_daemon() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as running:
        running.bind(("127.0.0.1", 0))
        finding = radio_finding(1, running.getsockname()[1])

    assert finding.level is MISSING
    assert "systemctl stop onboard" in finding.advice


# ---- the computer -------------------------------------------------------------------------------


def test_authenticated_sources_of_time_are_counted() -> None:
    authdata = (
        "192.0.2.1,NTS,1,15,256,1200,0,0,8,100\n"
        "192.0.2.2,NTS,0,0,0,4294967295,3,0,0,0\n"
        "192.0.2.3,-,0,0,0,4294967295,0,0,0,0\n"
    )
    assert computer.nts_sources(authdata) == "1 of 3 sources authenticated (NTS)"


@pytest.mark.parametrize(
    ("properties", "text"),
    [
        (
            "Nice=-5\nCPUAffinity=\nLoadState=loaded\n",
            ", niceness -5, its camera 10, on processors: all",
        ),
        (
            "Nice=12\nCPUAffinity=1-3\nLoadState=loaded\n",
            ", niceness 12, its camera 12, on processors: 1-3",
        ),
        ("Nice=0\nCPUAffinity=\nLoadState=not-found\n", ""),
        ("", ""),
    ],
)
def test_the_priority_that_the_unit_gives_is_shown(properties: str, text: str) -> None:
    assert computer.service_priority(properties) == text


def test_a_clock_earlier_than_the_installation_is_wrong() -> None:
    assert computer.examine_clock(0.0).level is MISSING
    assert computer.examine_clock(time.time()).level is not MISSING


def test_folders_are_tested_for_writing(tmp_path: Path) -> None:
    writable, missing = computer.examine_disk([tmp_path, tmp_path / "missing"])

    assert writable.level is not MISSING
    assert (missing.level, missing.detail.endswith("No such file or directory")) == (MISSING, True)
    assert levels(computer.examine_disk([])) == {"disk": FindingLevel.NOT_CONFIGURED}


def test_limits_of_the_free_space(tmp_path: Path) -> None:
    expected = {100 << 20: MISSING, 1 << 30: DOUBTFUL, 10 << 30: GOOD}

    assert {
        free: computer.examine_free_space(tmp_path, free).level for free in expected
    } == expected


def test_keys_that_are_not_valid_now_are_missing(tmp_path: Path) -> None:
    now = time.time()
    (credentials,) = make_trial(["car"], {0x20}, now).values()
    write_credentials(tmp_path / "car", credentials)
    digest = PlateDigestSettings.model_validate({"community_key": "our own trial's key"})
    security = SecuritySettings(keys_folder=tmp_path / "car", plate_digest=digest)
    (valid,) = computer.examine_keys(security, "OWN1", now)
    (expired,) = computer.examine_keys(security, "OWN1", now + 10 * 365 * computer.DAY_S)

    assert valid.level is not MISSING
    assert (expired.level, expired.detail.endswith("none valid now")) == (MISSING, True)


def test_unsigned_messages_missing_keys_and_the_public_community_key() -> None:
    unsigned, public = computer.examine_keys(SecuritySettings(), "OWN1", 0.0)
    lost, _ = computer.examine_keys(SecuritySettings(keys_folder=Path("/nonexistent")), "OWN1", 0.0)

    assert (unsigned.level, public.level, lost.level) == (DOUBTFUL, DOUBTFUL, MISSING)


# ---- the command --------------------------------------------------------------------------------


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Terminal:
    return Terminal("onboard", main, monkeypatch, capsys)


def examined(terminal: Terminal, config: Path, *options: str) -> Ended:
    return terminal.run("doctor", config, "--patience", "0.3", *options)


def test_without_any_connection_every_connection_is_reported_as_not_configured() -> None:
    found = levels(asyncio.run(examine(CarConfig(car=CarSettings(plate="A1")), PATIENCE_S)))

    table = best_levels(())
    assert found.keys() == table.keys()
    assert {
        subject for subject, level in found.items() if level is FindingLevel.NOT_CONFIGURED
    } == {
        *(subjects[0] for subjects in SUBJECTS.values()),
        "disk",
    }


@pytest.mark.long
def test_the_command_fails_if_something_is_missing_and_gives_advice(
    terminal: Terminal, tmp_path: Path
) -> None:
    config = tmp_path / "car.yaml"
    tree = {"car": {"plate": "A1"}, "gnss": {"port": free_port()}, "obd": {}}
    config.write_text(yaml.safe_dump(tree))

    result = examined(terminal, config)

    assert result.returncode == 1, result.stderr
    assert "gpsd        missing" in result.stdout
    assert "-> `systemctl start gpsd`" in result.stdout
    assert "bus         not configured" in result.stdout


def test_json_output_and_doubtful_findings_are_no_failure(
    terminal: Terminal, tmp_path: Path
) -> None:
    config = tmp_path / "car.yaml"
    config.write_text("car: {plate: A1}\n")

    result = examined(terminal, config, "--json")

    assert result.returncode == 0, result.stderr
    findings = json.loads(result.stdout)
    assert {tuple(finding) for finding in findings} == {("subject", "level", "detail", "advice")}
    assert {finding["level"] for finding in findings} <= {"good", "doubtful", "not configured"}
