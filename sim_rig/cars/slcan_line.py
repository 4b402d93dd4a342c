"""A serial line or pty to a computer that runs slcand on it: the line is that computer's bus."""

import asyncio
import contextlib
import os
import termios
import tty
from collections.abc import Callable
from pathlib import Path

from onboard.errors import UserError
from onboard.obd.can_frame import CanFrame
from sim_rig.cars import slcan

_RECEIVE_BYTES = 4096


class SlcanLine:
    """Like `CanBus`, by the protocol of serial CAN adapters. What nobody receives is lost."""

    def __init__(self, path: Path, on_frame: Callable[[CanFrame], None]) -> None:
        """Open the line, with the speed that it has.

        Args:
            path: of the line.
            on_frame: gets each data frame.

        Raises:
            UserError: it cannot be opened.
        """
        try:
            self._line = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError as error:
            raise UserError(f"{path}: cannot be opened: {error.strerror}") from error
        try:
            tty.setraw(self._line)
        except termios.error as error:
            os.close(self._line)
            raise UserError(f"{path}: is no serial line") from error
        self._on_frame = on_frame
        self._reader = slcan.SlcanReader()

    def start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Read the line from `loop`."""
        self._loop = loop
        loop.add_reader(self._line, self._receive)

    def send(self, frame: CanFrame) -> None:
        """Send a frame; it is lost if the line is full or gone."""
        with contextlib.suppress(OSError):
            os.write(self._line, slcan.encode(frame))

    def close(self) -> None:
        """Close the line."""
        self._loop.remove_reader(self._line)
        os.close(self._line)

    def _receive(self) -> None:
        try:
            data = os.read(self._line, _RECEIVE_BYTES)
        except BlockingIOError:
            return
        except OSError:  # the other end of a pty is gone
            data = b""
        if not data:
            self._loop.remove_reader(self._line)
        for frame in self._reader.receive_bytes(data, self._loop.time()):
            self._on_frame(frame)
