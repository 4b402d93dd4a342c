"""The lines of a DBC file that declare named signals (Vector, DBC file format 1.0).

Public DBC files have faults, such as overlapping signals, in messages that the vehicle's
configuration does not name; those do not matter to the named ones.
"""

import re
from collections.abc import Iterable, Iterator

_MESSAGE = re.compile(r"BO_\s+(?P<id>\d+)\s+(?P<name>\w+)\s*:")
_SIGNAL = re.compile(r"\s*SG_\s+(?P<name>\w+)\s*(?P<multiplexing>M|m\d+M?)?\s*:")
_SIGNAL_TYPE = re.compile(r"SIG_VALTYPE_\s+(?P<id>\d+)\s+(?P<name>\w+)")
_MULTIPLEXING = re.compile(r"SG_MUL_VAL_\s+(?P<id>\d+)\s+(?P<name>\w+)\s+(?P<by>\w+)")

_HEAD = 'VERSION ""\nNS_ :\nBS_:\nBU_:\n'


def excerpt(dbc_text: str, names: Iterable[str]) -> str | None:
    """Return a DBC file of the named signals, and of the multiplexed ones in their messages.

    A frame could not be decoded without those that are multiplexed into it.

    Args:
        dbc_text: content of the DBC file.
        names: of signals, as `Message.Signal`.

    Returns:
        The text; `None` without names, or if one is not declared or declared twice.
    """
    named = dict.fromkeys(names)
    messages = {name.partition(".")[0] for name in named}
    found: list[str] = []
    kept: set[tuple[str, str]] = set()
    lines = [_HEAD]
    for message, line in _declarations(dbc_text):
        if message["name"] not in messages:
            continue
        signal = _SIGNAL.match(line)
        if signal is None:
            lines.append(line)
            continue
        name = f"{message['name']}.{signal['name']}"
        if name in named:
            found.append(name)
        elif signal["multiplexing"] is None:
            continue
        kept.add((message["id"], signal["name"]))
        lines.append(line)
    if not named or sorted(found) != sorted(named):
        return None
    for line in dbc_text.splitlines():
        entry = _SIGNAL_TYPE.match(line) or _MULTIPLEXING.match(line)
        if entry is not None and (entry["id"], entry["name"]) in kept:
            lines.append(line)
    return "\n".join([*lines, ""])


def _declarations(dbc_text: str) -> Iterator[tuple[re.Match[str], str]]:
    """Yield the line of each message and those of its signals, with the former's match."""
    message: re.Match[str] | None = None
    for line in dbc_text.splitlines():
        if (begin := _MESSAGE.match(line)) is not None:
            message = begin
        elif _SIGNAL.match(line) is None:
            message = None
        if message is not None:
            yield message, line
