"""Insiders who claim at the place of the lead vehicle what it does not do: nothing is to brake.

The host follows one lead vehicle after the other, and its own sensors measure all of them. Every
second one truly brakes, while the insiders claim at its place that it drives on; of the others,
which have no radio, they claim that they brake.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from enum import StrEnum
from functools import partial
from typing import NamedTuple

import numpy as np

from onboard.brake_request.brake_requester import BrakeRequest
from onboard.observations import Lead, LeadIdentity, PlateCandidate, VehicleDetection
from onboard.risk.alarm import Alarm, Level
from onboard.security.p256 import key_from
from onboard.tools.test_ca.authority import make_trial
from onboard.wave_udp import psid
from sim_rig.studies.attacks.attack_counts import AttackCounts
from sim_rig.studies.attacks.attack_world import (
    SPEED_M_S,
    STEP_S,
    AttackedHost,
    Counted,
    Signer,
    refused,
)

GAP_M = 15.0
LENGTH_M = 4.5
"""Of all vehicles."""
FACE_TO_CENTRE_M = 2.2
"""From what sensors measure of a vehicle to its centre, as the host assumes."""
LEAD_EVERY_S = 6.0
"""After which the host follows another vehicle."""
BRAKES_AT_S = 2.5
"""After its appearance, in truth or by the insiders."""
BRAKES_FOR_S = 1.5
"""Then it leaves the lane, half-way to the host, which drives on."""
TRUE_M_S2 = 6.0
CLAIMED_M_S2 = 8.0
CLAIMED_FOR_S = 0.3
"""And for as long, the claimed speed rises again to that of the lead vehicle."""
GAP_SIGMA_M = 0.3
PERFECT_M = 0.05
"""The best accuracy of a position that a BSM can state."""
CLOSING_SIGMA_M_S = 1.0
"""That the rig's camera states; its errors are a fifth."""


class OwnSensors(StrEnum):
    """Which of them measure the lead vehicle."""

    CAMERA = "camera"
    DETECTOR = "detector"
    BOTH = "camera and detector"


class ClaimedBraking(NamedTuple):
    """One attack."""

    sensors: OwnSensors
    send: Callable[[AttackedHost, Signer, int, float], Iterator[bytes]]
    """What an insider sends: of the host, its radio, its number, and the time."""


def run_brake_claims(
    claimed: ClaimedBraking,
    seed: tuple[int, ...],
    utc_s: float,
    seconds: float,
    insiders: int,
    *,
    checks: bool,
) -> AttackCounts:
    """Let the host follow vehicles that brake or do not, and insiders claim the contrary.

    Args:
        claimed: what the host sees, and the insiders send.
        seed: of keys and errors of measurement.
        utc_s: at the start, seconds since 1970.
        seconds: duration of the attack.
        insiders: their number.
        checks: whether the host checks brakings and claims.

    Returns:
        Requests to brake instead of alarms, and how many claims alarmed the driver.
    """
    rng = np.random.default_rng(seed)
    names = [f"insider{number}" for number in range(insiders)]
    keys = make_trial(["host", *names], {psid.BSM}, utc_s, key_from(rng), pseudonyms=1)
    host = AttackedHost(
        keys["host"],
        utc_s,
        checks=checks,
        detector=claimed.sensors is not OwnSensors.CAMERA,
        camera=claimed.sensors is not OwnSensors.DETECTOR,
        brake_request={},
    )
    senders = [
        Counted(partial(claimed.send, host, Signer(keys[name], utc_s, name[-4:].encode()), number))
        for number, name in enumerate(names)
    ]
    for _ in range(round(seconds / STEP_S)):
        _observe(host, claimed.sensors, rng)
        host.drive(STEP_S, *senders)
    sent = sum(each.sent for each in senders)
    counts = _count(host, int(seconds // LEAD_EVERY_S))
    return replace(counts, sent=sent, received=sent - refused(host.events))


def _brakes(now: float) -> tuple[int, float, bool] | None:
    """Return the number of the lead vehicle, for how long it is to brake, and whether it does.

    `None` while there is no lead vehicle.
    """
    number, into_s = divmod(now, LEAD_EVERY_S)
    if into_s > BRAKES_AT_S + BRAKES_FOR_S:
        return None
    return int(number), max(into_s - BRAKES_AT_S, 0.0), number % 2.0 == 1.0


def _observe(host: AttackedHost, sensors: OwnSensors, rng: np.random.Generator) -> None:
    """Let the host's sensors measure the lead vehicle at its next step."""
    now = host.now + STEP_S
    brakes = _brakes(now)
    if brakes is None:
        host.seen, host.lead = (), Lead(now, LeadIdentity.NO_LEAD)
        return
    number, braked_s, is_true = brakes
    braking_m_s2 = TRUE_M_S2 if is_true else 0.0
    gap_m = GAP_M - braking_m_s2 * braked_s**2 / 2.0 + float(rng.normal(0.0, GAP_SIGMA_M / 3.0))
    closing_m_s = braking_m_s2 * braked_s + float(rng.normal(0.0, CLOSING_SIGMA_M_S / 5.0))
    if sensors is not OwnSensors.CAMERA:
        host.seen = (VehicleDetection(
            now, number, gap_m, GAP_SIGMA_M, 0.0, 0.005,
            range_rate_m_s=-closing_m_s, range_rate_sigma_m_s=CLOSING_SIGMA_M_S,
        ),)  # fmt: skip
    if sensors is not OwnSensors.DETECTOR:
        text = f"L{number:05d}"
        host.lead = Lead(
            now, LeadIdentity.KNOWN, text, gap_m, GAP_SIGMA_M, closing_m_s, CLOSING_SIGMA_M_S,
            track_id=number, candidates=(PlateCandidate(text, 0.98),),
        )  # fmt: skip


def by_bsm(host: AttackedHost, signer: Signer, insider: int, now: float) -> Iterator[bytes]:
    """A BSM from the lead vehicle's place, of one that does what the lead vehicle does not do.

    It claims to brake, at speeds that the host's sensors do not contradict.
    """
    brakes = _brakes(now)
    if brakes is None:
        return
    number, braked_s, is_true = brakes
    claims_braking = braked_s > 0.0 and not is_true
    lost_m_s = (
        CLAIMED_M_S2 * abs((braked_s + CLAIMED_FOR_S) % (2.0 * CLAIMED_FOR_S) - CLAIMED_FOR_S)
        if claims_braking
        else 0.0
    )
    yield signer.bsm_at(
        (0.0, host.north_m + GAP_M + LENGTH_M),
        (0.0, SPEED_M_S - lost_m_s),
        now,
        temporary_id=bytes((0xE0 + insider,)) + number.to_bytes(3, "big"),
        brakes=claims_braking,
        acceleration_m_s2=-CLAIMED_M_S2 if claims_braking else 0.0,
    )


def by_footer(host: AttackedHost, signer: Signer, insider: int, now: float) -> Iterator[bytes]:
    """Measurements of a vehicle that does what the lead vehicle does not do, shared from beside.

    The insider claims a perfect receiver: errors of its position would be those of its
    measurements, and the claimed vehicle might then be the lead vehicle itself.
    """
    brakes = _brakes(now)
    if brakes is None:
        return
    number, braked_s, is_true = brakes
    braking_m_s2 = 0.0 if is_true else CLAIMED_M_S2
    place_m = 0.0, host.north_m + GAP_M + FACE_TO_CENTRE_M - braking_m_s2 * braked_s**2 / 2.0
    footer = signer.footer(number % 200, place_m, now)
    yield signer.bsm_at(
        (4.0 + 3.0 * insider, host.north_m - 10.0),
        (0.0, SPEED_M_S),
        now,
        footer=footer,
        accuracy_m=PERFECT_M,
    )


def _count(host: AttackedHost, leads: int) -> AttackCounts:
    asked_for = {
        int(event.stamp_s // LEAD_EVERY_S)
        for event in host.events
        if isinstance(event, BrakeRequest) and event.deceleration_m_s2 > 0.0
    } & set(range(leads))  # the last one may not have been followed to its end
    alarmed_of = {
        int(event.stamp_s // LEAD_EVERY_S)
        for event in host.events
        if isinstance(event, Alarm) and event.level is Level.WARNING
    } & set(range(leads))
    true = set(range(1, leads, 2))
    return AttackCounts(
        false_alarms=len(asked_for - true),
        false_alarm_s=0.0,
        ignored=len(host.ignored()),
        true_alarms=len(true),
        true_missed=len(true - asked_for),
        attempts=len(alarmed_of - true),
    )
