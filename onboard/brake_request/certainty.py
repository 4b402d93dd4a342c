"""How certain an alarm is: by its collision probability and the sources that it rests on."""

from onboard.brake_request.settings import BrakeRequestSettings
from onboard.observations import Lead
from onboard.risk.alarm import Assessment, Cause
from onboard.risk.alarm_table import row_of
from onboard.tracking.perceived_object import ObjectSource

_OWN_SENSORS = frozenset({Lead.kind, ObjectSource.SENSOR.value})
_RADIO = frozenset({
    "bsm", "warning", ObjectSource.BSM.value, ObjectSource.SHARED.value,
})  # fmt: skip


def certainty_of(cause: Cause, assessment: Assessment, settings: BrakeRequestSettings) -> float:
    """Return the probability from 0 to 1 that the assessed danger is real.

    Own sensors and radio are independent of each other; several radio sources are not, since one
    sender may be behind all of them.

    Args:
        cause: of the alarm.
        assessment: with the observations that it rests on.
        settings: certainty of the sources.
    """
    sources = {reason.what.rpartition(":")[2] for reason in assessment.reasons}
    wrong = 1.0
    if sources & _OWN_SENSORS:
        wrong *= 1.0 - settings.own_sensors_certainty
    if sources & _RADIO:
        wrong *= 1.0 - settings.radio_certainty
    return (1.0 - wrong) * (assessment.value if row_of(cause).is_probability else 1.0)
