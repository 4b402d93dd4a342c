"""Recorded drives are played on the wires of a box, which decides as their replay does."""

import math
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from onboard.errors import UserError
from onboard.recorder.reader import RecordedDrive
from onboard.risk.alarm import Alarm
from onboard.tools.export import write_candump, write_pcap
from onboard.tools.replay import RawRecording
from sim_rig.boxes.played_decisions import DriveSource
from sim_rig.boxes.played_drive import of_black_box
from sim_rig.cars.camera_server import Camera
from sim_rig.cars.camera_view import FPS, calibration
from sim_rig.processes.gpsd import gpsd_program
from sim_rig.reporting.verdict import Outcome
from sim_rig.roads.breakpoints import BreakpointRoad
from sim_rig.runs.play import black_box_source, play_drive, raw_source
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.car_config import DIGEST
from sim_rig.scenario.schema import load_scenario

LIVE = Path(__file__).parents[2] / "drives" / "live.mcap"
WITH_CLOCK = (sys.executable, "-m", "sim_rig.processes.settable_clock")


def free_port(kind: socket.SocketKind) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def box_in(folder: Path, plate: str, *, starts: bool = True, **config: object) -> Path:
    """Write the file of a box, which the rig starts as a daemon on loopback, with a UTC clock."""
    stream, datagram = socket.SOCK_STREAM, socket.SOCK_DGRAM
    bus, camera, unit, own = (free_port(kind) for kind in (stream, stream, datagram, datagram))
    car = {
        "car": {"plate": plate},
        "can": {"port": bus},
        "camera": {"source": f"http://127.0.0.1:{camera}/red"}
        | calibration(load_scenario("fig4").lens).model_dump(),
        "radio": {"endpoint": "iwcu", "listen_port": own, "unit_port": unit},
        "security": {"plate_digest": DIGEST},
        "recorder": {"folder": str(folder / "drive")},
        **config,
    }
    (folder / "car.yaml").write_text(yaml.safe_dump(car))
    start = [*WITH_CLOCK, str(folder / "utc"), "run", str(folder / "car.yaml")]
    box = {
        "plate": plate,
        "bus": {"port": bus},
        "camera": {"port": camera},
        "radio": {"port": unit, "box_port": own},
        "keys": str(folder / "keys"),
        "recording": str(folder / "drive"),
        "set_clock": ["sh", "-c", f"echo {{utc}} > {folder}/utc"],
        "start": start if starts else None,
        "ready_within_s": 30.0 if starts else 0.1,
    }
    (folder / "red.yaml").write_text(yaml.safe_dump(box))
    return folder / "red.yaml"


def played(
    source: DriveSource, file: Path, capsys: pytest.CaptureFixture[str]
) -> tuple[Outcome, str]:
    outcome = play_drive(source, file, file.parent / "out", math.inf)
    printed = capsys.readouterr().out
    if "the rig was late" in printed:
        pytest.skip(printed)
    return outcome, printed


@pytest.mark.live
def test_a_box_decides_on_its_wires_as_the_replay_of_a_signed_recording(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    keys = {"keys_folder": str(tmp_path / "keys" / "red"), "plate_digest": DIGEST}
    file = box_in(tmp_path, "TAG2", security=keys)
    outcome, printed = played(black_box_source([LIVE]), file, capsys)
    assert outcome is Outcome.PASSED
    assert "the same 1 decisions" in printed
    assert "on no wire: lead, plate, vehicle_detection" in printed


@pytest.mark.live
def test_a_box_with_another_plate_than_the_drive_s_is_not_judged(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = box_in(tmp_path, "TAG5")
    outcome = play_drive(black_box_source([LIVE]), file, tmp_path / "out", 2.0)
    assert outcome is Outcome.INVALID
    assert "`car.plate` or `security.plate_digest` of the box" in capsys.readouterr().out


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with what a candump, a camera and a capture recorded of cars in fig4."""
    folder = tmp_path_factory.mktemp("recorded")
    scenario = load_scenario("fig4").model_copy(update={"duration_s": 13.0})
    run_virtual(scenario, recordings_folder=folder / "virtual")
    for car in ("green", "red"):
        (folder / car).mkdir()
        export(RecordedDrive([folder / "virtual" / car]), folder / car)
    camera = Camera(scenario, BreakpointRoad(scenario), "red", np.random.SeedSequence(1))
    (folder / "clip").mkdir()
    for number in range(int(scenario.duration_s * FPS)):
        jpeg = camera.jpeg(number / FPS)
        (folder / "clip" / f"{number:03}.jpg").write_bytes(jpeg)
    return folder


def export(drive: RecordedDrive, folder: Path) -> None:
    with (folder / "bus.log").open("wb") as bus, (folder / "radio.pcap").open("wb") as radio:
        write_candump(drive, bus)
        write_pcap(drive, radio)


@pytest.mark.live
@pytest.mark.parametrize(
    ("car", "kinds", "decision"),
    [("red", "clip pcap", "alarm"), ("green", "pcap", "hard_brake")],
)
def test_a_candump_with_a_clip_or_a_capture_is_decided_as_in_the_replay(
    *,
    recorded: Path,
    car: str,
    kinds: str,
    decision: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    raw = RawRecording(
        can=recorded / car / "bus.log",
        clip=str(recorded / "clip") if "clip" in kinds else None,
        fps=FPS,
        pcap=recorded / car / "radio.pcap" if "pcap" in kinds else None,
    )
    file = box_in(tmp_path, load_scenario("fig4").cars[car].identity)
    source = raw_source(raw, tmp_path / "car.yaml")
    assert decision in {event.kind for event in source.replay()}
    outcome, printed = played(source, file, capsys)
    assert outcome is Outcome.PASSED, printed


@pytest.mark.live
@pytest.mark.skipif(gpsd_program() is None, reason="no gpsd")
def test_a_candump_a_receiver_s_log_and_a_capture_raise_the_alarm_of_the_replay(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario = load_scenario("red-light")
    run_virtual(scenario, recordings_folder=tmp_path / "virtual")
    drive = RecordedDrive([tmp_path / "virtual" / "ann"])
    export(drive, tmp_path)
    fixes = [each.data for each in of_black_box(drive).inputs() if each.wire == "satellites"]
    (tmp_path / "drive.nmea").write_bytes(b"".join(fixes))
    raw = RawRecording(
        can=tmp_path / "bus.log", gnss=tmp_path / "drive.nmea", pcap=tmp_path / "radio.pcap"
    )
    gpsd, receiver = free_port(socket.SOCK_STREAM), free_port(socket.SOCK_DGRAM)
    file = box_in(tmp_path, scenario.cars["ann"].identity, gnss={"port": gpsd})
    box = yaml.safe_load(file.read_text()) | {"satellites": {"port": receiver}}
    file.write_text(yaml.safe_dump(box))
    source = raw_source(raw, tmp_path / "car.yaml")
    assert {"ima"} <= {event.cause for event in source.replay() if isinstance(event, Alarm)}
    command = [gpsd_program() or "gpsd", "-N", "-n", "-S", str(gpsd), f"udp://127.0.0.1:{receiver}"]
    with subprocess.Popen(command) as process:
        try:
            outcome, printed = played(source, file, capsys)
        finally:
            process.terminate()
    assert outcome is Outcome.PASSED, printed


def test_a_wire_that_the_drive_needs_is_named(tmp_path: Path) -> None:
    (tmp_path / "drive.nmea").write_text(
        "$GNRMC,045000.34,A,5606.25716,N,01008.71506,E,30.567,12.00,260721,,,A*7C\r\n"
        "$GNGGA,045000.34,5606.25716,N,01008.71506,E,1,10,1.0,0.0,M,0.0,M,,*4A\r\n"
    )
    source = raw_source(RawRecording(gnss=tmp_path / "drive.nmea"), None)
    with pytest.raises(UserError, match=r"red\.yaml: satellites: is required, since the drive has"):
        play_drive(source, box_in(tmp_path, "TAG2"), tmp_path / "out", 1.0)


def test_a_box_that_is_off_is_named_with_the_wires_that_it_does_not_use(tmp_path: Path) -> None:
    file = box_in(tmp_path, "TAG2", starts=False)
    with pytest.raises(UserError, match=r"red: the box is not ready .* use bus, radio"):
        play_drive(black_box_source([LIVE]), file, tmp_path / "out", 1.0)
