"""How late the daemons of a live run were, whose computer has the rig and other work to do."""

from bisect import bisect_right
from collections.abc import Collection, Iterator

from onboard.vehicle.surroundings import ASSESSMENT_INTERVAL_S
from sim_rig.run_log.lateness import LatenessLine, lateness_line
from sim_rig.run_log.run_log import RunLog

STEP_LIMIT_S = ASSESSMENT_INTERVAL_S
"""A step that is later than the interval between two assessments has kept the next one from being
made in time."""
LATE_PICTURES = 2.0
"""A camera's process takes the newest picture only. So one that is ready later than this many
intervals of the camera has kept another one from being looked at."""


def daemon_lateness(
    log: RunLog, daemons: Collection[str], picture_interval_s: float
) -> Iterator[LatenessLine]:
    """Yield a line for the steps and one for the pictures of all daemons, if there were any.

    A step is late by the time from the answer of the ECU to its speed in the trace, a picture by
    the time from its arrival to the lead that was seen in it.

    Args:
        log: the run log.
        daemons: the cars that are processes of the rig's computer, and have all of its time.
        picture_interval_s: between two pictures of a camera.
    """
    steps_s = [late_s for car in daemons for late_s in _steps_late_s(log, car)]
    pictures_s = [
        lead["traced_s"] - lead["stamp_s"]
        for car in daemons
        for lead in log.of(car, "lead", from_s=0.0)
    ]
    if steps_s:
        yield lateness_line("step", steps_s, STEP_LIMIT_S)
    if pictures_s:
        yield lateness_line("seen picture", pictures_s, LATE_PICTURES * picture_interval_s)


def _steps_late_s(log: RunLog, car: str) -> Iterator[float]:
    """Yield the time from each answer of the ECU of `car` to the record of its speed."""
    answers_s = [
        answer["stamp_s"]
        for answer in log.rig
        if answer["kind"] == "ecu_answer" and answer["car"] == car
    ]
    for speed in log.of(car, "speed", from_s=0.0):
        answer = bisect_right(answers_s, speed["stamp_s"]) - 1
        if answer >= 0:
            yield speed["traced_s"] - answers_s[answer]
