"""The C-V2X sidelink in mode 4 between N stations, without I/O: the access of LTE-V2X (PC5).

Time is divided into subframes of 1 ms, and each of them into subchannels. A station reserves the
same subchannels every 100 ms for its periodic messages (user priority 5), for 5 to 15 of them
(semi-persistent scheduling), and sends all others once, in the next `event_window_ms`. For either
it chooses among the resources that its sensing of the last second leaves (3GPP TS 36.213,
14.1.1.6): not those that a station has reserved that it receives with more than a threshold, which
grows by 3 dB until a fifth of all are left, nor those of subframes in which it has sent itself; of
the rest one of the quietest fifth.

A station that sends receives nothing in that subframe. A message is decoded by its power over noise
and the powers of all others in its subchannels, with the block error rates of 3GPP R1-160284 (190
bytes, QPSK 0.5 or 0.7, 280 km/h). Not modelled: emissions into other subchannels, congestion
control, repetitions, and shadowing that lasts.
"""

import heapq
import math
from collections import defaultdict, deque
from dataclasses import dataclass
from itertools import count

import numpy as np
from numpy.typing import NDArray

from sim_rig.propagation.fading import Fading
from sim_rig.propagation.shadowing import VehicleShadowing
from sim_rig.radio.channel import Reception
from sim_rig.radio.links import Links
from sim_rig.radio.ofdm import from_db
from sim_rig.scenario.radio_settings import SidelinkSettings

Array = NDArray[np.float64]

SUBFRAME_S = 1e-3
PERIOD = 100
"""Subframes between two reserved ones."""
SENSED = 1000
"""Subframes that a station remembers."""
LEAST_SHARE = 0.2
"""Of all resources that is left to choose from, and that is chosen from."""
PERIODIC_PRIORITY = 5
"""User priority of BSMs (SAE J2945/1)."""
_LEAST_USES, _MOST_USES = 5, 15
"""Of a reservation, with a period of 100 ms (TS 36.321, 5.14.1.1)."""
_THRESHOLD_STEP_DB = 3.0
_THERMAL_DBM = -104.0
"""Of 10 MHz, in which 50 resource blocks lie."""
_BLOCKS = 50
_BLOCKS_OF_MESSAGE = {0.5: 12, 0.7: 10}
"""Resource blocks that 190 bytes have in QPSK, by code rate."""
_SINR_DB = (-2.0, 0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0, 20.0, 20.1)
_ERROR_RATES = {
    0.5: (1.0, 0.9, 0.7, 0.3, 0.09, 0.02, 2e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-4),
    0.7: (1.0, 1.0, 0.9, 0.7, 0.4, 0.13, 0.045, 0.017, 7e-3, 1e-3, 1e-3, 1e-4),
}
_LONG_AGO = -(10**9)


def error_rate(sinr_db: Array, code_rate: float = 0.7) -> Array:
    """Return block error rates by SINR, for a code rate of 0.5 or 0.7."""
    rates: Array = np.interp(sinr_db, _SINR_DB, _ERROR_RATES[code_rate])
    return rates


@dataclass(slots=True)
class _Reservation:
    """Of one station."""

    phase: int
    first: int
    width: int
    left: int
    """Uses that remain."""
    used: int = _LONG_AGO
    """The last subframe that a message has."""


@dataclass(frozen=True, slots=True)
class _Transmission:
    number: int
    sender: int
    queued_s: float
    first: int
    """Subchannel."""
    width: int
    reserves: bool
    """Whether it announces the same subchannels in 100 ms."""

    @property
    def subchannels(self) -> slice:
        return slice(self.first, self.first + self.width)


class SidelinkChannel:
    """Broadcasts messages between stations, with the interface of `Channel`."""

    def __init__(self, settings: SidelinkSettings, stations: int, rng: np.random.Generator) -> None:
        """Open a channel; stations have no links before `receive_positions`.

        Args:
            settings: parameters of the channel.
            stations: number of stations.
            rng: source of choices, fading and losses.
        """
        self._settings = settings
        self._rng = rng
        self._fading = Fading(settings.nakagami_m, rng)
        self._links = Links(settings, np.full((stations, 2), math.nan))
        self._sensitivity_mw = from_db(settings.sensitivity_dbm)
        self._noise_mw = from_db(_THERMAL_DBM + settings.noise_figure_db) * (
            _BLOCKS_OF_MESSAGE[settings.code_rate] / _BLOCKS
        )
        """In one subchannel."""
        subchannels = settings.subchannels
        self._power_mw = np.zeros((stations, SENSED, subchannels), dtype=np.float32)
        self._sensed_at = np.full(SENSED, _LONG_AGO)
        self._reserved_mw = np.zeros((stations, PERIOD, subchannels), dtype=np.float32)
        self._reserved_at = np.full((stations, PERIOD, subchannels), _LONG_AGO)
        self._sent_at = np.full((stations, PERIOD), _LONG_AGO)
        self._reservations: dict[int, _Reservation] = {}
        self._planned: defaultdict[int, list[_Transmission]] = defaultdict(list)
        self._agenda: list[int] = []
        self._numbers = count()
        self._received: deque[Reception] = deque()
        self.airtime_s = 0.0
        """Total time of all messages, each by the share of the subchannels that it has."""

    def receive_positions(
        self, position_m: Array, vehicles: VehicleShadowing | None = None
    ) -> None:
        """Update the positions of the stations; see `Channel`."""
        self._links = Links(self._settings, position_m, vehicles)

    def receive_frame(
        self, station: int, payload_bytes: int, user_priority: int, now: float
    ) -> int:
        """Queue a message for broadcast, and return its number; see `Channel`."""
        self.handle_timer(now)
        subframe = math.floor(now / SUBFRAME_S + 1e-6)
        settings = self._settings
        width = min(-(-payload_bytes // settings.subchannel_bytes), settings.subchannels)
        at = None
        if user_priority == PERIODIC_PRIORITY:
            at = self._use_reservation(station, width, subframe)
        if at is None:
            at, first = self._choose(station, width, subframe, settings.event_window_ms)
            reserves = False
        else:
            reservation = self._reservations[station]
            first, width, reserves = reservation.first, reservation.width, reservation.left > 0
            if not reserves:
                del self._reservations[station]
        if at not in self._planned:
            heapq.heappush(self._agenda, at)
        number = next(self._numbers)
        self._planned[at].append(_Transmission(number, station, now, first, width, reserves))
        return number

    def get_timer(self) -> float:
        """Return when the next message ends; `math.inf` without one."""
        return (self._agenda[0] + 1) * SUBFRAME_S if self._agenda else math.inf

    def handle_timer(self, now: float) -> None:
        """End all messages that are due."""
        while self._agenda and (self._agenda[0] + 1) * SUBFRAME_S <= now + 1e-9:
            subframe = heapq.heappop(self._agenda)
            self._end(subframe, self._planned.pop(subframe))

    def next_event(self) -> Reception | None:
        """Return the oldest ended message not yet taken; `None` if there is none."""
        return self._received.popleft() if self._received else None

    # ---- access ---------------------------------------------------------------------------

    def _use_reservation(self, station: int, width: int, subframe: int) -> int | None:
        """Return the subframe of a reserved resource; `None` if the next one is in use already."""
        known = self._reservations.get(station)
        if known is None or known.width < width:
            at, first = self._choose(station, width, subframe, PERIOD)
            uses = int(self._rng.integers(_LEAST_USES, _MOST_USES + 1))
            known = _Reservation(at % PERIOD, first, width, uses)
            self._reservations[station] = known
        at = subframe + 1 + (known.phase - subframe - 1) % PERIOD
        if at <= known.used:
            return None
        known.used = at
        known.left -= 1
        return at

    def _choose(self, station: int, width: int, subframe: int, window: int) -> tuple[int, int]:
        """Return subframe and first subchannel of a resource in the next `window` subframes."""
        subframes = subframe + 1 + np.arange(window)
        phases = subframes % PERIOD
        firsts = self._settings.subchannels - width + 1
        is_fresh = self._reserved_at[station, phases] > subframe - PERIOD
        reserved_mw = np.where(is_fresh, self._reserved_mw[station, phases], 0.0)
        was_sending = self._sent_at[station, phases] > subframe - SENSED
        was_sending |= [
            any(each.sender == station for each in self._planned.get(at, ()))
            for at in subframes.tolist()
        ]
        sensed_mw = np.where(
            (self._sensed_at > subframe - SENSED)[:, None], self._power_mw[station], 0.0
        )
        mean_mw = sensed_mw.reshape(SENSED // PERIOD, PERIOD, -1).mean(axis=0)[phases]
        shape = window, firsts
        highest_mw, total_mw = np.zeros(shape), np.zeros(shape)
        for offset in range(width):
            highest_mw = np.maximum(highest_mw, reserved_mw[:, offset : offset + firsts])
            total_mw = total_mw + mean_mw[:, offset : offset + firsts]
        highest_mw[was_sending] = math.inf
        needed = max(round(LEAST_SHARE * window * firsts), 1)
        threshold_mw = self._sensitivity_mw
        free = np.flatnonzero(highest_mw.ravel() <= threshold_mw)
        limit_mw = float(np.max(highest_mw, initial=0.0, where=np.isfinite(highest_mw)))
        while len(free) < needed and threshold_mw < limit_mw:
            threshold_mw *= from_db(_THRESHOLD_STEP_DB)
            free = np.flatnonzero(highest_mw.ravel() <= threshold_mw)
        if not len(free):  # it sends in all of them
            free = np.arange(window * firsts)
        free = self._rng.permutation(free)
        quietest = free[np.argsort(total_mw.ravel()[free], kind="stable")[:needed]]
        chosen = int(self._rng.choice(quietest))
        return int(subframes[chosen // firsts]), chosen % firsts

    # ---- on the air -----------------------------------------------------------------------

    def _end(self, subframe: int, sent: list[_Transmission]) -> None:
        row, phase = subframe % SENSED, subframe % PERIOD
        if self._sensed_at[row] != subframe:
            self._power_mw[:, row] = 0.0
            self._sensed_at[row] = subframe
        powers_mw = [self._received_mw(each.sender) for each in sent]
        by_subchannel = np.zeros((self._settings.subchannels, len(powers_mw[0])))
        for each, power_mw in zip(sent, powers_mw, strict=True):
            by_subchannel[each.subchannels] += power_mw / each.width
        self._power_mw[:, row] = by_subchannel.T
        senders = [each.sender for each in sent]
        self._sent_at[senders, phase] = subframe
        for each, power_mw in zip(sent, powers_mw, strict=True):
            others_mw = by_subchannel[each.subchannels].sum(axis=0) - power_mw
            sinr = power_mw / (self._noise_mw * each.width + np.maximum(others_mw, 0.0))
            is_strong = power_mw >= self._sensitivity_mw
            is_strong[senders] = False
            errors = error_rate(10.0 * np.log10(np.maximum(sinr, 1e-9)), self._settings.code_rate)
            decoded = is_strong & (self._rng.random(len(errors)) >= errors)
            if each.reserves:
                # What announces the reservation is decoded where it is the strongest.
                knows = np.flatnonzero(is_strong & (power_mw >= others_mw))
                for subchannel in range(each.first, each.first + each.width):
                    self._reserved_mw[knows, phase, subchannel] = power_mw[knows]
                    self._reserved_at[knows, phase, subchannel] = subframe
            receivers = np.flatnonzero(decoded)
            ends_s = np.full(len(receivers), (subframe + 1) * SUBFRAME_S)
            self._received.append(
                Reception(
                    each.number,
                    each.sender,
                    each.queued_s,
                    subframe * SUBFRAME_S,
                    receivers,
                    ends_s,
                )
            )
            self.airtime_s += SUBFRAME_S * each.width / self._settings.subchannels

    def _received_mw(self, sender: int) -> Array:
        power_mw = self._fading.faded(self._links.mean_mw[sender])
        if self._settings.shadowing_db:
            shadowing_db = self._rng.normal(0.0, self._settings.shadowing_db, len(power_mw))
            power_mw = power_mw * 10.0 ** (shadowing_db / 10.0)
        return power_mw
