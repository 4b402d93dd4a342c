"""Exported files, read by python-can and tshark."""

import shutil
import subprocess
import sys
from pathlib import Path

import can
import pytest

from onboard.recorder.reader import RecordedDrive
from onboard.tools.export import write_candump, write_pcap
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.schema import load_scenario


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> RecordedDrive:
    folder = tmp_path_factory.mktemp("drive")
    scenario = load_scenario("fig4").model_copy(update={"duration_s": 4.0})
    run_virtual(scenario, recordings_folder=folder)
    return RecordedDrive([folder / "red"])


def test_python_can_reads_every_exported_can_frame(drive: RecordedDrive, tmp_path: Path) -> None:
    log = tmp_path / "bus.log"
    with log.open("wb") as file:
        count = write_candump(drive, file)

    frames = list(can.LogReader(log))
    recorded = [entry for entry in drive.entries() if entry.topic in ("/in/can", "/out/can")]
    assert len(frames) == count == len(recorded) > 100
    for frame, entry in zip(frames, recorded, strict=True):
        assert frame.arbitration_id == entry.record["arbitration_id"]
        assert frame.is_extended_id == entry.record["is_extended_id"]
        assert frame.data.hex() == entry.record["data"]
        assert frame.timestamp == pytest.approx(entry.utc_s, abs=2e-6)


@pytest.mark.skipif(shutil.which("tshark") is None, reason="needs tshark")
def test_wireshark_reads_every_exported_wsm_without_error(
    drive: RecordedDrive, tmp_path: Path
) -> None:
    pcap = tmp_path / "radio.pcap"
    with pcap.open("wb") as file:
        count = write_pcap(drive, file)

    fields = ["-T", "fields", "-e", "frame.protocols", "-e", "_ws.malformed"]
    dissected = subprocess.run(
        ["tshark", "-r", pcap, *fields], capture_output=True, text=True, check=True
    )
    lines = dissected.stdout.splitlines()
    assert len(lines) == count > 50
    assert all("wsmp" in line and "alformed" not in line for line in lines)


@pytest.mark.long
def test_the_export_command_writes_both_files(drive: RecordedDrive, tmp_path: Path) -> None:
    pcap, log = tmp_path / "radio.pcap", tmp_path / "bus.log"
    command = [sys.executable, "-m", "onboard", "export", *map(str, drive.files)]

    nothing = subprocess.run(command, capture_output=True, text=True, check=False)
    both = subprocess.run(
        [*command, "--pcap", pcap, "--candump", log], capture_output=True, text=True, check=True
    )

    assert nothing.returncode == 2
    assert "give --pcap or --candump" in nothing.stderr
    assert pcap.stat().st_size > 1000
    assert "frames" in both.stdout
    assert len(log.read_text().splitlines()) > 100
