"""Faults of one car's clock, processor, power and GNSS reception."""

from dataclasses import replace
from itertools import chain

from sim_rig.roads.road import CarState
from sim_rig.scenario.faults import GnssJump, PowerCut, SlowCpu, WrongClock
from sim_rig.scenario.schema import Scenario


class VehicleFaults:
    """Those of `car`; times are s since the start of the scenario."""

    def __init__(self, scenario: Scenario, car: str) -> None:
        self._scenario = scenario
        self._car = car
        own = [fault for fault in scenario.faults if fault.car == car]
        self._clocks = [fault for fault in own if isinstance(fault, WrongClock)]
        self._loads = [fault for fault in own if isinstance(fault, SlowCpu)]
        self._power_cuts = [fault for fault in own if isinstance(fault, PowerCut)]
        self._jumps = [fault for fault in own if isinstance(fault, GnssJump)]

    @property
    def has_wrong_clock(self) -> bool:
        """Whether the car's UTC is ever wrong."""
        return bool(self._clocks)

    def clock_error_s(self, at_s: float) -> float:
        """Error of the car's UTC at `at_s`, s; positive when it is ahead."""
        return sum(fault.error_s(at_s) for fault in self._clocks if fault.holds(self._car, at_s))

    def wakes_at(self, at_s: float) -> float:
        """Next time at which the car's daemon runs: `at_s` or later."""
        for cut in self._power_cuts:
            if cut.holds(self._car, at_s):
                at_s = cut.until_s
        loads = (fault for fault in self._loads if fault.holds(self._car, at_s))
        return max(chain((at_s,), (fault.wakes_at_s(at_s) for fault in loads)))

    def is_off(self, at_s: float) -> bool:
        """Whether the car's computer has no power."""
        return any(cut.holds(self._car, at_s) for cut in self._power_cuts)

    def on_since(self, at_s: float) -> float:
        """When the car's computer was started last, by `at_s`."""
        return max((cut.until_s for cut in self._power_cuts if cut.until_s <= at_s), default=0.0)

    def received(self, state: CarState, at_s: float) -> CarState | None:
        """Position as the faulty receiver measures it; `None` without reception."""
        if self._scenario.has_fault("gnss_silent", self._car, at_s):
            return None
        for fault in self._jumps:
            if fault.holds(self._car, at_s):
                x_m, y_m = state.x_m + fault.east_m, state.y_m + fault.north_m
                state = replace(state, x_m=x_m, y_m=y_m)
        return state
