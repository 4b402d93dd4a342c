"""The Immediate Forward message of the USDOT RSU Specification 4.1: text, one message a datagram.

    Version=0.7
    Type=BSM
    PSID=0x20
    Priority=7
    TxMode=CONT
    TxChannel=172
    TxInterval=0
    DeliveryStart=
    DeliveryStop=
    Signature=False
    Encryption=False
    Payload=0380...

The unit adds a WSMP header to the payload and sends it at once. PSIDs are p-encoded hex.
"""

from dataclasses import dataclass

from onboard.errors import DecodeError
from onboard.wave_udp.psid import p_decode, p_encode

_FIELDS = (
    "Version",
    "Type",
    "PSID",
    "Priority",
    "TxMode",
    "TxChannel",
    "TxInterval",
    "DeliveryStart",
    "DeliveryStop",
    "Signature",
    "Encryption",
    "Payload",
)
_BOOLEANS = {"true": True, "false": False}
_HIGHEST_PRIORITY = 7


@dataclass(frozen=True, slots=True)
class ImmediateForward:
    """One message for the unit to send. Field names are the specification's."""

    type: str
    """Type of the payload: `BSM`, `SPAT`, `MAP`, ..."""
    psid: int
    priority: int
    """User priority, 0 to 7."""
    payload: bytes
    tx_mode: str = "CONT"
    """Channel access, `CONT` or `ALT`."""
    tx_channel: str = "172"
    """A channel number, or `CCH` or `SCH`."""
    tx_interval: str = "0"
    """Period in seconds, for Store and Repeat; 0 sends once."""
    delivery_start: str = ""
    """Start time for Store and Repeat; empty here."""
    delivery_stop: str = ""
    """Stop time for Store and Repeat; empty here."""
    signature: bool = False
    """Whether the unit signs the payload."""
    encryption: bool = False
    """Whether the unit encrypts the payload."""
    version: str = "0.7"


def encode(message: ImmediateForward) -> bytes:
    """Return the datagram for the unit.

    Raises:
        ValueError: a field cannot carry its value.
    """
    if not 0 <= message.priority <= _HIGHEST_PRIORITY:
        raise ValueError(f"a priority is 0 to {_HIGHEST_PRIORITY} (given {message.priority})")
    values = (
        message.version,
        message.type,
        f"0x{p_encode(message.psid).hex().upper()}",
        str(message.priority),
        message.tx_mode,
        message.tx_channel,
        message.tx_interval,
        message.delivery_start,
        message.delivery_stop,
        str(message.signature),
        str(message.encryption),
        message.payload.hex().upper(),
    )
    lines = [f"{name}={value}\n" for name, value in zip(_FIELDS, values, strict=True)]
    text = "".join(lines)
    if len(text.splitlines()) != len(_FIELDS):
        raise ValueError("a value of an Immediate Forward message is one line")
    return text.encode("ascii")


def decode(data: bytes) -> ImmediateForward:
    r"""Read such a datagram. Blanks around names and values, and \r\n, are accepted.

    Raises:
        DecodeError: `not_text`, `missing_field`, `bad_field`, `bad_psid` or `too_short`.
    """
    try:
        text = data.decode("ascii")
    except UnicodeDecodeError as error:
        raise DecodeError("not_text", "not ASCII") from error
    pairs = (line.partition("=") for line in text.splitlines() if line.strip())
    values = {name.strip().lower(): value.strip() for name, _, value in pairs}
    for name in _FIELDS:
        if name.lower() not in values:
            raise DecodeError("missing_field", name)
    psid_octets = _hex("PSID", values["psid"].lower().removeprefix("0x"))
    psid, end = p_decode(psid_octets)
    if end != len(psid_octets):
        raise DecodeError("bad_psid", f"{values['psid']} is not p-encoded")
    return ImmediateForward(
        version=values["version"],
        type=values["type"],
        psid=psid,
        priority=_priority(values["priority"]),
        tx_mode=values["txmode"],
        tx_channel=values["txchannel"],
        tx_interval=values["txinterval"],
        delivery_start=values["deliverystart"],
        delivery_stop=values["deliverystop"],
        signature=_boolean("Signature", values["signature"]),
        encryption=_boolean("Encryption", values["encryption"]),
        payload=_hex("Payload", values["payload"]),
    )


def _priority(value: str) -> int:
    if len(value) != 1 or value not in "01234567":
        raise DecodeError("bad_field", f"Priority={value}")
    return int(value)


def _boolean(name: str, value: str) -> bool:
    if value.lower() not in _BOOLEANS:
        raise DecodeError("bad_field", f"{name}={value}")
    return _BOOLEANS[value.lower()]


def _hex(name: str, digits: str) -> bytes:
    try:
        return bytes.fromhex(digits)
    except ValueError as error:
        raise DecodeError("bad_field", f"{name} is not hex") from error
