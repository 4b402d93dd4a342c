"""Unsecured 1609.2 data, encoded as in the standard."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.security.security_services import NotTrusted, SecurityServices

BSM_PSID = 0x20


def test_unsecured_data_adds_three_bytes_to_a_short_payload() -> None:
    assert SecurityServices(utc_offset_s=0).secure(
        b"\x00\x14\x01\x00", BSM_PSID, now=0.0
    ) == bytes.fromhex("03 80 04 00140100")


@given(payload=st.binary(max_size=70_000), psid=st.integers(0, 2**28))
def test_unsecured_data_are_opened(payload: bytes, psid: int) -> None:
    security = SecurityServices(utc_offset_s=1.7e9)
    opened = security.open(security.secure(payload, psid, now=1.0), psid, now=1.1)
    assert (opened.payload, opened.signer_id, opened.generation_utc_s) == (payload, None, None)


@pytest.mark.parametrize(
    "data",
    [
        pytest.param("", id="nothing"),
        pytest.param("03 80", id="no length"),
        pytest.param("03 80 05 00140100", id="one byte short"),
        pytest.param("03 80 03 00140100", id="one byte over"),
        pytest.param("03 80 8104 00140100", id="length not canonical"),
        pytest.param("02 80 04 00140100", id="protocol version 2"),
    ],
)
def test_other_bytes_are_malformed(data: str) -> None:
    with pytest.raises(NotTrusted) as refused:
        SecurityServices(utc_offset_s=0).open(bytes.fromhex(data), BSM_PSID, now=0.0)
    assert refused.value.reason == "malformed"
