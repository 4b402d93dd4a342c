"""A crossing's MAP message for a real road-side unit, which stores and repeats it.

Both forms let the unit sign the message. They are as V2X Hub writes them; no unit was tried.
"""

from datetime import UTC, datetime
from enum import StrEnum

from onboard.errors import UserError
from onboard.messages import map_data
from onboard.wave_udp import immediate_forward, psid
from onboard.wave_udp.immediate_forward import ImmediateForward
from onboard.wave_udp.psid import p_encode
from onboard.wave_udp.settings import RadioProfile
from sim_rig.road_side.road_side_unit import RoadSideUnit
from sim_rig.road_side.signal_messages import map_message
from sim_rig.scenario.schema import Scenario

INTERVAL_S = 1
"""Between two MAP messages (CTI 4501)."""
_ROW = "1.3.6.1.4.1.1206.4.2.18.3.2.1"
"""Entry of NTCIP 1218's rsuMsgRepeatStatusTable."""
_ON, _CREATE_AND_GO = 1, 4
_TO_BE_SIGNED = "80"
"""Process1609.2: bit 0 of rsuMsgRepeatOptions, which is the most significant one."""


class UnitForm(StrEnum):
    """What the unit takes."""

    RSU41 = "rsu41"
    """A file of the USDOT RSU Specification 4.1 for Store and Repeat."""
    NTCIP1218 = "ntcip1218"
    """A row of NTCIP 1218's rsuMsgRepeatStatusTable, as arguments of Net-SNMP's `snmpset`."""


def stored_map(
    scenario: Scenario,
    form: UnitForm,
    *,
    channel: int,
    index: int,
    start_s: float,
    stop_s: float,
) -> str:
    """Return what makes a unit repeat the MAP message of a scenario's crossing.

    Args:
        scenario: with signals.
        form: what the unit takes.
        channel: on which it sends.
        index: of the row; a file has none.
        start_s: when it begins to send, UTC in seconds since 1970.
        stop_s: when it ends.

    Raises:
        UserError: the scenario has no signals, or is of ITS-G5.
    """
    if scenario.signal is None:
        raise UserError("the scenario has no signal, and so no MAP message")
    if scenario.profile is RadioProfile.ITS_G5:
        raise UserError("profile: its-g5 has MAPEM; RSU 4.1 and NTCIP 1218 are for wave")
    payload = map_data.encode(map_message(scenario, scenario.signal))
    start, stop = (datetime.fromtimestamp(each, UTC) for each in (start_s, stop_s))
    if form is UnitForm.RSU41:
        message = ImmediateForward(
            "MAP",
            psid.MAP,
            RoadSideUnit.user_priority,
            payload,
            tx_channel=str(channel),
            tx_interval=str(INTERVAL_S),
            delivery_start=f"{start:%m/%d/%Y, %H:%M}",
            delivery_stop=f"{stop:%m/%d/%Y, %H:%M}",
            signature=True,
        )
        return immediate_forward.encode(message).decode()
    columns = (
        (2, "x", p_encode(psid.MAP).hex()),
        (3, "i", channel),
        (4, "i", INTERVAL_S * 1000),
        (5, "x", _date_and_time(start)),
        (6, "x", _date_and_time(stop)),
        (7, "x", payload.hex()),
        (8, "i", _ON),
        (9, "i", _CREATE_AND_GO),
        (10, "i", RoadSideUnit.user_priority),
        (11, "x", _TO_BE_SIGNED),
    )
    return "".join(f"{_ROW}.{column}.{index} {kind} {value}\n" for column, kind, value in columns)


def _date_and_time(utc: datetime) -> str:
    """Return DateAndTime of SNMPv2-TC in hex: year in two octets, and one each to tenths."""
    rest = bytes((utc.month, utc.day, utc.hour, utc.minute, utc.second, 0))
    return (utc.year.to_bytes(2) + rest).hex()
