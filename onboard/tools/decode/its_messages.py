"""Messages of ETSI ITS and of ISO/TS 19091 in unaligned PER, by pycrate; CPMs by the own codec.

The extra `its` installs pycrate. Values have the names and units of the ASN.1 modules.
"""

import json
from importlib import import_module
from typing import Any

from onboard.errors import DecodeError
from onboard.messages import cpm

_PDUS = {
    1: ("denm", "ITS_DENM_3", "DENM_PDU_Descriptions", "DENM"),
    2: ("cam", "ITS_CAM_2", "CAM_PDU_Descriptions", "CAM"),
    4: ("spatem", "ITS_IS", "SPATEM_PDU_Descriptions", "SPATEM"),
    5: ("mapem", "ITS_IS", "MAPEM_PDU_Descriptions", "MAPEM"),
    6: ("ivim", "ITS_IS", "IVIM_PDU_Descriptions", "IVIM"),
    9: ("srem", "ITS_IS", "SREM_PDU_Descriptions", "SREM"),
    10: ("ssem", "ITS_IS", "SSEM_PDU_Descriptions", "SSEM"),
    16: ("vam", "ITS_VAM_3", "VAM_PDU_Descriptions", "VAM"),
}
"""Name, module of pycrate, ASN.1 module and type by the messageID of the ItsPduHeader."""
_NAMES = {3: "poi", 7: "ev_rsr", 8: "tistpgtransaction", 13: "rtcmem", 15: "imzm"}
"""Messages without a module in pycrate (TS 102 894-2, MessageId)."""
_DSRC = {
    28: ("rtcm_corrections", "RTCMcorrections"),
    29: ("signal_request_message", "SignalRequestMessage"),
    30: ("signal_status_message", "SignalStatusMessage"),
}
"""Messages that ISO/TS 19091 shares with SAE J2735, by DSRCmsgID."""


def read_pdu(data: bytes) -> dict[str, Any]:
    """Read a message that begins with an ItsPduHeader.

    Raises:
        DecodeError: `too_short`, `unknown_message`, `extra_missing` or `bad_encoding`; of CPMs
            those of `cpm.decode`.
    """
    if len(data) < 2:
        raise DecodeError("too_short", "ends within the header")
    message_id = data[1]
    if message_id == cpm.MESSAGE_ID:
        return {"cpm": cpm.as_dict(cpm.decode(data))}
    if message_id not in _PDUS:
        raise DecodeError("unknown_message", f"{message_id} ({_NAMES.get(message_id, 'unknown')})")
    name, *place = _PDUS[message_id]
    return {name: _values(data, *place)}


def read_dsrc(message_id: int, data: bytes) -> dict[str, Any] | None:
    """Read the content of a MessageFrame; `None` for messages that ISO/TS 19091 does not have.

    Raises:
        DecodeError: `extra_missing` or `bad_encoding`.
    """
    if message_id not in _DSRC:
        return None
    name, type_name = _DSRC[message_id]
    return {name: _values(data, "ITS_IS", "DSRC", type_name)}


def _values(data: bytes, module: str, asn1_module: str, type_name: str) -> Any:
    try:
        types = getattr(import_module(f"pycrate_asn1dir.{module}"), asn1_module)
    except ModuleNotFoundError as error:
        raise DecodeError("extra_missing", 'pip install "onboard[its]" reads it') from error
    message = getattr(types, type_name)
    try:
        message.from_uper(data)
        return json.loads(message.to_jer())
    except Exception as error:  # pycrate raises many kinds for octets from outside
        raise DecodeError("bad_encoding", f"{type_name}: {error}") from error
