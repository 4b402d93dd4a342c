"""The 802.11p broadcast channel between N stations, without I/O.

Each frame has three moments. When its sender's backoff ends it goes on the air, and the power at
which everybody receives it is drawn. Four microseconds later everybody has noticed it or not: who
is not listening to another frame or transmitting, and has its preamble well above noise and
interference, listens to it until its end; the channel is busy for those, and for whoever measures
much energy. At its end, those who listened have it if it survived noise and all that overlapped.

So carrier sensing, collisions, hidden stations and capture (the stronger of two preambles that
begin within those four microseconds) come out by themselves. Each step is vectorised over the
receivers. Sources: IEEE 802.11-2016 clauses 10.22 and 17; the receiver is that of ns-3's
`YansWifiPhy`, against which docs/radio.md holds it.
"""

import heapq
import math
from collections import deque
from dataclasses import dataclass, field
from enum import IntEnum
from itertools import count, pairwise

import numpy as np
from numpy.typing import NDArray

from sim_rig.propagation.fading import Fading
from sim_rig.propagation.shadowing import VehicleShadowing
from sim_rig.radio.edca import EIFS_EXTRA_S, SIFS_S, AccessCategory, QueuedFrame, Station
from sim_rig.radio.links import Links
from sim_rig.radio.ofdm import (
    HEADERS_S,
    PREAMBLE_S,
    SurvivalInNoise,
    airtime_s,
    from_db,
    noise_mw,
    psdu_bytes,
)
from sim_rig.scenario.radio_settings import CsmaSettings

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

NOTICED_AFTER_S = 4e-6
"""Preamble and energy detection take this long."""


@dataclass(frozen=True, slots=True, eq=False)
class Reception:
    """What has become of a frame: who has it."""

    number: int
    """As `receive_frame` gave it."""
    sender: int
    queued_s: float
    sent_s: float
    """NaN for one that its sender has given up, as the channel was never free."""
    receivers: NDArray[np.int64]
    at_s: Array
    """When each of them has it."""


class _Moment(IntEnum):
    """What is due."""

    ENDED = 0
    NOTICED = 1
    ACCESS = 2


@dataclass(slots=True, eq=False)
class _OnAir:
    """A frame on the air. Arrays are over all stations."""

    queued: QueuedFrame
    sender: int
    start_s: float
    end_s: float
    power_mw: Array
    delay_s: Array
    """Of propagation."""
    listening: Bools
    overlapping: list["_OnAir"] = field(default_factory=list)


class Channel:
    """Broadcast frames between stations, which are known by their index."""

    def __init__(self, settings: CsmaSettings, stations: int, rng: np.random.Generator) -> None:
        """Stations are out of everybody's reach until `receive_positions` says where they are."""
        self._settings = settings
        self._rng = rng
        self._fading = Fading(settings.nakagami_m, rng)
        self._survival = SurvivalInNoise(settings.data_rate_mbit_s)
        self._noise_mw = noise_mw(settings.noise_figure_db)
        self._sure_mw = self._noise_mw * self._survival.sure_from_sinr()
        self._preamble_ratio = from_db(settings.preamble_snr_db)
        self._preamble_mw = from_db(settings.preamble_dbm)
        self._alone_mw = max(self._preamble_mw, self._preamble_ratio * self._noise_mw)
        self._sensitivity_mw = from_db(settings.sensitivity_dbm)
        self._energy_mw = from_db(settings.energy_detection_dbm)
        self._links = Links(settings, np.full((stations, 2), math.nan))
        self._stations = [Station(rng) for _ in range(stations)]
        self._counting: set[int] = set()
        """Stations with a backoff that still counts, or a frame to send."""
        self._busy_until = np.zeros(stations)
        self._eifs_until = np.zeros(stations)
        self._nobody: Bools = np.zeros(stations, dtype=np.bool_)
        self._on_air: list[_OnAir] = []
        self._agenda: list[tuple[float, _Moment, int, int, _OnAir | None]] = []
        self._order = count()
        self._numbers = count()
        self._received: deque[Reception] = deque()
        self.airtime_s = 0.0
        """Of all frames so far."""

    def receive_positions(
        self, position_m: Array, vehicles: VehicleShadowing | None = None
    ) -> None:
        """Where the stations are from now on, (stations, 2); NaN for one that is not there.

        `vehicles` are the cars that shadow, if the settings say that cars do.
        """
        self._links = Links(self._settings, position_m, vehicles)

    def receive_frame(
        self, station: int, payload_bytes: int, user_priority: int, now: float
    ) -> int:
        """A station is given a frame to broadcast; returns the frame's number."""
        self.handle_timer(now)
        frame = QueuedFrame(next(self._numbers), psdu_bytes(payload_bytes), now)
        busy = bool(self._busy_until[station] > now)
        category = AccessCategory.of(user_priority)
        its = self._stations[station]
        its.enqueue(frame, category, now, self._free_s(station), busy)
        self._counting.add(station)
        self._plan(station)
        return frame.number

    def get_timer(self) -> float:
        """Return when the next event is due; `math.inf` without one."""
        return self._agenda[0][0] if self._agenda else math.inf

    def handle_timer(self, now: float) -> None:
        """Let everything happen that is due."""
        agenda = self._agenda
        while agenda and agenda[0][0] <= now:
            at_s, moment, _, station, frame = heapq.heappop(agenda)
            if frame is None:
                if at_s == self._stations[station].access_s:
                    self._transmit(station, at_s)
            elif moment is _Moment.NOTICED:
                self._notice(frame)
            else:
                self._end(frame)

    def next_event(self) -> Reception | None:
        """The oldest frame that ended and was not yet taken; also those that nobody has."""
        return self._received.popleft() if self._received else None

    def _free_s(self, station: int) -> float:
        return max(float(self._busy_until[station]) + SIFS_S, float(self._eifs_until[station]))

    def _plan(self, station: int) -> None:
        at_s = self._stations[station].access_s
        if at_s < math.inf:
            entry = (at_s, _Moment.ACCESS, next(self._order), station, None)
            heapq.heappush(self._agenda, entry)

    def _transmit(self, sender: int, now: float) -> None:
        its = self._stations[sender]
        if given_up := its.give_up(now):
            nobody = np.zeros(0, dtype=np.int64)
            self._received += [
                Reception(each.number, sender, each.queued_s, math.nan, nobody, np.zeros(0))
                for each in given_up
            ]
            self._replan(sender, now)
            return  # if another frame may go now, that is due again at once
        queued = its.take(now, self._free_s(sender))
        settings = self._settings
        on_air_s = airtime_s(queued.psdu_bytes, settings.data_rate_mbit_s, settings.symbol_us)
        power_mw = self._fading.faded(self._links.mean_mw[sender])
        power_mw = power_mw * (power_mw >= self._sensitivity_mw)
        frame = _OnAir(
            queued, sender, now, now + on_air_s, power_mw, self._links.delay_s[sender], self._nobody
        )
        for other in self._on_air:
            other.overlapping.append(frame)
            frame.overlapping.append(other)
            other.listening[sender] = False  # whatever it was about to notice
        self._on_air.append(frame)
        self._busy_until[sender] = frame.end_s
        self._eifs_until[sender] = 0.0
        self.airtime_s += on_air_s
        order = next(self._order)
        noticed_s = now + NOTICED_AFTER_S
        heapq.heappush(self._agenda, (noticed_s, _Moment.NOTICED, order, sender, frame))
        heapq.heappush(self._agenda, (frame.end_s, _Moment.ENDED, order, sender, frame))

    def _notice(self, frame: _OnAir) -> None:
        power_mw, here_s = frame.power_mw, frame.end_s + frame.delay_s
        if frame.overlapping:
            self._notice_among_others(frame)
        else:
            frame.listening = power_mw >= self._alone_mw
        before = {each: float(self._busy_until[each]) for each in self._counting}
        np.maximum(self._busy_until, here_s, out=self._busy_until, where=frame.listening)
        if frame.overlapping:
            self._feel_energy(frame)
        for station, busy_until in before.items():
            self._hold(station, frame, busy_until)

    def _notice_among_others(self, frame: _OnAir) -> None:
        """Who listens already, transmits, or hears too much else, does not notice the frame."""
        others_mw = np.zeros_like(frame.power_mw)
        able = np.ones(len(others_mw), dtype=np.bool_)
        for other in frame.overlapping:
            able[other.sender] = False
            able &= ~other.listening
            if other.end_s > frame.start_s + NOTICED_AFTER_S:
                others_mw += other.power_mw
        able &= frame.power_mw >= self._preamble_ratio * (self._noise_mw + others_mw)
        frame.listening = able & (frame.power_mw >= self._preamble_mw)

    def _feel_energy(self, frame: _OnAir) -> None:
        """The channel is busy until all signals together fall below the threshold."""
        total_mw = np.zeros_like(frame.power_mw)
        for each in sorted([frame, *frame.overlapping], key=lambda it: -it.end_s):
            total_mw = total_mw + each.power_mw
            loud = total_mw >= self._energy_mw
            np.maximum(
                self._busy_until, each.end_s + each.delay_s, out=self._busy_until, where=loud
            )

    def _hold(self, station: int, frame: _OnAir, busy_until: float) -> None:
        """Stop a station's counting if the channel, busy before `busy_until`, is so for longer."""
        if self._busy_until[station] <= busy_until:
            return
        its = self._stations[station]
        onset_s = frame.start_s + float(frame.delay_s[station]) + NOTICED_AFTER_S
        if its.access_s < onset_s:  # it begins to talk before it notices
            self._busy_until[station] = busy_until
            frame.listening[station] = False
            return
        its.pause(onset_s, max(busy_until + SIFS_S, float(self._eifs_until[station])))
        if its.is_at_rest:
            self._counting.discard(station)
        else:
            self._replan(station, onset_s)

    def _end(self, frame: _OnAir) -> None:
        self._on_air.remove(frame)
        listeners = frame.listening.nonzero()[0]
        at_s = frame.end_s + frame.delay_s[listeners]
        lost, garbled = self._losses(frame, listeners)
        if len(lost):
            self._eifs_until[listeners[garbled]] = at_s[garbled] + SIFS_S + EIFS_EXTRA_S
            for station in self._counting.intersection(listeners[garbled].tolist()):
                self._replan(station, frame.end_s)
            listeners, at_s = np.delete(listeners, lost), np.delete(at_s, lost)
        frame.overlapping.clear()
        queued = frame.queued
        self._received.append(
            Reception(queued.number, frame.sender, queued.queued_s, frame.start_s, listeners, at_s)
        )
        self._counting.add(frame.sender)
        self._replan(frame.sender, frame.end_s)

    def _replan(self, station: int, now: float) -> None:
        self._stations[station].plan(now, self._free_s(station))
        self._plan(station)

    def _losses(
        self, frame: _OnAir, listeners: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Which of the listeners have lost the frame; which of those by its data alone."""
        power_mw = frame.power_mw[listeners]
        header_s, data_s = frame.start_s + PREAMBLE_S, frame.start_s + HEADERS_S
        others = frame.overlapping
        if not others:
            at_risk = (power_mw < self._sure_mw).nonzero()[0]
            if not len(at_risk):
                return at_risk, at_risk
            power_mw, listeners = power_mw[at_risk], listeners[at_risk]
            stretches = [(header_s, data_s), (data_s, frame.end_s)]
            noise_mw = np.array([[self._noise_mw]])  # the same for all
        else:
            at_risk = np.arange(len(listeners))
            edges_s = {header_s, data_s, frame.end_s}
            for other in others:
                edges_s.update(
                    at_s for at_s in (other.start_s, other.end_s) if header_s < at_s < frame.end_s
                )
            stretches = list(pairwise(sorted(edges_s)))
            noise_mw = np.full((len(stretches), len(listeners)), self._noise_mw)
            for other in others:
                overlaps = [
                    other.start_s <= at_s and other.end_s >= to_s for at_s, to_s in stretches
                ]
                noise_mw[overlaps] += other.power_mw[listeners]
        of_header = [from_s < data_s for from_s, _ in stretches]
        log_survival = self._survival.log_survival(
            power_mw / noise_mw, of_header, [until_s - from_s for from_s, until_s in stretches]
        )
        headers = sum(of_header)
        luck = self._rng.standard_exponential((2, len(listeners)))
        header: Bools = luck[0] > -log_survival[:headers].sum(axis=0)
        data: Bools = luck[1] > -log_survival[headers:].sum(axis=0)
        return at_risk[~(header & data)], at_risk[header & ~data]
