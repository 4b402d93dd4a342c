"""An alarm goes up when a level is confirmed, and down when it has been lower for a while."""

import pytest

from onboard.risk.alarm import NOTHING, AlarmReason, Assessment, Hysteresis, Level
from onboard.risk.confirmation import Confirmation
from onboard.risk.fcw import FCW
from onboard.risk.ima import IMA

REASON = (AlarmReason("lead", "known", 0.05),)
CAUTION = Assessment(Level.CAUTION, 3.7, REASON)
WARNING = Assessment(Level.WARNING, 5.5, REASON)


def levels(seen: list[tuple[float, Assessment]]) -> list[tuple[float, str]]:
    alarm = Hysteresis(FCW, release_s=1.0)
    raised = [(now, alarm.receive_assessment(each, now)) for now, each in seen]
    return [(now, each.level.value) for now, each in raised if each is not None]


@pytest.mark.parametrize(
    ("before", "seen", "after"),
    [
        (NOTHING, NOTHING, []),
        (NOTHING, CAUTION, [(1.0, "caution")]),
        (NOTHING, WARNING, [(1.0, "warning")]),
        (CAUTION, NOTHING, [(0.0, "caution"), (2.0, "none")]),
        (CAUTION, CAUTION, [(0.0, "caution")]),
        (CAUTION, WARNING, [(0.0, "caution"), (1.0, "warning")]),
        (WARNING, NOTHING, [(0.0, "warning"), (2.0, "none")]),
        (WARNING, CAUTION, [(0.0, "warning"), (2.0, "caution")]),
        (WARNING, WARNING, [(0.0, "warning")]),
    ],
)
def test_every_level_seen_at_every_level(
    before: Assessment, seen: Assessment, after: list[tuple[float, str]]
) -> None:
    assert levels([(0.0, before), (0.9, before), (1.0, seen), (1.5, seen), (2.0, seen)]) == after


def test_flapping_between_two_levels_is_one_alarm() -> None:
    flapping = [(k * 0.3, WARNING if k % 2 else CAUTION) for k in range(20)]

    assert levels(flapping) == [(0.0, "caution"), (0.3, "warning")]


@pytest.mark.parametrize(
    ("seen", "confirmed"),
    [
        ([(0.0, Level.WARNING), (0.1, Level.NONE), (0.2, Level.WARNING)], Level.NONE),
        ([(0.0, Level.CAUTION), (0.1, Level.WARNING), (0.2, Level.WARNING)], Level.CAUTION),
        ([(0.0, Level.WARNING), (0.2, Level.WARNING)], Level.WARNING),
        ([(0.0, Level.WARNING), (0.0, Level.WARNING)], Level.NONE),
    ],
    ids=["interrupted", "rising", "lasting", "one measurement"],
)
def test_a_level_is_confirmed_by_measurements_over_a_while(
    seen: list[tuple[float, Level]], confirmed: Level
) -> None:
    vehicle = Confirmation(confirm_s=0.15)

    assert [vehicle.receive_level(level, stamp_s) for stamp_s, level in seen][-1] is confirmed


def test_an_alarm_names_what_raised_it_and_its_end_names_nothing() -> None:
    alarm = Hysteresis(IMA, 1.0)

    raised, ended = alarm.receive_assessment(WARNING, 0.0), alarm.receive_assessment(NOTHING, 1.0)

    assert raised is not None
    assert (raised.cause, raised.value, raised.reasons) == (IMA, 5.5, REASON)
    assert ended is not None
    assert (ended.level, ended.reasons) == (Level.NONE, ())
