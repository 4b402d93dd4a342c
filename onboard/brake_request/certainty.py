"""How certain a danger is: by who shows it, and by its collision probability.

Presence is not danger: a vehicle that own sensors measure may be said to brake by radio alone. So
what own sensors show is assessed without any message, and is one source; what messages tell is the
other, of one sender or of many, since one may be behind all of them. Both are independent.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from onboard.brake_request.settings import BrakeRequestSettings
from onboard.risk.alarm import AlarmKey, Assessment, Cause, Level
from onboard.risk.alarm_table import row_of
from onboard.tracking.perceived_object import ObjectSource

_RADIO = frozenset({
    "bsm", "warning", ObjectSource.BSM.value, ObjectSource.SHARED.value,
})  # fmt: skip


@dataclass(frozen=True, slots=True)
class Danger:
    """What one source shows of one alarm."""

    cause: Cause
    vehicle: str
    is_sensed: bool
    """Whether own sensors show it, without any message; they number vehicles for themselves."""
    assessment: Assessment
    certainty: float
    """Probability from 0 to 1 that it is real."""

    @property
    def key(self) -> tuple[Cause, str, bool]:
        """Distinguishes it from the others."""
        return self.cause, self.vehicle, self.is_sensed


def dangers(
    alarms: Mapping[AlarmKey, Assessment],
    sensed: Mapping[AlarmKey, Assessment],
    settings: BrakeRequestSettings,
) -> Iterator[Danger]:
    """Yield what own sensors show, and what messages tell, each with its certainty.

    Args:
        alarms: assessments behind the alarms, by all that is known.
        sensed: assessments of what own sensors alone measure.
        settings: certainty of the sources.
    """
    reported = {key: each for key, each in alarms.items() if _is_reported(each)}
    warned = {cause for (cause, _), each in reported.items() if each.level is Level.WARNING}
    for is_sensed, assessments in ((True, sensed), (False, reported)):
        for (cause, vehicle), assessment in assessments.items():
            row = row_of(cause)
            wrong = 1.0 - (
                settings.own_sensors_certainty if is_sensed else settings.radio_certainty
            )
            if is_sensed and cause in warned and not row.of_each_vehicle:
                wrong *= 1.0 - settings.radio_certainty
            certainty = (1.0 - wrong) * (assessment.value if row.is_probability else 1.0)
            yield Danger(cause, vehicle, is_sensed, assessment, certainty)


def _is_reported(assessment: Assessment) -> bool:
    """Whether messages are among what it rests on."""
    return any(each.what.rpartition(":")[2] in _RADIO for each in assessment.reasons)
