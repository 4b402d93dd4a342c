"""`onboard decode`: decodes the messages of a capture or of lines of hex."""

import json
import re
import sys
from collections.abc import Iterable, Iterator
from io import BufferedReader
from pathlib import Path
from typing import Annotated, Any

import typer

from onboard.errors import UserError
from onboard.tools.decode.describe import Form, describe
from onboard.wave_udp.capture import CaptureError, Packet, is_capture, read_capture

PEEKED_BYTES = 4096
_DIGITS = re.compile(rb"[0-9A-Fa-f ]+")


def decode(
    file: Annotated[
        Path, typer.Argument(help="A pcap or pcapng, or lines of hex; - reads the standard input.")
    ] = Path("-"),
    form: Annotated[
        Form, typer.Option("--as", help="The outermost layer of the bytes.")
    ] = Form.AUTO,
) -> None:
    """Print the radio messages in a capture or in lines of hex. One JSON object each.

    Signatures are not verified. What cannot be decoded has an error on its line. Exit with 1 if the
    file is neither a capture nor lines of hex.
    """
    with _open(file) as stream:
        if not (is_capture(stream.peek(4)) or _has_hex(stream.peek(PEEKED_BYTES))):
            typer.echo(f"{file}: neither pcap nor pcapng nor lines of hex", err=True)
            raise typer.Exit(1)
        try:
            is_empty = True
            for record in _records(stream, form):
                is_empty = False
                typer.echo(json.dumps(record, separators=(",", ":")))
        except CaptureError as error:
            raise UserError(f"{file}: {error}") from error
        if is_empty:
            typer.echo(f"{file}: no messages", err=True)


def _open(file: Path) -> BufferedReader:
    if str(file) == "-":
        return open(sys.stdin.fileno(), "rb", closefd=False)
    try:
        return file.open("rb")
    except OSError as error:
        raise UserError(f"{file}: cannot be read: {error.strerror}") from error


def _records(stream: BufferedReader, form: Form) -> Iterator[dict[str, Any]]:
    if is_capture(stream.peek(4)):
        return _describe_packets(read_capture(stream.read()), form)
    return _describe_lines(stream, form)


def _has_hex(head: bytes) -> bool:
    """Whether a line of the beginning of a file is hex, or none has anything but a comment."""
    digits = [_digits(line) for line in head.splitlines()]
    return not any(digits) or any(map(_DIGITS.fullmatch, digits))


def _digits(line: bytes) -> bytes:
    """Ignore blanks and colons between the digits, a leading 0x, and comments from # on."""
    return line.partition(b"#")[0].replace(b":", b" ").strip().removeprefix(b"0x")


def _describe_packets(packets: Iterable[Packet], form: Form) -> Iterator[dict[str, Any]]:
    for number, packet in enumerate(packets, start=1):
        header = {"packet": number, "utc_s": packet.utc_s}
        if packet.message is None:
            yield header | {
                "error": {"layer": "capture", "reason": "neither_wsmp_geonetworking_nor_udp"}
            }
        else:
            yield header | describe(packet.message, form)


def _describe_lines(lines: Iterable[bytes], form: Form) -> Iterator[dict[str, Any]]:
    for number, line in enumerate(lines, start=1):
        digits = _digits(line)
        if not digits:
            continue
        try:
            data = bytes.fromhex(digits.decode("ascii"))
        except ValueError as error:
            detail = str(error)
            yield {"line": number, "error": {"layer": "hex", "reason": "not_hex", "detail": detail}}
        else:
            yield {"line": number} | describe(data, form)
