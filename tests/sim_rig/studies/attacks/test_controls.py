"""Attacks that the study finds harmless harm without the rule that stops them.

Those that are not here harm without checks in the study itself, or several rules stop them: ends,
updates and brakings that are passed on again. Joins, leaves, replies and statements in the own name
are the kinds of messages that nothing else forges.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest

from onboard.brake_request.brake_requester import BrakeRequester
from onboard.lcca import identity_posterior
from onboard.lcca.adjacent_ids import AdjacentIds
from onboard.lcca.asking import AnswerLimit
from onboard.misbehaviour.misbehaviour_detection import MisbehaviourDetector
from onboard.vehicle import lcca_application
from onboard.vehicle.lcca_link import LccaLink, RefusalError
from sim_rig.studies.attacks.attacks import AttackKind
from sim_rig.studies.attacks.attacks_study import STUDY, AttackRow, AttacksSettings

pytestmark = pytest.mark.long


@dataclass(frozen=True)
class Control:
    """One rule that an attack is stopped by."""

    attack: AttackKind
    take_away: Callable[[pytest.MonkeyPatch], None]
    harms: Callable[[AttackRow], bool]
    seconds: float = 55.0


def believe_next_leader(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(AdjacentIds, "receive_next_leader", AdjacentIds.receive_next)


def believe_copies(patch: pytest.MonkeyPatch) -> None:
    """Take a copy for what its braking vehicle has stated."""
    received = LccaLink.receive_pdu

    def receive_pdu(link: LccaLink, pdu: Any, opened: Any, place: Any, now: float) -> Any:
        try:
            return received(link, pdu, opened, place, now)
        except RefusalError:
            return pdu.message, None

    patch.setattr(LccaLink, "receive_pdu", receive_pdu)
    patch.setattr(lcca_application.LccaApplication, "_refuses", lambda *_: False)


def answer_all(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(AnswerLimit, "take", lambda *_: True)


def believe_motion(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(identity_posterior, "LOST", 1.0)
    patch.setattr(identity_posterior, "IMITATION", 1e-9)


def one_vehicle_an_id(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(MisbehaviourDetector, "remote_id", lambda _self, _sender, id_: id_)


def brake_for_claims(patch: pytest.MonkeyPatch) -> None:
    assess = BrakeRequester.assess

    def assess_all(requester: BrakeRequester, alarms: Any, sensed: Any, now: float) -> None:
        assess(requester, alarms, {**sensed, **alarms}, now)

    patch.setattr(BrakeRequester, "assess", assess_all)


CONTROLS = [
    Control(AttackKind.NEXT_LEADER, believe_next_leader, lambda c: c.true_missed > 0),
    Control(AttackKind.GROUP_EARLY, believe_copies, lambda c: c.false_alarms > 0),
    Control(AttackKind.ORACLE, answer_all, lambda c: c.answers_per_s > 20.0),
    Control(AttackKind.MIMICRY_BADLY_READ, believe_motion, lambda c: c.identified_s != 0.4),
    Control(AttackKind.SILENT_MIMICRY, believe_motion, lambda c: c.identified_s != 0.2),
    Control(AttackKind.SAME_ID, one_vehicle_an_id, lambda c: c.true_missed > 0, 40.0),
    Control(AttackKind.BRAKE_BOTH, brake_for_claims, lambda c: c.false_alarms > 0, 30.0),
    Control(AttackKind.BRAKE_DETECTOR, brake_for_claims, lambda c: c.false_alarms > 0, 30.0),
    Control(AttackKind.BRAKE_CAMERA, brake_for_claims, lambda c: c.false_alarms > 0, 30.0),
    Control(AttackKind.BRAKE_FOOTER, brake_for_claims, lambda c: c.false_alarms > 0, 30.0),
]


@pytest.mark.parametrize("control", CONTROLS, ids=lambda each: each.attack.name)
def test_without_the_rule_that_stops_it_an_attack_harms(
    control: Control, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = AttacksSettings(
        attacks=(control.attack,), insiders=(1,), seconds=control.seconds, unchecked=False
    )
    assert not control.harms(STUDY.one(settings, 0))

    control.take_away(monkeypatch)

    assert control.harms(STUDY.one(settings, 0))
