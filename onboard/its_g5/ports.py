"""Ports of BTP (TS 103 248), by the ITS-AID under which a message is signed (TS 102 965)."""

from onboard.wave_udp import psid

LCCA = 0xC000 + 0x20
"""Of LCCA messages, an own choice among the ports that are not registered."""

OF_SERVICES = {
    psid.CAM: 2001,
    psid.DENM: 2002,
    psid.MAPEM: 2003,
    psid.SPATEM: 2004,
    psid.CPM: 2009,
    psid.VAM: 2018,
}
"""Those of the standards."""
