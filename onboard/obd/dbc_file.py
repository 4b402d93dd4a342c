"""Reads the DBC file of the configuration."""

from pathlib import Path
from typing import TYPE_CHECKING

from onboard.errors import UserError
from onboard.obd.settings import BroadcastSettings

if TYPE_CHECKING:
    from onboard.obd.broadcast import BroadcastSignals


def read_signals(settings: BroadcastSettings | None) -> "BroadcastSignals | None":
    """Read the signals that the vehicle broadcasts; `None` if the settings name no DBC file.

    Raises:
        UserError: the file cannot be read, or `BroadcastSignals` finds a mistake in it.
    """
    if settings is None:
        return None
    return parse_signals(settings, read_dbc(settings.dbc))


def read_dbc(dbc: Path) -> str:
    """Read a DBC file as Latin-1, which no file violates.

    Raises:
        UserError: it cannot be read.
    """
    try:
        return dbc.read_text("latin-1")
    except OSError as error:
        raise UserError(f"{dbc}: cannot be read: {error.strerror}") from error


def parse_signals(settings: BroadcastSettings, dbc_text: str) -> "BroadcastSignals":
    """Return the signals of a DBC file that was read before.

    Raises:
        UserError: as `BroadcastSignals`.
    """
    # The DBC parser's import takes a tenth of a start, and few vehicles have a DBC file.
    from onboard.obd.broadcast import BroadcastSignals  # noqa: PLC0415 (see above)

    return BroadcastSignals(settings, dbc_text)
