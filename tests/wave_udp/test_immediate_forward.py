"""The Immediate Forward text datagram of the USDOT RSU Specification 4.1."""

from string import ascii_letters, digits

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.errors import DecodeError
from onboard.wave_udp import wsmp
from onboard.wave_udp.immediate_forward import ImmediateForward, decode, encode
from onboard.wave_udp.psid import HIGHEST
from onboard.wave_udp.rsu41 import as_immediate_forward, as_wsm
from onboard.wave_udp.settings import Rsu41Settings
from onboard.wave_udp.wsmp import WaveShortMessage

# A signal phase message, field for field as V2X Hub sends it to roadside units.
SPAT = b"""Version=0.7
Type=SPAT
PSID=0x8002
Priority=7
TxMode=CONT
TxChannel=172
TxInterval=0
DeliveryStart=
DeliveryStop=
Signature=True
Encryption=False
Payload=00136B4457F2018000
"""
SPAT_MESSAGE = ImmediateForward(
    type="SPAT",
    psid=0x82,
    priority=7,
    payload=bytes.fromhex("00136b4457f2018000"),
    signature=True,
)


def test_byte_vector() -> None:
    assert decode(SPAT) == SPAT_MESSAGE
    assert encode(SPAT_MESSAGE) == SPAT


def test_blanks_case_and_line_ends_are_accepted() -> None:
    loose = SPAT.replace(b"=", b" = ").replace(b"\n", b"\r\n\r\n").replace(b"True", b"TRUE")
    assert decode(loose.replace(b"Type", b"TYPE")) == SPAT_MESSAGE


@pytest.mark.parametrize("line", SPAT.splitlines(keepends=True))
def test_a_message_that_lacks_a_line_is_refused(line: bytes) -> None:
    with pytest.raises(DecodeError) as refused:
        decode(SPAT.replace(line, b""))
    assert refused.value.reason == "missing_field"
    assert refused.value.detail == line.partition(b"=")[0].decode()


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        (b"SPAT", b"SP\xc4T", "not_text"),
        (b"0x8002", b"", "too_short"),
        (b"0x8002", b"0x80", "too_short"),
        (b"0x8002", b"0x2080", "bad_psid"),
        (b"0x8002", b"0xF0", "bad_psid"),
        (b"0x8002", b"SPAT", "bad_field"),
        (b"Priority=7", b"Priority=8", "bad_field"),
        (b"Priority=7", b"Priority=-1", "bad_field"),
        (b"Signature=True", b"Signature=Yes", "bad_field"),
        (b"Payload=00", b"Payload=0", "bad_field"),
    ],
)
def test_an_invalid_value_is_refused(old: bytes, new: bytes, reason: str) -> None:
    with pytest.raises(DecodeError) as refused:
        decode(SPAT.replace(old, new))
    assert refused.value.reason == reason


word = st.text(ascii_letters + digits + "/:-,", max_size=20)


@given(
    st.builds(
        ImmediateForward,
        type=word,
        psid=st.integers(0, HIGHEST),
        priority=st.integers(0, 7),
        payload=st.binary(max_size=1400),
        tx_mode=word,
        tx_channel=word,
        tx_interval=word,
        delivery_start=word,
        delivery_stop=word,
        signature=st.booleans(),
        encryption=st.booleans(),
        version=word,
    )
)
def test_encoding_and_decoding_give_the_same_message(message: ImmediateForward) -> None:
    assert decode(encode(message)) == message


def test_a_value_of_two_lines_is_a_value_error() -> None:
    with pytest.raises(ValueError, match="is one line"):
        encode(ImmediateForward(type="BSM\nPayload=00", psid=0x20, priority=7, payload=b""))


def test_a_priority_out_of_range_is_a_value_error() -> None:
    with pytest.raises(ValueError, match="a priority is 0 to 7"):
        encode(ImmediateForward(type="BSM", psid=0x20, priority=8, payload=b""))


SETTINGS = Rsu41Settings(endpoint="rsu41", listen_port=4000, channel=183)
SECURED = bytes.fromhex("0380 04 00140100")


def test_a_wsm_is_sent_as_its_data_under_its_psid_on_the_units_channel() -> None:
    wsm = wsmp.encode(WaveShortMessage(0x20, SECURED))
    text = encode(as_immediate_forward(wsm, 5, SETTINGS)).decode().splitlines()
    assert "Type=BSM" in text
    assert "PSID=0x20" in text
    assert "Priority=5" in text
    assert "TxChannel=183" in text
    assert "Signature=False" in text
    assert "Payload=03800400140100" in text


def test_a_wsm_that_names_a_channel_is_sent_on_that_channel() -> None:
    wsm = wsmp.encode(WaveShortMessage(0x4020, SECURED, channel_number=178))
    message = as_immediate_forward(wsm, 7, SETTINGS)
    assert (message.type, message.psid, message.tx_channel) == ("OTHER", 0x4020, "178")


def test_a_forwarded_wsm_is_passed_on_unchanged() -> None:
    wsm = wsmp.encode(WaveShortMessage(0x4020, SECURED))
    assert as_wsm(wsm, forwarded_psid=0x20) == wsm


def test_forwarded_1609_2_data_becomes_a_wsm_under_the_configured_psid() -> None:
    assert wsmp.decode(as_wsm(SECURED, forwarded_psid=0x20)) == WaveShortMessage(0x20, SECURED)


def test_without_a_configured_psid_forwarded_data_is_passed_on_unchanged() -> None:
    with pytest.raises(DecodeError, match="unknown_tpid"):
        wsmp.decode(as_wsm(SECURED, forwarded_psid=None))
