"""Cautions in a study's platoon: whom its drivers' alarm of hard braking ahead takes for ahead.

For a minute before the braking the first car changes its speed as on a dense road, and each other
one keeps its headway, swaying a little. These speeds matter to the alarm only. Nobody's braking
changes them, though what a row does about it would be evidence, too.
"""

from collections.abc import Collection, Iterable, Iterator
from typing import Literal

import numpy as np

from sim_rig.cars.gauss_markov import wandered
from sim_rig.roads.cars import Array
from sim_rig.scenario.setting_types import NotNegative
from sim_rig.studies.lcca.caution_host import CautionHost, Receivers, State, shown
from sim_rig.studies.lcca.dense_road import WAVES
from sim_rig.studies.lcca.sparse_road import SWAY_M_S2, SWAY_S

Cautions = Literal["off", "motion", "known"] | NotNegative
"""How cars know that a braking car is ahead: not at all; by its motion; always, which no car can;
or also by receivers with this sigma in m of the errors that two cars do not share."""
HISTORY_S, STEP_S, SAMPLE_STEPS = 60.0, 0.1, 5


class PlatoonCautions:
    """The alarms of all cars with a radio."""

    def __init__(  # noqa: PLR0917 (one for each thing that is known of a platoon)
        self,
        cautions: Cautions,
        radios: Collection[int],
        positions_m: Array,
        headways_s: Array,
        speed_m_s: float,
        scales: Array,
        rng: np.random.Generator,
    ) -> None:
        """Drive up to time 0.

        Args:
            cautions: how cars know that another one is ahead.
            radios: numbers of the cars with a radio.
            positions_m: (cars,) along the road.
            headways_s: (cars,) to the car ahead.
            speed_m_s: of the platoon.
            scales: (cars,) what OBD says of the true speed, as a share.
            rng: source of speeds and errors.
        """
        self._cautions, self._radios, self._rng = cautions, radios, rng
        self._positions_m, self._headways_s = positions_m, headways_s
        self._mean_m_s, self._scales = speed_m_s, scales
        cars = len(positions_m)
        self._has_receivers = not isinstance(cautions, str)
        sigma_m = 0.0 if isinstance(cautions, str) else cautions
        self._receivers = Receivers(cars, sigma_m, rng)
        self._hosts = {car: CautionHost(self._receivers.sigma_m) for car in radios}
        self._judged: set[tuple[int, int]] = set()
        self._waves_m_s = np.zeros(len(WAVES))
        self._speeds_m_s = np.full(cars, speed_m_s)
        self._swayed_m_s2 = np.zeros(cars)
        self._step = -round(HISTORY_S / STEP_S)
        self.advance(0.0)

    def advance(self, now: float) -> None:
        """Drive on until `now`, and let all receive each other's speeds."""
        while self._step * STEP_S <= now:
            self._drive()
            if self._step % SAMPLE_STEPS == 0:
                self._exchange(self._step * STEP_S)
            self._step += 1

    def receive_braking(self, sender: int, receivers: Iterable[int], now: float) -> Iterator[int]:
        """Take a BSM whose hard braking flag is set, and yield whose driver is then cautioned."""
        for car in receivers:
            if (car, sender) in self._judged:
                continue
            self._judged.add((car, sender))
            if self._is_cautioned(car, sender, now):
                yield car

    def _is_cautioned(self, car: int, sender: int, now: float) -> bool:
        if self._cautions == "known":
            return sender < car
        host, shown_m_s = self._hosts[car], shown(self._speeds_m_s, self._scales)
        place = self._place(sender)
        host.receive_bsm(sender, shown_m_s[sender], now, place=place, brakes=True)
        return sender in host.brakings_ahead(shown_m_s[car], self._place(car), now)

    def _place(self, car: int) -> State | None:
        if not self._has_receivers:
            return None
        speed_m_s = float(self._speeds_m_s[car])
        return self._receivers.state(car, 0.0, float(self._positions_m[car]), speed_m_s)

    def _drive(self) -> None:
        self._receivers.advance(STEP_S)
        draws = self._rng.standard_normal(len(self._speeds_m_s) + len(WAVES))
        for wave, (sigma_m_s, lasts_s) in enumerate(WAVES):
            kept = self._waves_m_s[wave : wave + 1]
            self._waves_m_s[wave] = wandered(
                kept, sigma_m_s, STEP_S / lasts_s, draws[wave : wave + 1]
            )[0]
        self._swayed_m_s2 = wandered(
            self._swayed_m_s2, SWAY_M_S2, STEP_S / SWAY_S, draws[len(WAVES) :]
        )
        opening_m_s = np.roll(self._speeds_m_s, 1) - self._speeds_m_s
        faster_m_s2 = opening_m_s / self._headways_s + self._swayed_m_s2
        self._speeds_m_s = self._speeds_m_s + STEP_S * faster_m_s2
        self._speeds_m_s[0] = self._mean_m_s + float(self._waves_m_s.sum())

    def _exchange(self, now: float) -> None:
        if self._cautions == "known":
            return
        shown_m_s = shown(self._speeds_m_s, self._scales)
        for car, host in self._hosts.items():
            for other in self._radios:
                if other != car:
                    host.receive_bsm(other, shown_m_s[other], now, place=None)
            host.brakings_ahead(shown_m_s[car], None, now)
