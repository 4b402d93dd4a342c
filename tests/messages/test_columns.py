"""Messages decoded in columns have the values of messages decoded one by one."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.errors import DecodeError
from onboard.messages.columns import Columns
from onboard.messages.mvs_footer import MEASUREMENT, STATE
from onboard.messages.record import Record

Read = tuple[float, ...]


def one_by_one(record: Record[object], data: bytes) -> list[Read] | None:
    size = record.size_bytes
    try:
        messages = [record.decode(data[at : at + size]) for at in range(0, len(data), size)]
    except DecodeError:
        return None
    return [dataclasses.astuple(message) for message in messages]  # type: ignore[call-overload]


@pytest.mark.parametrize("record", [MEASUREMENT, STATE])
@given(data=st.data())
def test_columns_hold_the_values_of_the_messages(
    record: Record[object], data: st.DataObject
) -> None:
    size = record.size_bytes
    messages = b"".join(data.draw(st.lists(st.binary(min_size=size, max_size=size), max_size=5)))
    expected = one_by_one(record, messages)
    columns = Columns(record)

    read = columns.read(messages)
    if expected is None:
        assert np.isnan(read).any()
    else:
        assert read.shape == (len(expected), len(record.fields))
        np.testing.assert_array_equal(read, np.array(expected).reshape(read.shape))


@pytest.mark.parametrize("record", [MEASUREMENT, STATE])
@pytest.mark.parametrize("filling", [0x00, 0x7F, 0x80, 0x81, 0xFF])
def test_the_ends_of_the_ranges(record: Record[object], filling: int) -> None:
    messages = bytes([filling]) * record.size_bytes
    expected = one_by_one(record, messages)

    read = Columns(record).read(messages)
    if expected is None:
        assert np.isnan(read).any()
    else:
        assert [tuple(row) for row in read.tolist()] == expected
