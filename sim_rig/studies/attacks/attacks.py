"""What insiders cost: false alarms, and true ones that are missed, by attack and insiders.

An insider has one certificate and sends ten messages a second. Vehicles that truly cross come every
`TRUE_EVERY_S`, each under a certificate of its own. Nothing that is claimed is seen by the host's
own sensors, which is the best case for the insiders. One case of each attack is run without checks.
"""

from collections.abc import Iterator, Sequence
from enum import StrEnum
from functools import partial
from pathlib import Path

import numpy as np
from pydantic import Field

from onboard.risk.alarm import Alarm, Level
from onboard.security.p256 import key_from
from onboard.settings import Settings
from onboard.tools.test_ca.authority import make_trial
from onboard.wave_udp import psid
from sim_rig.scenario.setting_types import Several
from sim_rig.studies.attacks.attack_world import SPEED_M_S, AttackedHost, Place, Signer, claimed_id
from sim_rig.studies.attacks.group_attacks import (
    group_brakings,
    group_ends,
    group_levels,
    group_updates,
    run_group,
)
from sim_rig.studies.campaigns.campaign import Row, Workers, run_campaign
from sim_rig.studies.campaigns.results import write_results

START_UTC_S = 1_790_000_000.0
PASS_S = 6.0
"""Time in which an invented vehicle comes to the place where it would hit the host."""
TRUE_EVERY_S = 20.0
"""Between true vehicles."""
COLUMNS = (
    "attack", "insiders", "checked", "runs", "seconds", "false_alarms", "false_alarm_s", "ignored",
    "true_alarms", "true_missed",
)  # fmt: skip


class AttackKind(StrEnum):
    """What an insider claims."""

    BSM = "crossing vehicle, by BSM"
    FOOTER = "crossing vehicle, by footer"
    ETERNAL = "vehicle on collision course for ever"
    FLICKERING = "vehicle in and out of the way"
    FOUR = "four crossing vehicles at once"
    BRAKING = "vehicle ahead that brakes hard"
    SAME_ID = "IDs of true vehicles"
    GROUP_UPDATES = "group updates under the leader's next numbers"
    GROUP_ENDS = "ends of the leader's brakings"
    GROUP_EARLY = "brakings of the leader before it brakes"
    GROUP_BRAKINGS = "brakings of invented vehicles in the group"


class AttacksSettings(Settings):
    """One campaign; a run is one attack by some insiders."""

    seed: int = Field(1, ge=0)
    """Of all draws, together with the number of the run."""
    attacks: Several[AttackKind] = tuple(AttackKind)
    """What the insiders claim."""
    insiders: Several[int] = (1, 2, 3, 4, 5)
    """Numbers of insiders."""
    seconds: float = Field(60.0, ge=30.0, le=7200.0)
    """Duration of a run."""
    runs: int = Field(1, ge=1)
    """Of each case, with other keys, draws and times."""
    unchecked: bool = True
    """Whether each attack is run without checks, too."""


Case = tuple[AttackKind, int, bool]
"""AttackKind, insiders, and whether the host checks claims."""


def cases(settings: AttacksSettings) -> list[Case]:
    """Return the case of each run."""
    return [
        (attack, insiders, checked)
        for attack in settings.attacks
        for insiders, checked in [
            *([(1, False)] if settings.unchecked else []),
            *((each, True) for each in settings.insiders),
        ]
    ]


def run(out_dir: Path, settings: AttacksSettings | None, workers: Workers) -> str:
    """Run all cases and write their table.

    Args:
        out_dir: folder of table, settings and runs.
        settings: of the campaign; the default ones if None.
        workers: processes or cluster.

    Returns:
        The worst case of one insider, and the true alarms missed, as a sentence.
    """
    chosen = settings or AttacksSettings()
    numbers = range(len(cases(chosen)) * chosen.runs)
    rows = run_campaign(run_one, chosen, numbers, out_dir / "runs", workers)
    table = [_merged(rows[at : at + chosen.runs]) for at in numbers[:: chosen.runs]]
    write_results(out_dir, COLUMNS, [[row[name] for name in COLUMNS] for row in table], chosen)
    checked = [row for row in table if row["checked"]]
    worst = max((row["false_alarms"] / row["insiders"] for row in checked), default=0.0)
    missed, true = (sum(row[name] for row in checked) for name in ("true_missed", "true_alarms"))
    return f"at most {worst:.1f} false alarms an insider; {missed} of {true} true alarms missed"


def run_one(settings: AttacksSettings, number: int) -> Row:
    """Run one case."""
    attack, insiders, checked = cases(settings)[number // settings.runs]
    seed, seconds = (settings.seed, number), settings.seconds
    if attack in FORGERIES:
        forgery = FORGERIES[attack]
        found = run_group(forgery, seed, START_UTC_S, seconds, insiders, checks=checked)
    else:
        found = _run_host(attack, seed, seconds, insiders, checks=checked)
    case = {"attack": attack.value, "insiders": insiders, "checked": checked, "seconds": seconds}
    return case | found


def _merged(runs: Sequence[Row]) -> Row:
    """Return the runs of one case as one row: of false alarms the worst run, else the sum."""
    worst = {name: max(row[name] for row in runs) for name in ("false_alarms", "false_alarm_s")}
    sums = {name: sum(row[name] for row in runs) for name in ("true_alarms", "true_missed")}
    return runs[0] | worst | sums | {"runs": len(runs)}


def _run_host(
    attack: AttackKind, seed: tuple[int, ...], seconds: float, insiders: int, *, checks: bool
) -> Row:
    encounters = int(seconds // TRUE_EVERY_S)
    names = [f"insider{n}" for n in range(insiders)] + [f"true{n}" for n in range(encounters)]
    new_key = key_from(np.random.default_rng(seed))
    trial = make_trial(["host", *names], {psid.BSM}, START_UTC_S, new_key, pseudonyms=1)
    host = AttackedHost(trial["host"], START_UTC_S, checks=checks)
    signers = [Signer(trial[name], START_UTC_S, name[-4:].encode()) for name in names[:insiders]]
    true = [
        Signer(trial[name], START_UTC_S, _true_id(n)) for n, name in enumerate(names[insiders:])
    ]
    senders = [partial(CLAIMS[attack], host, each, n) for n, each in enumerate(signers)]
    host.drive(seconds, *senders, partial(_true_vehicles, host, true))
    true_ids = {each.temporary_id.hex() for each in true}
    warned = {
        claimed_id(event)
        for event in host.events
        if isinstance(event, Alarm) and event.level is Level.WARNING
    }
    return {
        "false_alarms": sum(claimed_id(alarm) not in true_ids for alarm in host.raised()),
        "false_alarm_s": round(host.alarmed_s(true_ids), 1),
        "ignored": len(host.ignored()),
        "true_alarms": encounters,
        "true_missed": len(true_ids - warned),
    }


def _true_vehicles(host: AttackedHost, true: list[Signer], now: float) -> Iterator[bytes]:
    """Vehicles from the left, each in the last `PASS_S` of its period."""
    number, into_s = divmod(now, TRUE_EVERY_S)
    left_s = TRUE_EVERY_S - into_s
    if left_s <= PASS_S and number < len(true):
        ahead_m = SPEED_M_S * left_s
        yield true[int(number)].bsm_at((-ahead_m, host.north_m + ahead_m), (SPEED_M_S, 0.0), now)


def _crossing(host: AttackedHost, insider: int, now: float) -> tuple[int, Place]:
    """Return number and place of a vehicle from the right that would hit the host."""
    passes, into_s = divmod(now + 1.1 * insider, PASS_S)
    ahead_m = SPEED_M_S * (PASS_S - into_s)
    return int(passes), (ahead_m, host.north_m + ahead_m)


def _true_id(number: int) -> bytes:
    return b"T" + number.to_bytes(3)


def _id(insider: int, number: int) -> bytes:
    return bytes((0xE0 + insider,)) + number.to_bytes(3, "big")


def _beside(host: AttackedHost, signer: Signer, footer: bytes, now: float) -> bytes:
    """The insider's own BSM, from a place where it is in nobody's way."""
    place_m = 40.0, host.north_m - 60.0
    return signer.bsm_at(place_m, (0.0, SPEED_M_S), now, footer=footer)


def crossing_bsm(host: AttackedHost, signer: Signer, insider: int, now: float) -> Iterator[bytes]:
    """Send the BSMs of one invented vehicle after the other."""
    number, place_m = _crossing(host, insider, now)
    yield signer.bsm_at(place_m, (-SPEED_M_S, 0.0), now, temporary_id=_id(insider, number))


def crossing_footer(
    host: AttackedHost, signer: Signer, insider: int, now: float
) -> Iterator[bytes]:
    """Report one invented vehicle after the other."""
    number, place_m = _crossing(host, insider, now)
    yield _beside(host, signer, signer.footer(number % 200, place_m, now), now)


def eternal(host: AttackedHost, signer: Signer, insider: int, now: float) -> Iterator[bytes]:
    """Always on collision course, and always two seconds away."""
    ahead_m = 2.0 * SPEED_M_S + 3.0 * insider
    yield signer.bsm_at((ahead_m, host.north_m + ahead_m), (-SPEED_M_S, 0.0), now)


def flickering(host: AttackedHost, signer: Signer, insider: int, now: float) -> Iterator[bytes]:
    """In the way, and two seconds later out of it, each time under another ID."""
    phase, into_s = divmod(now + insider, 4.0)
    aside_m = 0.0 if into_s < 2.0 else 40.0
    number = 2 * int(phase) + (into_s >= 2.0)
    place_m = (2.0 * SPEED_M_S + aside_m, host.north_m + 2.0 * SPEED_M_S)
    yield signer.bsm_at(place_m, (-SPEED_M_S, 0.0), now, temporary_id=_id(insider, number))


def four_at_once(host: AttackedHost, signer: Signer, insider: int, now: float) -> Iterator[bytes]:
    """Four invented vehicles side by side."""
    number, (east_m, north_m) = _crossing(host, insider, now)
    for lane in range(4):
        name = _id(insider, 4 * number + lane)
        place_m = (east_m + 0.2 * lane, north_m)
        yield signer.bsm_at(place_m, (-SPEED_M_S, 0.0), now, temporary_id=name)


def braking_ahead(host: AttackedHost, signer: Signer, insider: int, now: float) -> Iterator[bytes]:
    """One vehicle after the other, 30 m ahead, brakes at 6 m/s^2, as its speeds and places show."""
    number, into_s = divmod(now + 1.1 * insider, PASS_S)
    brakes_s = max(into_s - PASS_S / 2.0, 0.0)
    place_m = (0.0, host.north_m + 30.0 - 3.0 * brakes_s**2)
    velocity_m_s = (0.0, max(SPEED_M_S - 6.0 * brakes_s, 0.0))
    name = _id(insider, int(number))
    yield signer.bsm_at(place_m, velocity_m_s, now, temporary_id=name, brakes=brakes_s > 0.0)


def same_id(host: AttackedHost, signer: Signer, insider: int, now: float) -> Iterator[bytes]:
    """A vehicle that stands aside, under the ID of the next true one, before that is heard."""
    number = insider + int(now // TRUE_EVERY_S)
    place_m = 40.0, host.north_m + 40.0 + 3.0 * insider
    yield signer.bsm_at(place_m, (0.0, 0.0), now, temporary_id=_true_id(number))


CLAIMS = {
    AttackKind.BSM: crossing_bsm,
    AttackKind.FOOTER: crossing_footer,
    AttackKind.ETERNAL: eternal,
    AttackKind.FLICKERING: flickering,
    AttackKind.FOUR: four_at_once,
    AttackKind.BRAKING: braking_ahead,
    AttackKind.SAME_ID: same_id,
}
"""The messages of each attack: of a host, a signer, the insider's number, and the time."""
FORGERIES = {
    AttackKind.GROUP_UPDATES: group_updates,
    AttackKind.GROUP_ENDS: group_ends,
    AttackKind.GROUP_EARLY: group_levels,
    AttackKind.GROUP_BRAKINGS: group_brakings,
}
"""What is forged in a warning group."""
