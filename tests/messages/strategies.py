"""Values that a declaration can carry, at the resolution of the wire."""

from functools import partial
from typing import Any

from hypothesis import strategies as st

from onboard.errors import DecodeError
from onboard.messages.fields import (
    Addition,
    Choice,
    Chosen,
    Enumerated,
    ExtensibleEnumerated,
    ExtensibleQuantity,
    Field,
    FixedField,
    Ia5String,
    NotRead,
    OpenBitString,
    OpenType,
    Optional,
    Quantity,
    RestOfMessage,
    SequenceOf,
)
from onboard.messages.message_frame import RegionalExtension
from onboard.messages.record import Record


def values(  # noqa: C901, PLR0911, PLR0912 (one for each kind)
    field: Field, most: int = 4
) -> st.SearchStrategy[Any]:
    """Return every value that `field` can carry, `None` where it has a code for it.

    Lists have at most `most` items, or as many as the declaration asks for.
    """
    match field:
        case Record():
            return records(field, most)
        case ExtensibleQuantity():
            return numbers(field.root)
        case Addition():
            return st.none() | values(field.field, most)
        case Optional():
            if isinstance(field.field, Quantity):
                return st.none() | numbers(field.field)
            return st.none() | values(field.field, most).filter(lambda value: value is not None)
        case SequenceOf():
            lowest, highest = field.count.lowest, field.count.highest
            items = st.lists(
                values(field.item, most), min_size=lowest, max_size=max(lowest, min(highest, most))
            )
            return items.map(tuple)
        case Choice():
            return st.one_of(
                [
                    values(each, most).map(partial(Chosen, name))
                    for name, each in field.alternatives.items()
                ]
            )
        case NotRead() | RestOfMessage():
            return st.nothing()
        case ExtensibleEnumerated():
            return st.sampled_from(field.names)
        case Ia5String():
            return st.text(
                st.characters(max_codepoint=126),  # pycrate refuses 127
                min_size=field.length.lowest,
                max_size=min(field.length.highest, 20),
            )
        case OpenType():
            return st.binary(max_size=200)
        case OpenBitString():
            return st.integers(0, (1 << field.bits + 3) - 1).map(field.names)
        case Quantity():
            return quantities(field)
        case Enumerated():
            members = st.sampled_from(field.names)
            return members if field.unavailable is None else members | st.none()
    assert isinstance(field, FixedField)
    raws = st.integers(0, (1 << field.bits) - 1)
    return raws.filter(lambda raw: has_meaning(field, raw)).map(field.from_raw)


def quantities(field: Quantity) -> st.SearchStrategy[float | None]:
    return numbers(field) if field.unavailable is None else numbers(field) | st.none()


def numbers(field: Quantity) -> st.SearchStrategy[float | None]:
    return st.integers(field.lowest, field.highest).map(
        lambda steps: field.from_raw(field.to_raw(steps * field.scale))
    )


def has_meaning(field: FixedField, raw: int) -> bool:
    try:
        field.from_raw(raw)
    except DecodeError:
        return False
    return True


def records(record: Record[Any], most: int = 4) -> st.SearchStrategy[Any]:
    """Return every message that the declaration allows.

    Of regional extensions only those for local use, whose contents no oracle knows.
    """
    if record.record is RegionalExtension:
        contents = st.binary(min_size=1, max_size=9)
        return st.builds(RegionalExtension, st.integers(128, 255), contents)
    return st.builds(
        record.record, **{name: values(field, most) for name, field in record.fields.items()}
    )
