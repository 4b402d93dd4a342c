"""Recordings of a CAN bus: candump, ASC, BLF, TRC and the other formats of python-can.

A file named `.log`, `.txt` or without ending is recognised by its content, others by their ending.
ASC and `candump -tA` state local time without a zone: that of this computer (TZ) is assumed.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from datetime import datetime
from itertools import islice
from pathlib import Path
from typing import Any, TextIO

import can
from can.io.player import MESSAGE_READERS

from onboard.errors import UserError
from onboard.obd.can_frame import CanFrame
from onboard.observations import Discarded

_BY_CONTENT = frozenset({".log", ".txt", ""})

_READERS: Mapping[bytes, Callable[..., Any]] = {
    b"LOGG": can.BLFReader,
    b"SQLite format 3": can.SqliteReader,
    b"date ": can.ASCReader,
    b";$FILEVERSION": can.TRCReader,
}
"""Readers by the first bytes of a file; candump has none."""

_SCREEN_LINE = re.compile(
    r"\s*(?:\((?P<stamp>[\d .:-]+)\)\s+)?(?P<channel>\S+)(?:\s+[RT]X\s+\S\s+\S)?"
    r"\s+(?P<id>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})\s+\[(?P<size>\d+)\]\s+(?P<data>.*)"
)
"""A line as candump prints it without -L: `(10.05)  can0  7E8   [4]  03 41 0D 32`."""

_LINES_TO_RECOGNISE = 20

_ABSOLUTE_FROM_S = 1e9
"""Stamps below count from the start of the recording, or from the line before (candump -td)."""

_LATEST_S = 1e11
"""Three thousand years: a larger stamp is no time."""

_DISORDER_S = 1e-3
"""Greatest step back between lines: candump reads several buses in turn."""


class CanLogError(UserError):
    """The recording cannot be read; the text is one line for the user."""


def ignore(_: Discarded) -> None:
    """Discard without counting."""


def read_can_log(
    path: Path,
    channel: str | None = None,
    on_discarded: Callable[[Discarded], None] = ignore,
) -> Iterator[CanFrame]:
    """Yield the data frames of a recording, with its own stamps in s.

    An unreadable line of candump's, and a frame whose stamp is no time, are discarded with reason
    `log_line`, and reading continues.

    Args:
        path: of the recording.
        channel: the only one to read; `None` reads all.
        on_discarded: gets what is discarded.

    Raises:
        CanLogError: there is no such file, or its format is unknown, broken or without stamps.
    """
    if not path.is_file():  # before python-can judges the name
        raise CanLogError(f"{path}: no such file")
    try:
        stamp_s = 0.0
        for message in _messages(path, on_discarded):
            if not abs(message.timestamp) < _LATEST_S:
                detail = f"time stamp {message.timestamp}"
                on_discarded(Discarded(stamp_s, "obd", "log_line", detail))
                continue
            stamp_s = message.timestamp
            is_data = not (message.is_error_frame or message.is_remote_frame)
            if is_data and channel in {None, str(message.channel)}:
                yield frame_of(message, message.timestamp)
    except OSError as error:
        raise CanLogError(f"{path}: cannot be read: {error.strerror or error}") from error
    except CanLogError:
        raise
    except Exception as error:  # each format's reader raises its own types
        known = f"; known are {', '.join(sorted(MESSAGE_READERS))}"
        what = f"{error}{'' if path.suffix in MESSAGE_READERS else known}"
        raise CanLogError(f"{path}: unreadable CAN log: {what}") from error


def frame_of(message: can.Message, stamp_s: float) -> CanFrame:
    """Return the data frame of python-can's `message`, received at `stamp_s`."""
    return CanFrame(stamp_s, message.arbitration_id, message.is_extended_id, bytes(message.data))


def _messages(path: Path, on_discarded: Callable[[Discarded], None]) -> Iterator[can.Message]:
    open_reader: Callable[..., Any] | None = can.LogReader
    if path.suffix.lower() in _BY_CONTENT:
        with path.open("rb") as file:
            head = file.read(16)
        open_reader = next(
            (reader for magic, reader in _READERS.items() if head.startswith(magic)), None
        )
    if open_reader is not None:
        with open_reader(path, relative_timestamp=False) as messages:
            yield from messages
        return
    with path.open(encoding="ascii", errors="replace") as file:
        read = _screen_lines if _is_from_screen(path, file) else _log_lines
        yield from read(path, file, on_discarded)


def _is_from_screen(path: Path, file: TextIO) -> bool:
    """Whether one of the first lines is as candump prints it without -L; then rewinds.

    Raises:
        CanLogError: that line has no time stamp.
    """
    lines = islice(file, _LINES_TO_RECOGNISE)
    first = next(filter(None, map(_SCREEN_LINE.match, lines)), None)
    if first is not None and first["stamp"] is None:
        raise CanLogError(f"{path}: candump without time stamps; record with candump -L")
    file.seek(0)
    return first is not None


def _log_lines(
    path: Path, file: TextIO, on_discarded: Callable[[Discarded], None]
) -> Iterator[can.Message]:
    stamp_s: float | None = None
    bad_lines = 0
    while not file.closed:
        try:
            # The reader ends at a bad line, and the next one continues after it.
            for message in can.CanutilsLogReader(file):
                stamp_s = message.timestamp
                yield message
        except (ValueError, IndexError) as error:
            bad_lines += 1
            on_discarded(Discarded(stamp_s or 0.0, "obd", "log_line", str(error)))
    if bad_lines and stamp_s is None:
        raise CanLogError(f"{path}: no line has the format of candump")


def _screen_lines(
    path: Path, file: TextIO, on_discarded: Callable[[Discarded], None]
) -> Iterator[can.Message]:
    stamp_s = 0.0
    for line in filter(str.strip, file):
        try:
            message = _from_screen(line)
        except ValueError as error:
            on_discarded(Discarded(stamp_s, "obd", "log_line", str(error)))
            continue
        if message.timestamp < min(stamp_s - _DISORDER_S, _ABSOLUTE_FROM_S):
            raise CanLogError(f"{path}: time runs backwards (candump -td?); record with candump -L")
        stamp_s = message.timestamp
        yield message


def _from_screen(line: str) -> can.Message:
    """Return the message of a line.

    Raises:
        ValueError: it is none.
    """
    match = _SCREEN_LINE.match(line)
    if match is None or match["stamp"] is None:
        raise ValueError(f"not as candump prints it: {line.strip()}")
    size, data = int(match["size"]), match["data"].rstrip()
    is_remote = data.startswith("remote")
    octets = b"" if is_remote else bytes.fromhex("".join(data.split()[:size]))
    if not is_remote and len(octets) != size:
        raise ValueError(f"{len(octets)} of {size} bytes")
    return can.Message(
        timestamp=_stamp_s(match["stamp"]),
        arbitration_id=int(match["id"], 16) & 0x1FFF_FFFF,
        is_extended_id=len(match["id"]) > 3,
        is_remote_frame=is_remote,
        is_error_frame=data.endswith("ERRORFRAME"),
        data=octets,
        channel=match["channel"],
    )


def _stamp_s(text: str) -> float:
    """Seconds, or a date in local time (`candump -tA`)."""
    return datetime.fromisoformat(text).timestamp() if ":" in text else float(text)
