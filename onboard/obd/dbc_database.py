"""Parses DBC text with cantools."""

from typing import Any

import cantools

from onboard.errors import UserError


def parse_dbc(text: str, dbc: str) -> Any:
    """Return the database.

    Args:
        text: content of the file, read as Latin-1.
        dbc: name of the file, for errors.

    Raises:
        UserError: it is no DBC file.
    """
    try:
        # DBC files are written in Windows-1252.
        decoded = text.encode("latin-1").decode("cp1252")
        return cantools.database.load_string(decoded, database_format="dbc")
    except (cantools.Error, ValueError) as error:
        raise UserError(f"{dbc}: no DBC file: {' '.join(str(error).split())}") from error
