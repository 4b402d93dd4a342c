"""What the signals of a crossing show: a fixed cycle."""

from dataclasses import dataclass

from onboard.messages.spat import MovementPhaseState
from sim_rig.scenario.signal_settings import SignalSettings


@dataclass(frozen=True, slots=True)
class Shown:
    """What one signal shows."""

    state: MovementPhaseState
    left_s: float
    """Time until it shows something else."""


def shown(settings: SignalSettings, at_s: float) -> list[Shown]:
    """Return what the signals show, in the order of the approaches.

    Args:
        settings: the controller's.
        at_s: time since the start of the scenario.
    """
    in_cycle_s = at_s % settings.cycle_s
    return [
        _shown(approach.green_s, settings.yellow_s, settings.cycle_s, in_cycle_s)
        for approach in settings.approaches.values()
    ]


def _shown(
    green_s: tuple[float, float], yellow_s: float, cycle_s: float, in_cycle_s: float
) -> Shown:
    begins_s, ends_s = green_s
    if begins_s <= in_cycle_s < ends_s:
        return Shown(MovementPhaseState.PROTECTED_MOVEMENT_ALLOWED, ends_s - in_cycle_s)
    if ends_s <= in_cycle_s < ends_s + yellow_s:
        return Shown(MovementPhaseState.PROTECTED_CLEARANCE, ends_s + yellow_s - in_cycle_s)
    return Shown(MovementPhaseState.STOP_AND_REMAIN, (begins_s - in_cycle_s) % cycle_s)
