"""Messages by another codec: pycrate with ETSI's ASN.1, for MAP and SPAT that of ISO/TS 19091.

That module repeats SAE J2735, but for the lower end of the longitude.
"""

from enum import Enum
from typing import Any

from pycrate_asn1dir.ITS_CAM_2 import CAM_PDU_Descriptions
from pycrate_asn1dir.ITS_DENM_3 import DENM_PDU_Descriptions
from pycrate_asn1dir.ITS_IS import DSRC

from onboard.messages.fields import (
    BitString,
    Boolean,
    Choice,
    Enumerated,
    ExtensibleEnumerated,
    ExtensibleQuantity,
    Field,
    Ia5String,
    Integer,
    OctetString,
    OpenBitString,
    OpenType,
    Optional,
    Quantity,
    SequenceOf,
)
from onboard.messages.record import Record

ORACLES = {
    "MapData": DSRC.MapData,
    "Spat": DSRC.SPAT,
    "CamParameters": CAM_PDU_Descriptions.CamParameters,
    "Notification": DENM_PDU_Descriptions.DecentralizedEnvironmentalNotificationMessage,
}
_LONGITUDE_FROM = -1_799_999_999
"""Of J2735; that of ISO/TS 19091 begins one step lower."""


def decoded(record: Record[Any], data: bytes) -> Any:
    """Return the oracle's value of `data`, after it has encoded the same bits again."""
    oracle = ORACLES[record.record.__name__]
    oracle.from_uper(data)
    value = oracle.get_val()
    oracle.set_val(value)
    assert oracle.to_uper() == data
    return value


def assert_same(record: Record[Any], ours: object, theirs: Any) -> None:
    """Check every field of a message against the oracle's value of it."""
    _same(record, ours, theirs, ORACLES[record.record.__name__])


def _same(  # noqa: C901, PLR0912 (one for each kind)
    field: Field, ours: Any, theirs: Any, type_: Any
) -> None:
    match field:
        case Record():
            _same_record(field, ours, theirs, type_)
        case Optional():
            _same(field.field, ours, theirs, type_)
        case SequenceOf() if type_.TYPE == "SEQUENCE":  # x and y, without a count
            for each, (name, inner) in zip(ours, type_._cont.items(), strict=True):
                _same(field.item, each, theirs[name], inner)
        case SequenceOf() if type_.TYPE == "BIT STRING":
            assert f"{theirs[0]:0{theirs[1]}b}" == "".join(str(int(each)) for each in ours)
        case SequenceOf() if type_.TYPE == "OCTET STRING":
            assert theirs == bytes(ours)
        case ExtensibleQuantity():
            _same(field.root, ours, theirs, type_)
        case SequenceOf():
            assert len(ours) == len(theirs)
            for one, other in zip(ours, theirs, strict=True):
                _same(field.item, one, other, type_._cont)
        case Choice():
            name, value = theirs
            index = list(field.alternatives).index(ours.name)
            assert list(type_._cont).index(name) == index
            _same(field.alternatives[ours.name], ours.value, value, type_._cont[name])
        case Quantity():
            lowest = field.from_raw(0) if ours is None else None
            steps = field.to_raw(ours) + min(field.lowest, field._first)
            assert lowest is None or steps == field.unavailable
            assert theirs == steps - (field.lowest == _LONGITUDE_FROM)
        case Enumerated() if ours is None:
            assert list(type_._cont).index(theirs) == field.unavailable
        case Enumerated() | ExtensibleEnumerated():
            assert isinstance(ours, Enum)
            assert list(type_._cont).index(theirs) == ours.value
        case BitString() | OpenBitString():
            number, bits = theirs
            assert int(f"{number:0{bits}b}"[::-1], 2) == ours
        case OpenType():
            assert theirs[1] == ours
        case OctetString():
            assert theirs == int.from_bytes(ours)
        case Boolean() | Ia5String():
            assert theirs == ours
        case Integer():
            code = list(type_._cont).index(theirs) if type_.TYPE == "ENUMERATED" else theirs
            assert code == ours
        case _:
            raise TypeError(field)


def _same_record(record: Record[Any], ours: object, theirs: Any, type_: Any) -> None:
    for (name, field), (other, inner) in zip(
        record.fields.items(), type_._cont.items(), strict=True
    ):
        value = getattr(ours, name)
        if isinstance(field, Optional):
            assert (value is not None) == (other in theirs), name
        if other in theirs:
            _same(field, value, theirs[other], inner)
