"""Sends signed BSMs of many remote vehicles to one daemon at a constant rate.

    python -m sim_rig.studies.soak.bsm_load PORT RATE_HZ SECONDS BEGIN_AT KEYS_FOLDER

Each pseudonym in the folder is a remote vehicle, parked along the road from (LATITUDE_DEG,
LONGITUDE_DEG) on; they send in turns. BEGIN_AT is a time of the monotonic clock. At the end the
number of messages is printed.
"""

import contextlib
import socket
import sys
import time
from collections.abc import Iterator
from itertools import count
from pathlib import Path

from onboard.messages import bsm
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData
from onboard.security.credentials import Credentials
from onboard.security.key_files import read_credentials
from onboard.security.security_services import SecurityServices
from onboard.wave_udp import psid, wsmp
from onboard.wave_udp.wsmp import WaveShortMessage

LATITUDE_DEG, LONGITUDE_DEG = 52.0, 5.0
_APART_DEG = 3.0 / 111_000
BURST_S = 0.005
"""Messages due in this time are sent together, as a radio unit forwards its queue."""


def main() -> None:
    """Send all that is due in the time; what is late is sent at once."""
    port, rate_hz, seconds, begin_at = (float(word) for word in sys.argv[1:5])
    messages = _messages(read_credentials(Path(sys.argv[5])))
    time.sleep(max(0.0, begin_at - time.monotonic()))
    began_at = time.monotonic()
    sent = 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        wire.connect(("127.0.0.1", int(port)))
        while sent < seconds * rate_hz:
            passed_s = min(time.monotonic() - began_at, seconds)
            while sent < passed_s * rate_hz:
                with contextlib.suppress(ConnectionRefusedError):  # the daemon has ended
                    wire.send(next(messages))
                sent += 1
            time.sleep(BURST_S)
    print(sent)  # noqa: T201 (the program's output)


def _messages(credentials: Credentials) -> Iterator[bytes]:
    """Frames of all remote vehicles in turns."""
    utc_offset_s = time.time() - time.monotonic()
    vehicles = [
        SecurityServices(
            utc_offset_s, Credentials((own,), credentials.roots, credentials.authorities)
        )
        for own in credentials.pseudonyms
    ]
    for turn in count():
        for number, vehicle in enumerate(vehicles):
            now = time.monotonic()
            core = CoreData(
                turn % 128,
                (0x5000_0000 + number).to_bytes(4),
                sec_mark_s=(now + utc_offset_s) % 60.0,
                latitude_deg=LATITUDE_DEG + number * _APART_DEG,
                longitude_deg=LONGITUDE_DEG,
                speed_m_s=0.0,
                heading_rad=0.0,
            )
            secured = vehicle.secure(bsm.encode(BasicSafetyMessage(core)), psid.BSM, now)
            yield wsmp.encode(WaveShortMessage(psid=psid.BSM, payload=secured))


if __name__ == "__main__":
    main()
