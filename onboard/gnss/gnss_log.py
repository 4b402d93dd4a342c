"""Recordings of a GNSS receiver: NMEA, gpsd's reports, or its own binary protocol.

gpsd's `gpsdecode` reads UBX, SiRF, RTCM 3 and the other binary protocols; it is part of gpsd.
"""

import re
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from onboard.errors import UserError
from onboard.gnss.gpsd_reader import REPORT_START, GpsdReader
from onboard.gnss.nmea import NmeaReader
from onboard.observations import Discarded, Position

_LOOKED_AT_BYTES = 65_536
"""Start of a file that shows its format."""

_TEXT = bytes({*b"\t\n\r", *range(0x20, 0x7F)})
_NMEA = re.compile(rb"\$[A-Z]{2}(?:RMC|GGA|GNS),")


class GnssLogError(UserError):
    """The recording cannot be read; the text is one line for the user."""


def read_gnss_log(path: Path) -> Iterator[Position | Discarded]:
    """Yield the positions of a recording, stamped with the receiver's UTC in s since 1970.

    What is discarded before the first position gets its stamp.

    Raises:
        GnssLogError: the file cannot be read, is binary and gpsdecode is missing or refuses it, or
            has faults and no position.
    """
    undated: list[Discarded] = []
    began = False
    for event in _events(path):
        if isinstance(event, Discarded) and not began:
            undated.append(event)
            continue
        while undated:
            yield replace(undated.pop(0), stamp_s=event.stamp_s)
        began = True
        yield event
    if undated:
        raise GnssLogError(f"{path}: no position that can be used: {undated[0].detail}")


def _events(path: Path) -> Iterator[Position | Discarded]:
    try:
        with path.open("rb") as log:
            start = log.read(_LOOKED_AT_BYTES)
            log.seek(0)
            if REPORT_START in start:
                yield from _read(GpsdReader(), map(_report, log))
            elif _NMEA.search(start) or not start.translate(None, _TEXT):
                yield from _read(NmeaReader(), log)
            else:
                yield from _decoded(path)
    except OSError as error:
        raise GnssLogError(f"{path}: cannot be read: {error.strerror}") from error


def _report(line: bytes) -> bytes:
    """The line of a report without what gpspipe wrote before it (-t); the last may have no end."""
    return line[max(line.find(REPORT_START), 0) :].removesuffix(b"\n") + b"\n"


def _read(
    reader: GpsdReader | NmeaReader, lines: Iterator[bytes]
) -> Iterator[Position | Discarded]:
    for line in lines:
        reader.receive_bytes(line)
        yield from _taken(reader)
    if isinstance(reader, NmeaReader):
        reader.receive_end()
        yield from _taken(reader)


def _taken(reader: GpsdReader | NmeaReader) -> Iterator[Position | Discarded]:
    while (event := reader.next_event()) is not None:
        yield event


def _decoded(path: Path) -> Iterator[Position | Discarded]:
    """The positions of a binary recording, by gpsdecode."""
    program = shutil.which("gpsdecode")
    if program is None:
        raise GnssLogError(
            f"{path}: is a receiver's binary log, which needs gpsdecode (on Debian in gpsd-clients)"
        )
    with (
        path.open("rb") as log,
        subprocess.Popen(  # noqa: S603 (no shell; the file is its standard input)
            [program, "-j"], stdin=log, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        ) as process,
    ):
        assert process.stdout is not None  # noqa: S101 (a pipe)
        yield from _read(GpsdReader(), process.stdout)
    if process.returncode:
        raise GnssLogError(f"{path}: gpsdecode ended with {process.returncode}")
