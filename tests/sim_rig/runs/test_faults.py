"""The faults of scenarios, each tested where it is injected."""

import time
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from onboard.kinematics.units import KM_H
from onboard.messages import bsm, lcca
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import CoreData
from onboard.messages.bsm_safety import VehicleEventFlags
from onboard.messages.lcca import NO_ID, Reply, Warn
from onboard.obd.can_frame import CanFrame
from onboard.obd.settings import ObdSettings
from onboard.obd.vehicle_bus import VehicleBus
from onboard.observations import Discarded, Speed
from onboard.security import ieee1609dot2
from onboard.security.credentials import Credentials
from onboard.security.p256 import key_from
from onboard.security.security_services import SecurityServices
from onboard.settings import parse_settings
from onboard.tools.test_ca.authority import make_trial
from onboard.wave_udp import psid, wsmp
from onboard.wave_udp.wsmp import WaveShortMessage
from sim_rig.cars.faulty_ecu import FaultyEcu
from sim_rig.cars.vehicle_faults import VehicleFaults
from sim_rig.processes.wrong_clock import Clock
from sim_rig.radio.attacker import GHOST_ID
from sim_rig.radio.faulty_air import FaultyAir
from sim_rig.radio.models import open_air
from sim_rig.roads.breakpoints import BreakpointRoad
from sim_rig.runs.virtual import run_virtual
from sim_rig.scenario.faults import SlowCpu, WrongClock
from sim_rig.scenario.schema import Scenario
from sim_rig.scenario.sensor_settings import EcuSettings
from sim_rig.studies.faults.fault_cases import CASES, FaultCase
from sim_rig.studies.faults.faults_study import outcome_of, scenario_of
from tests.typed import a

SPEED_M_S = 20.0
SPEED_REQUEST = CanFrame(0.0, 0x7DF, is_extended_id=False, data=b"\x02\x01\x0d".ljust(8, b"\0"))


def scenario_with(*faults: dict[str, Any]) -> Scenario:
    """Ann drives 12 m ahead of Ben; each fault lasts from 10 to 20 s."""
    tree = {
        "title": "Two cars drive, one behind the other.",
        "seed": 1,
        "duration_s": 30.0,
        "radio": {"reach_m": 300.0},
        "cars": {
            name: {"plate": plate, "lane": 1, "start_m": start_m, "speed_m_s": SPEED_M_S}
            for name, plate, start_m in (("ann", "AA11", 50.0), ("ben", "BB22", 33.5))
        },
        "faults": [{"car": "ann", "from_s": 10.0, "until_s": 20.0, **fault} for fault in faults],
        "expect": [],
    }
    return parse_settings(tree, Scenario, "faults")


# ---- the bus ------------------------------------------------------------------------------


def bus_events(*faults: dict[str, Any], from_s: float, until_s: float) -> list[object]:
    """Events of the car's bus core with an ECU that has these faults."""
    ecu = FaultyEcu(
        scenario_with(*faults),
        "ann",
        lambda _: SPEED_M_S,
        lambda now: now,
        np.random.default_rng(1),
    )
    bus = VehicleBus(ObdSettings())
    events: list[object] = []
    for now in np.arange(from_s, until_s, 0.001).tolist():
        bus.handle_timer(now)
        for frame in bus.frames_to_send(now):
            ecu.receive_frame(frame, now)
        for frame in ecu.frames_to_send(now):
            bus.receive_frame(frame, now)
        events += iter(bus.next_event, None)
    return events


def test_an_ecu_that_refreshes_its_speed_tells_one_until_the_next() -> None:
    slow = scenario_with().model_copy(update={"ecu": EcuSettings(refresh_s=0.1)})
    ecu = FaultyEcu(slow, "ann", lambda now: now, lambda now: now, np.random.default_rng(1))
    sent = []
    for now in np.arange(20.0, 30.0, 0.01).tolist():
        ecu.receive_frame(SPEED_REQUEST, now)
        sent += [frame.data[3] * KM_H for frame in ecu.frames_to_send(now + 0.004)]
    ages_s = np.arange(20.0, 30.0, 0.01) - sent
    assert len(sent) == 1000
    assert np.mean(ages_s) == pytest.approx(0.05, abs=0.02)


def speeds(events: list[object]) -> list[float]:
    return [event.speed_m_s for event in events if isinstance(event, Speed)]


def reasons(events: list[object]) -> set[str]:
    return {event.reason for event in events if isinstance(event, Discarded)}


def test_a_scaled_speed_is_wrong_only_during_the_fault() -> None:
    scaled = {"what": "speed_scaled", "factor": 1.6}

    assert set(speeds(bus_events(scaled, from_s=8.0, until_s=9.0))) == {SPEED_M_S}
    assert speeds(bus_events(scaled, from_s=11.0, until_s=12.0))[-1] == pytest.approx(32.0, abs=0.2)


def test_negative_responses_give_no_speed_and_are_counted() -> None:
    events = bus_events({"what": "ecu_refuses"}, from_s=11.0, until_s=12.0)

    assert speeds(events) == []
    assert reasons(events) == {"negative_response"}


def test_babbling_frames_are_counted_and_the_speed_is_still_received() -> None:
    events = bus_events({"what": "ecu_babbles", "rate_hz": 1000.0}, from_s=11.0, until_s=13.0)

    assert len(speeds(events)) > 10
    assert len([event for event in events if isinstance(event, Discarded)]) > 100


def test_babbling_frames_have_the_configured_rate() -> None:
    ecu = FaultyEcu(
        scenario_with({"what": "ecu_babbles", "rate_hz": 400.0}),
        "ann",
        lambda _: SPEED_M_S,
        lambda now: now,
        np.random.default_rng(1),
    )
    frames: list[CanFrame] = []
    now = 0.0
    while (at := ecu.get_timer()) < 30.0:
        now = max(now, at)
        frames += ecu.frames_to_send(now)

    assert len(frames) == pytest.approx(4000, rel=0.02)
    assert all(10.0 <= frame.stamp_s < 20.0 for frame in frames)


# ---- clock, processor, GNSS ---------------------------------------------------------------


def test_the_error_of_a_drifting_clock_grows_with_time() -> None:
    fault = {"what": "clock_wrong", "skew_s": 1.0, "drift_ppm": 1000.0}
    car = VehicleFaults(scenario_with(fault), "ann")

    assert [car.clock_error_s(at) for at in (9.9, 10.0, 15.0, 20.0)] == pytest.approx(
        [0.0, 1.0, 1.005, 0.0]
    )
    assert not VehicleFaults(scenario_with(fault), "ben").has_wrong_clock


def test_the_clock_of_a_live_daemon_is_wrong_from_the_start_of_the_scenario(
    tmp_path: Path,
) -> None:
    fault = WrongClock(what="clock_wrong", car="ann", from_s=0.0, until_s=60.0, skew_s=100.0)
    begins = tmp_path / "begins"
    clock = Clock(begins, [fault])
    assert clock() == pytest.approx(time.time(), abs=1.0)

    begins.write_text(repr(time.monotonic()))
    clock._check_at = 0.0
    assert clock() == pytest.approx(time.time() + 100.0, abs=1.0)


def test_a_slow_processor_sleeps_its_share_of_each_period() -> None:
    fault = SlowCpu(what="cpu_slow", car="ann", from_s=10.0, until_s=20.0, share=0.25, period_s=0.2)

    assert [fault.wakes_at_s(at) for at in (10.0, 10.04, 10.1, 10.3)] == pytest.approx(
        [10.0, 10.04, 10.2, 10.4]
    )
    wakes = [fault.wakes_at_s(at) for at in np.arange(10.0, 20.0, 0.013).tolist()]
    assert all(fault.wakes_at_s(at) == at for at in wakes)


def test_a_gnss_jump_shifts_the_position_and_silence_gives_none() -> None:
    scenario = scenario_with(
        {"what": "gnss_jump", "east_m": 30.0}, {"what": "gnss_silent", "until_s": 12.0}
    )
    here = BreakpointRoad(scenario).car_at("ann", 15.0)
    car = VehicleFaults(scenario, "ann")

    assert car.received(here, 11.0) is None
    there = car.received(here, 15.0)
    assert there is not None
    assert there.x_m - here.x_m == pytest.approx(30.0)
    assert car.received(here, 25.0) == here


# ---- the radio ----------------------------------------------------------------------------

UTC_S = 1_750_000_000.0


class Air:
    """The channel of a scenario with faults, and the messages that each car receives."""

    def __init__(
        self, *faults: dict[str, Any], credentials: Mapping[str, Credentials] | None = None
    ) -> None:
        scenario = scenario_with(*faults)
        road = BreakpointRoad(scenario)
        inner = open_air(scenario.radio, road.cars_at, ["ann", "ben"], np.random.default_rng(1))
        self.air = FaultyAir(inner, scenario, lambda now: now, UTC_S, credentials or {})
        self.received: dict[str, list[bytes]] = {"ann": [], "ben": []}

    def send_unsecured(self, car: str, payload: bytes, service: int, now: float) -> bytes:
        return self.send(car, ieee1609dot2.encode_unsecured(payload), service, now)

    def send(self, car: str, data: bytes, service: int, now: float) -> bytes:
        wsm = wsmp.encode(WaveShortMessage(psid=service, payload=data))
        self.air.receive_wsm(car, wsm, 5, now)
        return wsm

    def pass_until(self, end: float) -> None:
        while (at := self.air.get_timer()) <= end:
            for delivery in self.air.wsms_to_deliver(at):
                self.received[delivery.receiver].append(delivery.wsm)

    def payloads(self, car: str, service: int) -> list[bytes]:
        frames = map(wsmp.decode, self.received[car])
        return [ieee1609dot2.decode(f.payload).payload for f in frames if f.psid == service]


@pytest.mark.parametrize(
    ("what", "received_by_ann", "received_by_ben"), [("radio_gone", 1, 1), ("radio_mute", 2, 1)]
)
def test_a_radio_that_is_gone_or_mute_sends_nothing(
    what: str, received_by_ann: int, received_by_ben: int
) -> None:
    air = Air({"what": what})
    for now in (5.0, 15.0):
        air.send_unsecured("ann", b"from ann", psid.LCCA, now)
        air.send_unsecured("ben", b"from ben", psid.LCCA, now)
        air.pass_until(now + 1.0)

    assert (len(air.received["ann"]), len(air.received["ben"])) == (
        received_by_ann,
        received_by_ben,
    )


def test_a_forged_brake_is_a_warning_to_the_attackers_group() -> None:
    air = Air({"what": "forged_brake", "every_s": 2.0})
    reply = Reply(b"ann.....", b"leader..", 2, b"ben.....", 7, 1, 15.0, NO_ID)
    air.send_unsecured("ann", lcca.encode(reply), psid.LCCA, 11.0)
    air.pass_until(25.0)

    forged = [lcca.decode(each).message for each in air.payloads("ben", psid.LCCA)][1:]
    assert len(forged) == 5
    assert all(isinstance(warn, Warn) for warn in forged)
    assert {(warn.leader_id, warn.number) for warn in forged} == {(b"leader..", 2)}  # type: ignore[union-attr]
    assert len({warn.event_sequence for warn in forged}) == 5  # type: ignore[union-attr]


def test_an_attacker_signs_with_the_current_pseudonym_of_its_car() -> None:
    rng = np.random.default_rng(1)
    trial = make_trial(["ann"], {psid.LCCA}, UTC_S, key_from(rng), pseudonyms=3)
    air = Air({"what": "forged_brake", "every_s": 1.0}, credentials=trial)
    reply = lcca.encode(Reply(b"ann.....", b"leader..", 2, b"ben.....", 7, 1, 15.0, NO_ID))
    own = SecurityServices(UTC_S, trial["ann"])
    for now, credential in zip((11.2, 15.2), reversed(trial["ann"].pseudonyms), strict=False):
        own.sign_with(credential)
        air.send("ann", own.secure(reply, psid.LCCA, now), psid.LCCA, now)
        air.received["ben"].clear()
        air.pass_until(now + 3.5)

        decoded = [ieee1609dot2.decode(wsmp.decode(each).payload) for each in air.received["ben"]]
        assert len(decoded) == 5
        signers = [each.signer for each in decoded if isinstance(each, ieee1609dot2.SignedData)]
        certificates = [each[0] for each in signers if isinstance(each, tuple)]
        digests = [each for each in signers if isinstance(each, bytes)]
        assert {each.hashed_id8 for each in certificates} | set(digests) == {
            credential.certificate.hashed_id8
        }


def test_a_ghost_car_drives_ahead_brakes_plausibly_and_reports_it() -> None:
    air = Air({"what": "ghost_car", "every_s": 4.0, "ahead_m": 30.0})
    core = CoreData(1, b"real", 1.0, 25.0, 121.0, speed_m_s=15.0, heading_rad=0.0)
    air.send_unsecured("ann", bsm.encode(BasicSafetyMessage(core)), psid.BSM, 11.0)
    air.pass_until(19.0)

    decoded = [bsm.decode(each) for each in air.payloads("ben", psid.BSM)]
    ghost = [message for message in decoded if message.core.temporary_id == GHOST_ID]
    assert len(ghost) == pytest.approx(80, abs=2)
    assert ghost[0].core.latitude_deg == pytest.approx(25.0 + 30.0 / 111_320.0, abs=1e-6)
    speeds_m_s = [a(float, message.core.speed_m_s) for message in ghost]
    assert min(speeds_m_s) < 4.0
    assert all(abs(later - sooner) <= 0.7 for sooner, later in pairwise(speeds_m_s))
    braking = [m for m in ghost if m.safety and m.safety.events == VehicleEventFlags.HARD_BRAKING]
    assert len(braking) == pytest.approx(40, abs=2)


def test_a_replayed_message_is_received_again_after_its_delay() -> None:
    air = Air({"what": "replay", "delay_s": 3.0})
    wsm = air.send_unsecured("ben", b"sent once", psid.LCCA, 11.0)
    air.pass_until(13.0)
    assert air.received == {"ann": [wsm], "ben": []}
    air.pass_until(20.0)

    assert air.received == {"ann": [wsm], "ben": [wsm]}


# ---- the study ----------------------------------------------------------------------------


def case(fault: str, car: str) -> FaultCase:
    return next(each for each in CASES if (each.fault, each.car) == (fault, car))


@pytest.mark.long
@pytest.mark.parametrize("severity", ["0.3", "1 for 10 s"])
def test_readings_of_another_plate_miss_no_warning_while_the_car_is_tracked(severity: str) -> None:
    misread = next(
        each for each in CASES if (each.fault, each.severity) == ("plate misread", severity)
    )
    outcome = outcome_of(run_virtual(scenario_of(misread), 1), misread)

    assert (outcome.missed, outcome.missed_after, outcome.false) == (0.0, 0.0, 0)


@pytest.mark.long
def test_a_silent_ecu_of_the_braking_car_is_detected_and_recovered_from() -> None:
    silent = case("ECU silent", "green")
    outcome = outcome_of(run_virtual(scenario_of(silent)), silent)

    assert (outcome.missed, outcome.missed_after, outcome.false) == (1.0, 0.0, 0)
    assert outcome.shown_s is not None
    assert outcome.shown_s < 1.0
    assert outcome.recovered_s is not None
    assert outcome.recovered_s < 5.0


def test_every_case_is_a_valid_scenario() -> None:
    assert all(scenario_of(each).duration_s > 0.0 for each in CASES)
