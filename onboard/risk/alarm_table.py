"""The table of all alarms: a row says which application raises it, and how it is shown and used.

A new alarm is a file with its application and a row here. Traces, driver's page, metrics, requests
to brake, credibility of senders and expectations of scenarios read the row.
"""

from dataclasses import dataclass
from enum import StrEnum

from onboard.risk.alarm import Cause, Level
from onboard.risk.application import Application
from onboard.risk.braking_ahead import BrakingAhead
from onboard.risk.bsw import BlindSpotWarning
from onboard.risk.eebl import EmergencyElectronicBrakeLights
from onboard.risk.fcw import ForwardCollisionWarning
from onboard.risk.ima import IntersectionMovementAssist, LeftTurnAssist
from onboard.risk.lcca_warning import LccaWarning
from onboard.risk.lcw import LaneChangeWarning
from onboard.risk.raised_alarms import OneAlarm, VehicleAlarms


class Headline(StrEnum):
    """What the driver is asked to do; the page has the words, in the driver's language."""

    BRAKE = "brake"
    STOP = "stop"
    KEEP_DISTANCE = "keep_distance"
    WATCH_OUT = "watch_out"
    STAY_IN_LANE = "stay_in_lane"


class Sign(StrEnum):
    """Pictures on the page."""

    BRAKE = "brake"
    GAP = "gap"
    LEFT = "left"
    RIGHT = "right"


class Measure(StrEnum):
    """What an alarm's value is."""

    DECELERATION = "deceleration"
    """Braking that the danger asks for, in m/s^2."""
    PROBABILITY = "probability"
    """That it becomes a collision, from 0 to 1."""


class Credit(StrEnum):
    """What alarms that rest on claims are charged to."""

    SHARED = "shared"
    """All signers share it: many of one vehicle raise hardly more false alarms than one."""
    OWN = "own"
    """Each signer has its own: honest traffic raises some that nothing confirms."""
    UNCONFIRMED = "unconfirmed"
    """The same where nothing confirms any, true or not."""


@dataclass(frozen=True, slots=True)
class AlarmRow:
    """One kind of alarm."""

    application: type[Application]
    """Assesses it; a vehicle has one of each."""
    sentence: str
    """What the driver reads and hears, in English."""
    warning: Headline
    """At warning level."""
    caution: Headline = Headline.WATCH_OUT
    sign: Sign = Sign.BRAKE
    from_the_side: tuple[str, str] | None = None
    """Sentences instead, with their signs, where the vehicle is to the left and to the right."""
    measure: Measure = Measure.DECELERATION
    of_each_vehicle: bool = False
    """Whether each vehicle has an alarm of its own; else there is one at a time."""
    slows_traffic: bool = False
    """Whether a true one slows the traffic ahead of the host vehicle down, which confirms it."""
    may_brake: bool = True
    """Whether it may request braking."""
    credit: Credit = Credit.SHARED
    """What an alarm that rests on claims is charged to."""
    has_known_end: bool = False
    """Whether somebody says when the danger is over; else old observations are none."""

    @property
    def cause(self) -> Cause:
        """Of its alarms."""
        return self.application.cause

    @property
    def is_probability(self) -> bool:
        """Whether its value is one."""
        return self.measure is Measure.PROBABILITY

    def headline(self, level: Level) -> Headline:
        """Return what the driver is asked to do."""
        return self.warning if level is Level.WARNING else self.caution

    def alarms(self) -> OneAlarm | VehicleAlarms:
        """Return what raises its alarms, without one yet."""
        return VehicleAlarms(self.cause) if self.of_each_vehicle else OneAlarm(self.cause)


ALARMS: tuple[AlarmRow, ...] = (
    AlarmRow(
        LccaWarning,
        "The car ahead brakes hard",
        Headline.BRAKE,
        slows_traffic=True,
        has_known_end=True,
    ),
    AlarmRow(
        ForwardCollisionWarning,
        "You are closing in on the car ahead",
        Headline.BRAKE,
        caution=Headline.KEEP_DISTANCE,
        sign=Sign.GAP,
        slows_traffic=True,
    ),
    AlarmRow(
        EmergencyElectronicBrakeLights,
        "A car ahead brakes hard",
        Headline.BRAKE,
        slows_traffic=True,
    ),
    AlarmRow(
        BrakingAhead,
        "Hard braking farther ahead",
        Headline.BRAKE,
        slows_traffic=True,
        may_brake=False,
        credit=Credit.OWN,
    ),
    AlarmRow(
        IntersectionMovementAssist,
        "Car crossing",
        Headline.STOP,
        from_the_side=("Car from the left", "Car from the right"),
        measure=Measure.PROBABILITY,
        of_each_vehicle=True,
    ),
    AlarmRow(
        LeftTurnAssist,
        "Oncoming car: do not turn",
        Headline.STOP,
        measure=Measure.PROBABILITY,
        of_each_vehicle=True,
    ),
    AlarmRow(
        BlindSpotWarning,
        "Car in the blind spot",
        Headline.STAY_IN_LANE,
        from_the_side=("Car in the left blind spot", "Car in the right blind spot"),
        measure=Measure.PROBABILITY,
        of_each_vehicle=True,
        may_brake=False,
        credit=Credit.UNCONFIRMED,
    ),
    AlarmRow(
        LaneChangeWarning,
        "Car coming up from behind",
        Headline.STAY_IN_LANE,
        from_the_side=("Car coming up on the left", "Car coming up on the right"),
        measure=Measure.PROBABILITY,
        of_each_vehicle=True,
        may_brake=False,
        credit=Credit.UNCONFIRMED,
    ),
)
"""In the order in which they are assessed."""


def row_of(cause: Cause) -> AlarmRow:
    """Return the row of a cause.

    Raises:
        KeyError: the table has none.
    """
    for row in ALARMS:
        if row.cause == cause:
            return row
    raise KeyError(cause)


def known_cause(name: str) -> Cause:
    """Return the cause of this name.

    Raises:
        ValueError: the table has none; says which there are.
    """
    names = [row.cause for row in ALARMS]
    if name not in names:
        raise ValueError(f"must be one of {', '.join(names)}")
    return Cause(name)
