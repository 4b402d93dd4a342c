"""Provider service identifiers (PSID, IEEE 1609.12)."""

from onboard.errors import DecodeError

HIGHEST = 0x1020407F
"""Greatest PSID of four octets (IEEE 1609.12-2019, 4.1)."""

BSM = 0x20
"""Vehicle to vehicle safety and awareness: the J2735 BasicSafetyMessage."""

CAM = 0x24
"""Cooperative awareness of ETSI ITS (TS 102 965): the CAM."""

DENM = 0x25
"""Decentralised environmental notification of ETSI ITS (TS 102 965): the DENM."""

SPATEM = 0x89
"""Traffic light manoeuvres of ETSI ITS (TS 102 965): the SPATEM."""

MAPEM = 0x8A
"""Road and lane topology of ETSI ITS (TS 102 965): the MAPEM."""

VAM = 0x27E
"""Vulnerable road users of ETSI ITS (TS 102 965): the VAM."""

CPM = 0x27F
"""Collective perception of ETSI ITS (TS 102 965): the CPM."""

PSM = 0x27
"""Vulnerable road users safety: the J2735 PersonalSafetyMessage."""

AWARENESS = frozenset({BSM, CAM, PSM, VAM})
"""Services whose messages each vehicle or person repeats: their certificate is attached now and
then."""

SPAT = 0x82
"""Intersection safety and awareness: the J2735 SPAT message."""

SENSOR_SHARING = 0x90
"""Sensor sharing service: the J3224 SensorDataSharingMessage; p-encoded as 0p80-10."""

MAP = 0x204097
"""Intersection geometry: the J2735 MapData message; p-encoded as 0pE0-00-00-17."""

SIGNALS = frozenset({MAP, SPAT, MAPEM, SPATEM})
"""Services of signals and of the lanes that they are for."""

PEER_TO_PEER = 0x88
"""Peer-to-peer distribution of certificates (IEEE 1609.2, clause 8)."""

CRL = 0x100
"""Certificate revocation lists (IEEE 1609.2, 7.4)."""

J2735 = frozenset({BSM, PSM, SPAT, MAP, SENSOR_SHARING})
"""Services whose messages are J2735 MessageFrames."""

PRIVATE_USE = range(0x4020, 0x4060)
"""0pBF-A0 to 0pBF-DF, 64 values for unregistered use by mutual agreement (IEEE 1609.12-2019, 4.1;
ISO/TC 204 registry of ITS-AIDs). The values for testing beside them need an authorisation."""

LCCA = PRIVATE_USE[0]
"""PSID of LCCA messages, unless configured otherwise."""

OWN = J2735 | {CAM, DENM, CPM, VAM, MAPEM, SPATEM, PEER_TO_PEER, CRL}
"""Services whose messages are made or used here."""

OF_ROAD_SIDE_UNITS = frozenset({MAP, SPAT, SENSOR_SHARING})
"""Services in which road-side units send."""

OF_VEHICLES = frozenset({BSM, SENSOR_SHARING, LCCA})
"""Services in which vehicles send."""

OF_ITS_ROAD_SIDE_UNITS = frozenset({MAPEM, SPATEM, CPM})
"""Those of units with ITS-G5."""

OF_ITS_VEHICLES = frozenset({CAM, DENM, CPM, LCCA})
"""Those of vehicles with ITS-G5."""

NAMES = {
    BSM: "vehicle to vehicle safety and awareness",
    0x23: "WAVE security management",
    CAM: "cooperative awareness",
    DENM: "decentralized environmental notification",
    0x26: "misbehavior reporting",
    PSM: "vulnerable road users safety",
    0x7F: "testing",
    SPAT: "intersection safety and awareness",
    0x83: "traveler information and roadside signage",
    0x85: "emergency and erratic vehicles",
    0x87: "WAVE service advertisement",
    SPATEM: "traffic light manoeuvre",
    MAPEM: "road and lane topology",
    PEER_TO_PEER: "peer-to-peer distribution of security management information",
    SENSOR_SHARING: "sensor sharing service",
    0x91: "maneuver coordination service",
    CRL: "certificate revocation list",
    VAM: "vulnerable road users",
    CPM: "collective perception",
    MAP: "intersection geometry",
    **dict.fromkeys(PRIVATE_USE, "private (unregistered) use"),
}
"""Names as registered, for decoded frames."""

_FIRST = (0, 0x80, 0x4080, 0x204080)
"""The lowest value of each length in octets, so that every value has exactly one encoding."""

_PREFIX = (0, 0x80, 0xC0, 0xE0)


def p_encode(psid: int) -> bytes:
    """Return `psid` in one to four octets (IEEE 1609.12-2019, 4.2).

    Raises:
        ValueError: it is negative or above `HIGHEST`.
    """
    if not 0 <= psid <= HIGHEST:
        raise ValueError(f"a PSID is 0 to {HIGHEST:#x} (given {psid:#x})")
    size = sum(psid >= first for first in _FIRST)
    return (psid - _FIRST[size - 1] + (_PREFIX[size - 1] << 8 * (size - 1))).to_bytes(size)


def p_decode(data: bytes, position: int = 0) -> tuple[int, int]:
    """Return the PSID at `position` of `data`, and the position after it.

    Raises:
        DecodeError: `too_short`, or `bad_psid` where the first octet announces more than four.
    """
    head = data[position : position + 1]
    if not head:
        raise DecodeError("too_short", "ends before the PSID")
    size = 1 + sum(head[0] >= prefix for prefix in _PREFIX[1:])
    if head[0] >= 0xF0:
        raise DecodeError("bad_psid", f"first octet {head[0]:#04x}")
    end = position + size
    if end > len(data):
        raise DecodeError("too_short", "ends within the PSID")
    value = int.from_bytes(data[position:end]) - (_PREFIX[size - 1] << 8 * (size - 1))
    return value + _FIRST[size - 1], end
