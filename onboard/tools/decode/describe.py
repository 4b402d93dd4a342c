"""Describes received bytes layer by layer, as far as they can be decoded.

For people only: the daemon does not use it, and nothing is verified.
"""

from collections.abc import Container
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from itertools import chain, count
from typing import Any

from onboard.errors import DecodeError
from onboard.messages import bsm, lcca, map_data, message_frame, mvs_footer, psm, sdsm, spat
from onboard.security import ieee1609dot2
from onboard.security.certificates import Certificate
from onboard.security.ieee1609dot2 import SignedData, UnsecuredData
from onboard.security.its_time import from_time64
from onboard.security.oer import Malformed, Unsupported
from onboard.security.region import GeographicRegion
from onboard.security.rejection import RejectionReason
from onboard.tools.decode import geonetworking, its_messages
from onboard.wave_udp import immediate_forward, psid, wsmp


class Form(StrEnum):
    """Outermost layer of bytes."""

    AUTO = "auto"
    """Found from the bytes."""
    WSM = "wsm"
    DOT2 = "1609.2"
    MESSAGE_FRAME = "messageframe"
    LCCA = "lcca"
    MVS_FOOTER = "mvs_footer"
    RSU41 = "rsu41"
    GEONETWORKING = "geonetworking"
    COMMON = "geonetworking_common"
    """GeoNetworking from the common header on, as it is in 1609.2 data."""
    ITS = "its"
    """A message with an ItsPduHeader: CAM, DENM and others."""


def describe(data: bytes, form: Form = Form.AUTO) -> dict[str, Any]:
    """Return each layer of `data` under its name, outermost first.

    If a layer cannot be decoded, `error` names it with the reason, and `undecoded` has its bytes as
    hex.
    """
    layers: dict[str, Any] = {}
    within = _Layer({}, data, form)
    while within.content is not None:
        form = within.form
        try:
            if form is Form.AUTO:
                form = _form_of(within.content, within.psid)
            inner = _READERS[form](within.content)
        except DecodeError as error:
            layers["error"] = {"layer": form, "reason": error.reason, "detail": error.detail}
            layers["undecoded"] = within.content.hex()
            break
        layers[_unused(form, layers)] = inner.fields
        if form is Form.DOT2 and within.secured is not Form.AUTO:
            inner = replace(inner, form=within.secured)
        within = inner if inner.psid is not None else replace(inner, psid=within.psid)
    return layers


def _unused(form: Form, layers: Container[str]) -> str:
    """Number the names of repeated layers, such as 1609.2 data within 1609.2 data."""
    names = chain([str(form)], (f"{form} {n}" for n in count(2)))
    return next(name for name in names if name not in layers)


@dataclass(frozen=True, slots=True)
class _Layer:
    """The fields of a layer, and its content."""

    fields: dict[str, Any]
    content: bytes | None = None
    form: Form = Form.AUTO
    """Layer of the content."""
    psid: int | None = None
    """PSID of the content, if the layer states one."""
    secured: Form = Form.AUTO
    """Layer in the content, if that is 1609.2 data."""


def _form_of(data: bytes, inner_psid: int | None) -> Form:
    """Find the outermost layer from the first octets, and from the PSID of the outer layers.

    WSMP begins with its version and a TPID of 0 or 1, GeoNetworking with its version 1 and the next
    header, 1609.2 data with 3 and a choice of 80 hex or more, a MessageFrame with the high octet of
    a small message number, LCCA with its version, which without a PSID may be that of a WSM.

    Raises:
        DecodeError: `unknown_psid`, of a service whose messages are not read.
    """
    first, second = (data + bytes(2))[:2]
    if data.startswith(b"Version"):
        return Form.RSU41
    if first == wsmp.VERSION and second >= 0x80:
        return Form.DOT2
    if inner_psid in psid.PRIVATE_USE and first == lcca.VERSION:
        return Form.LCCA
    if first == 0 or inner_psid in psid.J2735:
        return Form.MESSAGE_FRAME
    if inner_psid is None:
        return _form_of_frame(data)
    if first in wsmp.VERSIONS_READ:
        return Form.WSM
    raise DecodeError("unknown_psid", f"{inner_psid:#x} ({psid.NAMES.get(inner_psid, 'unknown')})")


def _form_of_frame(data: bytes) -> Form:
    if data[:1] in {b"\x11", b"\x12"}:
        return Form.GEONETWORKING
    return Form.LCCA if data[:1] == bytes([lcca.VERSION]) and _is_lcca(data) else Form.WSM


def _is_lcca(data: bytes) -> bool:
    try:
        lcca.decode(data)
    except DecodeError:
        return False
    return True


def _rsu41(data: bytes) -> _Layer:
    message = immediate_forward.decode(data)
    fields = {
        "version": message.version,
        "type": message.type,
        **_psid(message.psid),
        "priority": message.priority,
        "tx_mode": message.tx_mode,
        "tx_channel": message.tx_channel,
        "tx_interval_s": message.tx_interval,
        "delivery_start": message.delivery_start,
        "delivery_stop": message.delivery_stop,
        "signature": message.signature,
        "encryption": message.encryption,
    }
    return _Layer(fields, message.payload, psid=message.psid)


def _wsm(data: bytes) -> _Layer:
    wsm = wsmp.decode(data)
    fields = {
        "version": wsm.version,
        "channel_number": wsm.channel_number,
        "data_rate_mbit_s": wsm.data_rate_mbit_s,
        "transmit_power_dbm": wsm.transmit_power_dbm,
        "n_extensions": [_element(element) for element in wsm.n_extensions],
        **_psid(wsm.psid),
        "t_extensions": [_element(element) for element in wsm.t_extensions],
        "wsm_length_bytes": len(wsm.payload),
    }
    return _Layer(fields, wsm.payload, psid=wsm.psid)


def _psid(value: int) -> dict[str, Any]:
    return {"psid": value, "psid_name": psid.NAMES.get(value)}


def _element(element: wsmp.Element) -> dict[str, Any]:
    return {"element_id": element.element_id, "content": element.content.hex()}


def _message_frame(data: bytes) -> _Layer:
    frame = message_frame.read(data)
    message_id = frame.message_id
    fields: dict[str, Any] = {"message_id": message_id}
    match message_id:
        case bsm.MESSAGE_ID:
            message = bsm.decode(data)
            content = bsm.as_dict(message)
            del content["footer"]  # It is a layer of its own.
            return _Layer(
                fields | {"basic_safety_message": content}, message.footer, Form.MVS_FOOTER
            )
        case map_data.MESSAGE_ID:
            return _Layer(fields | {"map_data": map_data.as_dict(map_data.decode(data))})
        case spat.MESSAGE_ID:
            return _Layer(fields | {"spat": spat.as_dict(spat.decode(data))})
        case psm.MESSAGE_ID:
            return _Layer(fields | {"personal_safety_message": psm.as_dict(psm.decode(data))})
        case sdsm.MESSAGE_ID:
            shared_data = sdsm.as_dict(sdsm.decode(data))
            return _Layer(fields | {"sensor_data_sharing_message": shared_data})
    shared = its_messages.read_dsrc(message_id, frame.content)
    if shared is None:
        name = message_frame.NAMES.get(message_id, "unknown")
        raise DecodeError("unknown_message", f"message {message_id} ({name})")
    return _Layer(fields | shared)


def _geonetworking(data: bytes) -> _Layer:
    header = geonetworking.read_basic(data)
    if header.is_secured:
        return _Layer(header.fields, header.content, Form.DOT2, secured=Form.COMMON)
    return _transported(header)


def _common(data: bytes) -> _Layer:
    return _transported(geonetworking.read_common(data))


def _transported(header: geonetworking.Header) -> _Layer:
    return _Layer(header.fields, header.content if header.port is not None else None, Form.ITS)


def _its(data: bytes) -> _Layer:
    return _Layer(its_messages.read_pdu(data))


def _mvs_footer(data: bytes) -> _Layer:
    return _Layer(mvs_footer.as_dict(mvs_footer.decode(data)))


def _lcca(data: bytes) -> _Layer:
    pdu = lcca.decode(data)
    proof = {"proof": [each.hex() for each in pdu.proof]} if pdu.proof else {}
    fields = {"message": pdu.message.kind, **lcca.as_dict(pdu.message), **proof}
    return _Layer(fields, pdu.origin or None)


def _dot2(data: bytes) -> _Layer:
    try:
        message = ieee1609dot2.decode(data)
    except Malformed as malformed:
        raise DecodeError(RejectionReason.MALFORMED, str(malformed)) from malformed
    except Unsupported as unsupported:
        raise DecodeError(RejectionReason.UNSUPPORTED, str(unsupported)) from unsupported
    if isinstance(message, UnsecuredData):
        return _Layer({"content": "unsecured_data"}, message.payload)
    return _Layer(_signed(message), message.payload, psid=message.psid)


def _signed(message: SignedData) -> dict[str, Any]:
    """Return the fields; there is no trust store, so the signature is not verified."""
    signer: dict[str, Any]
    if isinstance(message.signer, bytes):
        signer, reason = {"digest": message.signer.hex()}, RejectionReason.UNKNOWN_CERTIFICATE
    else:
        signer = {"certificates": [_certificate(one) for one in message.signer]}
        reason = RejectionReason.UNKNOWN_ISSUER
    r, s = message.signature
    return {
        "content": "signed_data",
        "header_info": {
            **_psid(message.psid),
            "generation_utc_s": _utc_s(message.generation_time64),
            "expiry_utc_s": _utc_s(message.expiry_time64),
            "generation_location": None if message.location is None else asdict(message.location),
        },
        "signer": signer,
        "signature": {"r": f"{r:064x}", "s": f"{s:064x}"},
        "verified": False,
        "not_verified_because": reason,
    }


def _certificate(certificate: Certificate) -> dict[str, Any]:
    subject = certificate.subject
    return {
        "hashed_id8": certificate.hashed_id8.hex(),
        "type": "implicit" if certificate.is_implicit else "explicit",
        "issuer": None if certificate.issuer_id is None else certificate.issuer_id.hex(),
        "name": subject.name,
        "binary_id": _hex(subject.binary_id),
        "linkage_data": None if subject.linkage is None else _with_hex(asdict(subject.linkage)),
        "craca_id": subject.craca_id.hex(),
        "crl_series": subject.crl_series,
        "valid_from_utc_s": subject.valid_from_utc_s,
        "valid_until_utc_s": subject.valid_until_utc_s,
        "app_permissions": [
            {
                **_psid(permission.psid),
                "ssp": _hex(permission.ssp),
                "is_bitmap_ssp": permission.is_bitmap,
            }
            for permission in subject.permissions
        ],
        "region": _region(subject.region),
        "assurance_level": subject.assurance_level,
        "public_key": _hex(subject.public_key),
        "reconstruction_value": _hex(subject.reconstruction_value),
    }


def _region(region: GeographicRegion | None) -> dict[str, Any] | list[dict[str, Any]] | None:
    if isinstance(region, tuple):
        return [asdict(one) for one in region]
    return None if region is None else asdict(region)


def _with_hex(fields: dict[str, Any]) -> dict[str, Any]:
    """Return nested fields with octets in hexadecimal."""
    return {
        name: value.hex()
        if isinstance(value, bytes)
        else _with_hex(value)
        if isinstance(value, dict)
        else value
        for name, value in fields.items()
    }


def _hex(octets: bytes | None) -> str | None:
    return None if octets is None else octets.hex()


def _utc_s(time64: int | None) -> float | None:
    return None if time64 is None else from_time64(time64)


_READERS = {
    Form.RSU41: _rsu41,
    Form.WSM: _wsm,
    Form.DOT2: _dot2,
    Form.MESSAGE_FRAME: _message_frame,
    Form.MVS_FOOTER: _mvs_footer,
    Form.LCCA: _lcca,
    Form.GEONETWORKING: _geonetworking,
    Form.COMMON: _common,
    Form.ITS: _its,
}
