"""Exports recordings to other formats: pcap of the radio, candump of the CAN bus."""

from typing import BinaryIO

from onboard.obd.can_frame import CanFrame
from onboard.recorder.inputs import as_input
from onboard.recorder.reader import RecordedDrive
from onboard.wave_udp.capture import OTHER_MAC, OWN_MAC, PcapWriter

_SENDERS = {"/in/wsm": OTHER_MAC, "/out/wsm": OWN_MAC}


def write_pcap(drive: RecordedDrive, file: BinaryIO) -> int:
    """Write every WSM, sent or received, and return their number."""
    pcap = PcapWriter(file)
    count = 0
    for entry in drive.entries():
        if entry.topic in _SENDERS:
            pcap.write(bytes.fromhex(entry.record["data"]), entry.utc_s, _SENDERS[entry.topic])
            count += 1
    return count


def write_candump(drive: RecordedDrive, file: BinaryIO) -> int:
    """Write every CAN frame, sent or received, as `candump -l` does; return their number.

    Time stamps are the UTC times of the steps of the cores that received or sent the frames.
    """
    count = 0
    for entry in drive.entries():
        if entry.topic in ("/in/can", "/out/can"):
            frame = as_input(entry)
            assert isinstance(frame, CanFrame)  # noqa: S101 (the kind of these topics)
            file.write(_candump_line(frame, entry.utc_s).encode())
            count += 1
    return count


def _candump_line(frame: CanFrame, utc_s: float) -> str:
    digits = 8 if frame.is_extended_id else 3
    is_fd = len(frame.data) > 8
    mark = "##0" if is_fd else "#"  # CAN FD has flags here, which are not recorded
    data = frame.data.hex().upper()
    return f"({utc_s:.6f}) can0 {frame.arbitration_id:0{digits}X}{mark}{data}\n"
