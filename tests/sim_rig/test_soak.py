"""The parts of the soak study, small."""

import socket
import subprocess
import sys

import numpy as np
import pytest

from onboard.messages import bsm
from onboard.security import ieee1609dot2
from onboard.wave_udp import wsmp
from sim_rig.studies.soak_fleet import STRANGERS, Fleet


def test_a_flood_keeps_its_rate_and_is_made_of_messages() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        wire.bind(("127.0.0.1", 0))
        wire.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        port = str(wire.getsockname()[1])
        command = [sys.executable, "-m", "sim_rig.flood", port, "500", "0.5", "0"]
        told = subprocess.run(command, capture_output=True, text=True, check=True)
        wire.setblocking(False)
        heard = []
        while True:
            try:
                heard.append(wire.recv(2048))
            except BlockingIOError:
                break

    assert len(heard) == int(told.stdout) == pytest.approx(250, rel=0.2)
    frames = [wsmp.decode(each) for each in heard]
    cores = [bsm.decode(ieee1609dot2.decode(f.payload).payload).core for f in frames]
    assert len({core.temporary_id for core in cores}) > 200


def test_the_fleet_meets_strangers_that_come_and_go() -> None:
    fleet = Fleet(np.random.default_rng(1))
    fleet.drive(4.0)

    assert fleet.strangers_met == STRANGERS
    assert fleet.messages == STRANGERS * 20
