"""What insiders cost: false alarms, and true ones that are missed, by attack and insiders.

An insider has one certificate, where nothing else is said, and sends ten messages a second.
Vehicles that truly cross come every `TRUE_EVERY_S`, each under a certificate of its own; the host's
detector sees them late, and nothing that the insiders claim. One case of each attack is run without
checks.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass

from pydantic import Field

from onboard.settings import Settings
from sim_rig.scenario.setting_types import Several
from sim_rig.studies.attacks.attacks import (
    BRAKE_CLAIMS,
    FORGERIES,
    IMPOSTURES,
    START_UTC_S,
    AttackKind,
    run_host,
)
from sim_rig.studies.attacks.brake_claims import run_brake_claims
from sim_rig.studies.attacks.certificate_flood import run_certificate_flood
from sim_rig.studies.attacks.group_attacks import run_group
from sim_rig.studies.attacks.impostures import run_imposture
from sim_rig.studies.campaigns.study import Axes, Case, Results, Study


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


@dataclass(frozen=True, slots=True, kw_only=True)
class AttackCase(Case):
    """One attack."""

    attack: AttackKind
    insiders_and_checks: tuple[int, bool]
    """Number of insiders, and whether the host checks claims."""
    run: int
    """Of the same attack, with other keys, draws and times."""


def axes(settings: AttacksSettings) -> Axes:
    """Every attack, by one insider without checks and by all numbers of insiders with them."""
    return {
        "attack": settings.attacks,
        "insiders_and_checks": [
            *([(1, False)] if settings.unchecked else []),
            *((insiders, True) for insiders in settings.insiders),
        ],
        "run": range(settings.runs),
    }


@dataclass(frozen=True, slots=True)
class AttackRow:
    """One attack."""

    attack: AttackKind
    insiders: int
    checked: bool
    seconds: float
    false_alarms: int
    false_alarm_s: float
    """For how long at least one false alarm was on."""
    ignored: int
    """Reports of signers that are ignored."""
    true_alarms: int
    """That are due."""
    true_missed: int
    least_notice_s: float | None
    """Time before the conflict at which a true vehicle was warned of, in the worst case."""
    honest_ignored: int
    """Signers that are no insiders', and are ignored."""
    answers_per_s: float
    """That insiders get."""
    identified_s: float | None
    """Until the last vehicle of a group knew the one ahead of it; `None` if one never did."""
    wrong_leads: int
    """Other vehicles that were taken for the one ahead."""
    attempts: int
    """Claims of a braking lead vehicle that alarmed the driver."""
    sent: int | None
    """Frames of the insiders."""
    received: int | None
    """Of those, with headers and a signature that the vehicle that refuses most accepts."""


@dataclass(frozen=True, slots=True)
class AttackLine:
    """One line of the table: all runs of an attack; of false alarms the worst run, else sums."""

    attack: str
    insiders: int
    checked: bool
    runs: int
    seconds: float
    false_alarms: int
    false_alarm_s: float
    ignored: int
    """Of the first run."""
    true_alarms: int
    true_missed: int
    least_notice_s: float | None
    honest_ignored: int
    answers_per_s: float
    identified_s: float | None
    wrong_leads: int
    attempts: int
    sent: int | None
    """Of the first run."""
    received: int | None


def run(settings: AttacksSettings, case: AttackCase) -> AttackRow:
    """Run one attack."""
    insiders, checked = case.insiders_and_checks
    seed, seconds = (settings.seed, case.number), settings.seconds
    if case.attack in FORGERIES:
        forgery = FORGERIES[case.attack]
        counts = run_group(forgery, seed, START_UTC_S, seconds, insiders, checks=checked)
    elif case.attack in IMPOSTURES:
        imposture = IMPOSTURES[case.attack]
        counts = run_imposture(imposture, seed, START_UTC_S, seconds, insiders, checks=checked)
    elif case.attack in BRAKE_CLAIMS:
        claimed = BRAKE_CLAIMS[case.attack]
        counts = run_brake_claims(claimed, seed, START_UTC_S, seconds, insiders, checks=checked)
    elif case.attack is AttackKind.CERTIFICATES:
        counts = run_certificate_flood(seed, START_UTC_S, seconds, insiders)
    else:
        counts = run_host(case.attack, seed, seconds, insiders, checks=checked)
    return AttackRow(case.attack, insiders, checked, seconds, **asdict(counts))


def table(settings: AttacksSettings, rows: Sequence[AttackRow]) -> list[AttackLine]:
    """A line for each attack, number of insiders, and with checks and without."""
    return [_merged(rows[at : at + settings.runs]) for at in range(0, len(rows), settings.runs)]


def _merged(runs: Sequence[AttackRow]) -> AttackLine:
    first = runs[0]
    return AttackLine(
        attack=first.attack.value,
        insiders=first.insiders,
        checked=first.checked,
        runs=len(runs),
        seconds=first.seconds,
        false_alarms=max(row.false_alarms for row in runs),
        false_alarm_s=max(row.false_alarm_s for row in runs),
        ignored=first.ignored,
        true_alarms=sum(row.true_alarms for row in runs),
        true_missed=sum(row.true_missed for row in runs),
        least_notice_s=min(
            (row.least_notice_s for row in runs if row.least_notice_s is not None), default=None
        ),
        honest_ignored=sum(row.honest_ignored for row in runs),
        answers_per_s=max(row.answers_per_s for row in runs),
        identified_s=_worst(row.identified_s for row in runs),
        wrong_leads=sum(row.wrong_leads for row in runs),
        attempts=sum(row.attempts for row in runs),
        sent=first.sent,
        received=first.received,
    )


def _worst(times_s: Iterable[float | None]) -> float | None:
    """Return the longest time; `None`, which is for ever, if one is."""
    known_s = [math.inf if each is None else each for each in times_s]
    return None if math.inf in known_s else max(known_s)


def summary(results: Results[AttacksSettings, AttackRow, AttackLine]) -> str:
    """The worst case of one insider, and the true alarms missed."""
    checked = [line for line in results.table if line.checked]
    worst = max((line.false_alarms / line.insiders for line in checked), default=0.0)
    missed = sum(line.true_missed for line in checked)
    true = sum(line.true_alarms for line in checked)
    return f"at most {worst:.1f} false alarms an insider; {missed} of {true} true alarms missed"


STUDY = Study(
    name="attacks",
    sentence="How many false alarms insiders cause, and how many true ones they prevent.",
    settings=AttacksSettings,
    axes=axes,
    case=AttackCase,
    run=run,
    row=AttackRow,
    table=table,
    line=AttackLine,
    summary=summary,
)
