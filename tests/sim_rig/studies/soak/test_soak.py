"""The parts of the soak study, in small runs."""

import asyncio
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from onboard.messages import bsm
from onboard.security.key_files import write_credentials
from onboard.security.security_services import SecurityServices
from onboard.tools.test_ca.authority import make_trial
from onboard.wave_udp import psid, wsmp
from sim_rig.studies.soak.fleet import REMOTE_VEHICLES, Fleet
from sim_rig.studies.soak.load import load
from sim_rig.studies.soak.testbench import run_daemons


def test_bsm_load_sends_all_that_is_due_as_valid_bsms_of_many_vehicles(tmp_path: Path) -> None:
    utc_s = time.time()
    trial = make_trial(["background", "own"], {psid.BSM}, utc_s, pseudonyms=20)
    write_credentials(tmp_path / "background", trial["background"])
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        wire.bind(("127.0.0.1", 0))
        wire.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        port = str(wire.getsockname()[1])
        command = [sys.executable, "-m", "sim_rig.studies.soak.bsm_load", port, "500", "0.5", "0"]
        output = subprocess.run(
            [*command, str(tmp_path / "background")], capture_output=True, text=True, check=True
        )
        wire.setblocking(False)
        received = []
        while True:
            try:
                received.append(wire.recv(2048))
            except BlockingIOError:
                break

    assert len(received) == int(output.stdout) == 250
    own, now = SecurityServices(utc_s, trial["own"]), time.time() - utc_s
    opened = [own.open(wsmp.decode(each).payload, psid.BSM, now) for each in received]
    cores = [bsm.decode(each.payload).core for each in opened]
    assert len({core.temporary_id for core in cores}) == 20
    assert len({each.signer_id for each in opened}) == 20
    assert all(core.latitude_deg is not None for core in cores)


def test_the_fleet_receives_bsms_of_remote_vehicles() -> None:
    fleet = Fleet(np.random.default_rng(1))
    fleet.drive(4.0)

    assert fleet.remote_vehicles_met == REMOTE_VEHICLES
    assert fleet.messages == REMOTE_VEHICLES * 20


@pytest.mark.live
def test_a_daemon_in_background_traffic_still_warns(tmp_path: Path) -> None:
    found = asyncio.run(load(tmp_path, rate_hz=500.0, during_s=8.0))

    assert found.sent == pytest.approx(4000, rel=0.1)
    assert found.dropped_by_kernel == 0
    assert min(found.due) >= 6
    assert len(found.unloaded_ms) > found.due[0] // 2
    assert len(found.loaded_ms) > found.due[1] // 2


@pytest.mark.live
def test_daemons_run_side_by_side(tmp_path: Path) -> None:
    found = asyncio.run(run_daemons(tmp_path, cars=3, during_s=5.0))

    assert len(found.cores) == len(found.memory_mib) == 3
    assert min(found.sent_per_s) > 5.0
    assert max(found.longest_gaps_s) < 1.0
