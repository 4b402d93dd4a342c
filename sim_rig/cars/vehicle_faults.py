"""The faults of one car that are not in a wire: its clock, its processor, its sky."""

from dataclasses import replace
from itertools import chain

from sim_rig.roads.road import CarState
from sim_rig.scenario.faults import GnssJump, SlowCpu, WrongClock
from sim_rig.scenario.schema import Scenario


class VehicleFaults:
    """What a scenario orders for `car`, by the scenario's time."""

    def __init__(self, scenario: Scenario, car: str) -> None:
        self._scenario = scenario
        self._car = car
        own = [fault for fault in scenario.faults if fault.car == car]
        self._clocks = [fault for fault in own if isinstance(fault, WrongClock)]
        self._loads = [fault for fault in own if isinstance(fault, SlowCpu)]
        self._jumps = [fault for fault in own if isinstance(fault, GnssJump)]

    @property
    def has_wrong_clock(self) -> bool:
        """Whether the car's UTC is ever wrong."""
        return bool(self._clocks)

    def clock_error_s(self, at_s: float) -> float:
        """How far the box's UTC is ahead of the true one."""
        return sum(fault.error_s(at_s) for fault in self._clocks if fault.holds(self._car, at_s))

    def wakes_at(self, at_s: float) -> float:
        """When the car next has the processor, `at_s` or later."""
        loads = (fault for fault in self._loads if fault.holds(self._car, at_s))
        return max(chain((at_s,), (fault.wakes_at_s(at_s) for fault in loads)))

    def received(self, state: CarState, at_s: float) -> CarState | None:
        """Where the receiver thinks that the car is; `None`: nowhere."""
        if self._scenario.has_fault("gnss_silent", self._car, at_s):
            return None
        for fault in self._jumps:
            if fault.holds(self._car, at_s):
                x_m, y_m = state.x_m + fault.east_m, state.y_m + fault.north_m
                state = replace(state, x_m=x_m, y_m=y_m)
        return state
