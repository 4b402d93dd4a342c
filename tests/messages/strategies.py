"""Values that a declaration can carry, at the resolution of the wire."""

from typing import Any

from hypothesis import strategies as st

from onboard.errors import DecodeError
from onboard.messages.fields import (
    Field,
    FixedField,
    OpenBitString,
    OpenType,
    Optional,
    Quantity,
    SequenceOf,
)
from onboard.messages.record import Record


def values(field: Field) -> st.SearchStrategy[Any]:  # noqa: PLR0911 (one for each kind)
    """Return every value that `field` can carry, `None` where it has a code for it."""
    match field:
        case Record():
            return records(field)
        case Optional():
            return st.none() | values(field.field).filter(lambda value: value is not None)
        case SequenceOf():
            lowest, highest = field.count.lowest, field.count.highest
            items = st.lists(values(field.item), min_size=lowest, max_size=min(highest, 4))
            return items.map(tuple)
        case OpenType():
            return st.binary(max_size=200)
        case OpenBitString():
            return st.integers(0, (1 << field.bits + 3) - 1).map(field.names)
        case Quantity():
            return quantities(field)
    assert isinstance(field, FixedField)
    raws = st.integers(0, (1 << field.bits) - 1)
    return raws.filter(lambda raw: has_meaning(field, raw)).map(field.from_raw)


def quantities(field: Quantity) -> st.SearchStrategy[float | None]:
    numbers: st.SearchStrategy[float | None] = st.integers(field.lowest, field.highest).map(
        lambda steps: field.from_raw(field.to_raw(steps * field.scale))
    )
    return numbers if field.unavailable is None else numbers | st.none()


def has_meaning(field: FixedField, raw: int) -> bool:
    try:
        field.from_raw(raw)
    except DecodeError:
        return False
    return True


def records(record: Record[Any]) -> st.SearchStrategy[Any]:
    """Return every message that the declaration allows."""
    return st.builds(
        record.record, **{name: values(field) for name, field in record.fields.items()}
    )
