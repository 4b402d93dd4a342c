"""Requests as datagrams and as CAN frames by DBC."""

from pathlib import Path
from typing import Any

import cantools
import pytest
from cantools.database import Database
from hypothesis import given
from hypothesis import strategies as st

from onboard.brake_request import datagram
from onboard.brake_request.brake_requester import COUNTER_END, BrakeRequest
from onboard.brake_request.dbc_frame import RequestFrameLayout, crc8_j1850
from onboard.brake_request.settings import RequestFrameSettings
from onboard.errors import DecodeError, UserError
from onboard.risk.fcw import FCW
from tests.typed import a

DBC = """VERSION ""
NS_ :
BS_:
BU_: CAR
BO_ 800 BRAKE_REQUEST: 6 CAR
 SG_ DECELERATION : 7|12@0+ (0.01,0) [0|10] "m/s^2" CAR
 SG_ REQUESTED : 8|1@1+ (1,0) [0|1] "" CAR
 SG_ CERTAINTY : 16|7@1+ (1,0) [0|100] "%" CAR
 SG_ SHARE : 24|8@1+ (0.005,0) [0|1] "" CAR
 SG_ COUNTER : 32|4@1+ (1,0) [0|15] "" CAR
 SG_ CHECKSUM : 40|8@1+ (1,0) [0|255] "" CAR
BO_ 804 MISFIT: 6 CAR
 SG_ DECELERATION : 0|8@1+ (0.05,0) [0|12] "m/s^2" CAR
 SG_ SMALL : 8|8@1+ (0.01,0) [0|2.5] "m/s^2" CAR
 SG_ FORCE : 16|8@1+ (1,0) [0|255] "N" CAR
 SG_ SIGNED : 24|8@1- (1,0) [-128|127] "" CAR
 SG_ NIBBLE : 32|4@1+ (1,0) [0|15] "" CAR
 SG_ SHARE : 40|8@1+ (0.005,0) [0|1] "" CAR
BO_ 801 OTHER: 1 CAR
 SG_ DECELERATION : 0|8@1+ (0.05,0) [0|12] "m/s^2" CAR
BO_ 2015 OBD: 1 CAR
 SG_ DECELERATION : 0|8@1+ (0.05,0) [0|12] "m/s^2" CAR
BO_ 2564502513 OBD_29: 1 CAR
 SG_ DECELERATION : 0|8@1+ (0.05,0) [0|12] "m/s^2" CAR
BO_ 803 LONG: 12 CAR
 SG_ DECELERATION : 0|8@1+ (0.05,0) [0|12] "m/s^2" CAR
"""
WHOLE = {
    "deceleration": "BRAKE_REQUEST.DECELERATION",
    "certainty": "BRAKE_REQUEST.CERTAINTY",
    "is_requested": "BRAKE_REQUEST.REQUESTED",
    "counter": "BRAKE_REQUEST.COUNTER",
    "checksum": "BRAKE_REQUEST.CHECKSUM",
}


def layout(text: str = DBC, **names: Any) -> RequestFrameLayout:
    settings = RequestFrameSettings(channel="can1", dbc=Path("car.dbc"), **names)
    return RequestFrameLayout(settings, text, 6.0)


def request(
    deceleration_m_s2: float = 5.23, certainty: float = 0.9, counter: int = 17
) -> BrakeRequest:
    return BrakeRequest(3.0, deceleration_m_s2, certainty, 0.3, counter, (FCW,))


def decoded(data: bytes) -> dict[str, float]:
    database = a(Database, cantools.database.load_string(DBC, "dbc"))
    found: dict[str, float] = a(dict, database.decode_message(800, data))
    del found["SHARE"]
    return found


def test_the_check_value_of_the_checksum() -> None:
    """CRC-8/SAE-J1850 of the digits 1 to 9, as catalogues of CRCs state it."""
    assert crc8_j1850(b"123456789") == 0x4B


@given(st.floats(0.0, 6.0), st.floats(0.0, 1.0), st.integers(0, COUNTER_END - 1))
def test_a_frame_carries_the_request(d_m_s2: float, certainty: float, counter: int) -> None:
    frame = layout(**WHOLE).frame(request(d_m_s2, certainty, counter))

    assert (frame.stamp_s, frame.arbitration_id, frame.is_extended_id) == (3.0, 800, False)
    assert decoded(frame.data) == {
        "DECELERATION": pytest.approx(d_m_s2, abs=0.0051),
        "REQUESTED": d_m_s2 > 0.0,
        "CERTAINTY": pytest.approx(100.0 * certainty, abs=0.51),
        "COUNTER": counter % 16,
        "CHECKSUM": crc8_j1850(frame.data[:-1] + b"\0"),
    }


def test_only_the_deceleration_is_required() -> None:
    data = layout(deceleration=WHOLE["deceleration"]).frame(request()).data

    assert decoded(data) == {
        "DECELERATION": 5.23, "REQUESTED": 0, "CERTAINTY": 0, "COUNTER": 0, "CHECKSUM": 0,
    }  # fmt: skip


def test_a_certainty_without_unit_is_a_share() -> None:
    data = (
        layout(deceleration=WHOLE["deceleration"], certainty="BRAKE_REQUEST.SHARE")
        .frame(request())
        .data
    )

    assert data[3] == 180


@pytest.mark.parametrize(
    ("names", "error"),
    [
        ({"deceleration": "MISFIT.FORCE"}, r"deceleration: .*FORCE has the unit 'N'; allow"),
        ({"deceleration": "MISFIT.SMALL"}, "SMALL"),
        ({"deceleration": "MISFIT.NONE"}, r"car.dbc: not each of MISFIT.NONE is"),
        ({"deceleration": "OBD.DECELERATION"}, "0x7DF, an identifier of OBD"),
        ({"deceleration": "OBD_29.DECELERATION"}, "0x18DB33F1, an identifier of OBD"),
        ({"deceleration": "LONG.DECELERATION"}, "longer than 8 bytes"),
        ({"counter": "OTHER.DECELERATION"}, "several messages: MISFIT, OTHER"),
        ({"certainty": "MISFIT.FORCE"}, "certainty: .*allowed: none, %"),
        ({"checksum": "MISFIT.NIBBLE"}, "checksum: .*not an unsigned byte"),
        ({"checksum": "MISFIT.SIGNED"}, "checksum: .*not an unsigned byte"),
        ({"counter": "MISFIT.SHARE"}, "counter: .*not an unsigned whole number"),
        ({"is_requested": "MISFIT.SIGNED"}, "is_requested: .*not an unsigned whole number"),
    ],
)
def test_a_signal_that_does_not_fit_is_an_error(names: dict[str, str], error: str) -> None:
    with pytest.raises(UserError, match=error):
        layout(**({"deceleration": "MISFIT.DECELERATION"} | names))


def test_a_file_that_is_no_dbc_file_is_an_error() -> None:
    broken = DBC.replace("7|12@0+", "7|99999@0+")
    with pytest.raises(UserError, match=r"car\.dbc"):
        layout(broken, **WHOLE)


@given(st.floats(0.0, 10.0), st.floats(0.0, 1.0), st.integers(0, COUNTER_END - 1))
def test_a_datagram_carries_the_request(d_m_s2: float, certainty: float, counter: int) -> None:
    found = datagram.decode(datagram.encode(request(d_m_s2, certainty, counter)))

    assert found == datagram.RequestDatagram(
        deceleration_m_s2=round(d_m_s2, 3),
        certainty=round(certainty, 3),
        valid_s=0.3,
        counter=counter,
        causes=(FCW,),
    )


@pytest.mark.parametrize("data", [b"", b"\xff", b"{}", b"[]", datagram.encode(request())[:-1]])
def test_what_is_no_request_is_refused(data: bytes) -> None:
    with pytest.raises(DecodeError, match="no_request"):
        datagram.decode(data)
