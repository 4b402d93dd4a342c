"""What is counted in one attack."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class AttackCounts:
    """What is counted in one attack."""

    false_alarms: int
    false_alarm_s: float
    """For how long at least one was on."""
    ignored: int
    """Reports of signers that are ignored."""
    true_alarms: int
    """That are due."""
    true_missed: int
    least_notice_s: float | None = None
    """Time before the conflict at which a true vehicle was warned of, in the worst case."""
    honest_ignored: int = 0
    """Signers that are no insiders', and are ignored."""
    answers_per_s: float = 0.0
    """That insiders get."""
    identified_s: float | None = None
    """Until the last follower knew the vehicle ahead of it; `None` if one never did."""
    wrong_leads: int = 0
    """Other vehicles that were taken for the one ahead."""
    attempts: int = 0
    """Claims of a braking lead vehicle that alarmed the driver."""
    sent: int | None = None
    """Frames of the insiders."""
    received: int | None = None
    """Of those, with headers and a signature that the vehicle that refuses most accepts."""
