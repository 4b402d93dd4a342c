"""A crowded road on one wire: BSMs of many strangers, at a steady rate, to one daemon's port.

    python -m sim_rig.flood PORT RATE_HZ SECONDS BEGIN_AT [KEYS_FOLDER]

It begins at a moment of the monotonic clock. With the keys of a car every message is signed. It
prints how many it has sent.
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
from onboard.security.key_files import read_credentials
from onboard.security.security import Security
from onboard.wave_udp import wsmp
from onboard.wave_udp.wsmp import WaveShortMessage

STRANGERS = 300
BURST_S = 0.005
"""What is due in this time is sent at once, as a radio unit hands over what it has."""


def main() -> None:
    """Send until the time is over."""
    _, port, rate_hz, seconds, begin_at, *keys = sys.argv
    credentials = read_credentials(Path(keys[0])) if keys else None
    security = Security(time.time() - time.monotonic(), credentials)
    messages = _messages(security)
    time.sleep(max(0.0, float(begin_at) - time.monotonic()))
    began_at = time.monotonic()
    sent = 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        wire.connect(("127.0.0.1", int(port)))
        while (passed_s := time.monotonic() - began_at) < float(seconds):
            while sent < passed_s * float(rate_hz):
                with contextlib.suppress(ConnectionRefusedError):  # nobody listens any more
                    wire.send(next(messages))
                sent += 1
            time.sleep(BURST_S)
    print(sent)  # noqa: T201 (what it is asked for)


def _messages(security: Security) -> Iterator[bytes]:
    """Frames of all strangers in turns, standing where nobody knows."""
    for number in count():
        turn, stranger = divmod(number, STRANGERS)
        core = CoreData(turn % 128, (0x5000_0000 + stranger).to_bytes(4))
        payload = bsm.encode(BasicSafetyMessage(core))
        secured = security.secure(payload, bsm.PSID, time.monotonic())
        yield wsmp.encode(WaveShortMessage(psid=bsm.PSID, payload=secured))


if __name__ == "__main__":
    main()
