"""Real drives: every speed, at its stamp, and no false hard braking."""

import csv
from collections import Counter
from functools import cache
from pathlib import Path

import can
import isotp
import numpy as np
import pytest
from numpy.typing import NDArray

from onboard.kinematics.units import KM_H
from onboard.obd.can_frame import CanFrame
from onboard.obd.can_log import read_can_log
from onboard.obd.dbc_file import read_signals
from onboard.obd.settings import BroadcastSettings, ObdSettings
from onboard.obd.vehicle_bus import BusEvent, VehicleBus
from onboard.observations import Discarded, HardBrake, Speed
from tests.typed import every

pytestmark = pytest.mark.realdata

LISTENING = ObdSettings(polling_hz=None)


@cache
def frames_of(path: Path) -> list[CanFrame]:
    return list(read_can_log(path))


def events_of(path: Path, settings: ObdSettings = LISTENING) -> list[BusEvent]:
    bus = VehicleBus(settings, read_signals(settings.broadcast))
    events: list[BusEvent] = []
    for frame in frames_of(path):
        bus.receive_frame(frame, frame.stamp_s)
        while (event := bus.next_event()) is not None:
            events.append(event)
    return events


def columns(path: Path, *names: str) -> list[NDArray[np.float64]]:
    with path.open(encoding="ascii") as file:
        rows = list(csv.DictReader(file))
    return [np.array([float(row[name]) for row in rows]) for name in names]


def test_drive_a_gives_every_speed_at_its_stamp(rig_data: Path) -> None:
    stamps, km_h = columns(rig_data / "can" / "drive-a-obd-speed-kmh.csv", "t", "obd_kmh")
    speeds = every(Speed, events_of(rig_data / "can" / "drive-a.log"))
    assert [speed.stamp_s for speed in speeds] == pytest.approx(stamps.tolist(), abs=1e-6)
    assert [speed.speed_m_s / KM_H for speed in speeds] == pytest.approx(km_h.tolist())


def test_drive_a_agrees_with_the_gnss_receiver(rig_data: Path) -> None:
    stamps, truth_m_s = columns(rig_data / "can" / "drive-a-gnss-speed-mps.csv", "t", "gnss_mps")
    speeds = every(Speed, events_of(rig_data / "can" / "drive-a.log"))
    ours = np.interp(stamps - 0.4, [s.stamp_s for s in speeds], [s.speed_m_s for s in speeds])
    assert np.sqrt(np.mean((ours - truth_m_s) ** 2)) < 0.5


@pytest.mark.long
@pytest.mark.parametrize(
    ("drive", "speeds"),
    [("drive-a", 1203), ("drive-b-requests-and-answers", 273), ("drive-c", 1090)],
)
def test_real_drives_have_no_false_hard_braking_and_no_error(
    rig_data: Path, drive: str, speeds: int
) -> None:
    """The hardest braking in them is 0.23 g, by the speeds themselves."""
    kinds = Counter(type(event) for event in events_of(rig_data / "can" / f"{drive}.log"))
    assert kinds == {Speed: speeds}


def test_a_real_drive_has_hard_braking_above_a_low_threshold(rig_data: Path) -> None:
    sensitive = ObdSettings(polling_hz=None, hard_brake_threshold_g=0.1)
    alarms = [
        event
        for event in events_of(rig_data / "can" / "drive-c.log", sensitive)
        if isinstance(event, HardBrake)
    ]
    assert alarms
    assert all(alarm.deceleration_m_s2 < 3.0 for alarm in alarms)


def test_a_bus_without_obd_has_no_speed(rig_data: Path) -> None:
    assert events_of(rig_data / "can" / "no-obd.log") == []


@pytest.mark.parametrize("drive", ["drive-a", "drive-b-requests-and-answers", "drive-c"])
def test_messages_are_those_that_can_isotp_reads(rig_data: Path, drive: str) -> None:
    """Both read all messages of the ECU in the whole drive."""
    frames = [
        frame
        for frame in frames_of(rig_data / "can" / f"{drive}.log")
        if frame.arbitration_id == 0x7E8
    ]
    waiting = iter(
        isotp.CanMessage(arbitration_id=frame.arbitration_id, data=frame.data) for frame in frames
    )
    theirs = isotp.TransportLayerLogic(
        rxfn=lambda timeout: next(waiting, None),
        txfn=lambda message: None,
        address=isotp.Address(isotp.AddressingMode.Normal_11bits, rxid=0x7E8, txid=0x7E0),
    )
    theirs.process()
    payloads = []
    while (payload := theirs.recv()) is not None:
        payloads.append(bytes(payload))
    assert len(payloads) == len(frames)  # none of these drives has a long message
    speeds = [payload[2] for payload in payloads if payload[:2] == b"\x41\x0d"]
    ours = every(Speed, events_of(rig_data / "can" / f"{drive}.log"))
    assert [round(speed.speed_m_s / KM_H) for speed in ours] == speeds


def test_a_broadcast_speed_is_read_by_its_name(rig_data: Path) -> None:
    """The GNSS box on the second bus of the drive, by its maker's DBC file."""
    settings = ObdSettings(
        polling_hz=None,
        broadcast=BroadcastSettings(
            dbc=rig_data / "can" / "canmod-gps.dbc", speed=("gnss_speed.Speed",)
        ),
    )
    stamps, truth_m_s = columns(rig_data / "can" / "drive-a-gnss-speed-mps.csv", "t", "gnss_mps")
    speeds = [
        event
        for event in events_of(rig_data / "can" / "drive-a.log", settings)
        if isinstance(event, Speed) and event.source == "dbc:gnss_speed.Speed"
    ]
    assert [speed.stamp_s for speed in speeds] == pytest.approx(stamps.tolist(), abs=1e-6)
    assert [speed.speed_m_s for speed in speeds] == pytest.approx(truth_m_s.tolist())
    assert speeds[0].resolution_m_s == 0.001


@pytest.mark.long
@pytest.mark.parametrize("suffix", [".asc", ".blf", ".trc"])
def test_a_real_drive_gives_the_same_in_other_formats(
    rig_data: Path, tmp_path: Path, suffix: str
) -> None:
    source = rig_data / "can" / "drive-a.log"
    messages = [m for m in can.LogReader(source) if m.arbitration_id == 0x7E8][:2000]
    path = tmp_path / f"drive{suffix}"
    with can.Logger(path) as log:
        for message in messages:
            message.channel = 1
            log.on_message_received(message)
    written = every(Speed, events_of(path))
    read = every(Speed, events_of(source))[: len(written)]
    assert [each.speed_m_s for each in written] == [each.speed_m_s for each in read]
    assert len(written) > 300


def test_a_drive_with_damaged_lines_loses_only_those(rig_data: Path, tmp_path: Path) -> None:
    lines = (rig_data / "can" / "drive-a.log").read_text(encoding="ascii").splitlines()
    answers = [line for line in lines if " 7E8#" in line]
    damaged = [line[:20] if n % 10 == 0 else line for n, line in enumerate(answers)]
    path = tmp_path / "damaged.log"
    path.write_text("\n".join(damaged), encoding="ascii")
    discarded: list[Discarded] = []
    frames = list(read_can_log(path, on_discarded=discarded.append))
    assert len(discarded) == sum(n % 10 == 0 for n in range(len(answers)))
    assert len(frames) == len(answers) - len(discarded)
    intact = sum("7E8#03410D" in line for line in damaged)
    assert Counter(type(event) for event in events_of(path)) == {Speed: intact}
