"""The 802.11p broadcast channel between N stations, without I/O.

Each frame has three events. At the end of its sender's backoff it is transmitted, and its received
power at each station is drawn. Preamble detection follows 4 us later: a station that neither
transmits nor receives another frame, and whose SINR is high enough, receives the frame until its
end. The channel is busy for these stations, and for those above the energy detection threshold. At
its end, a frame is received if it survives noise and all overlapping frames.

Carrier sensing, collisions, hidden stations and capture (the stronger of two preambles within
these 4 us) follow from this. Each step is vectorised over the receivers. Sources: IEEE 802.11-2016
clauses 10.22 and 17; the receiver is that of ns-3's `YansWifiPhy` (comparison:
docs/radio.md).
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

DETECTION_S = 4e-6
"""Duration of preamble and energy detection."""


@dataclass(frozen=True, slots=True, eq=False)
class Reception:
    """The end of a frame, with the stations that received it."""

    number: int
    """Number that `receive_frame` returned."""
    sender: int
    queued_s: float
    sent_s: float
    """NaN if the sender dropped the frame because the channel was not free in its lifetime."""
    receivers: NDArray[np.int64]
    at_s: Array
    """(receivers,) time of reception."""


class _EventKind(IntEnum):
    """Kind of a planned event; equal times are handled in this order."""

    ENDED = 0
    DETECTED = 1
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
    """Propagation delay."""
    listening: Bools
    """Whether a station receives the frame."""
    overlapping: list["_OnAir"] = field(default_factory=list)


class Channel:
    """Broadcasts frames between stations, which are identified by their index."""

    def __init__(self, settings: CsmaSettings, stations: int, rng: np.random.Generator) -> None:
        """Open a channel; stations have no links before `receive_positions`.

        Args:
            settings: parameters of the channel.
            stations: number of stations.
            rng: source of backoffs, fading and losses.
        """
        self._settings = settings
        self._rng = rng
        self._fading = Fading(settings.nakagami_m, rng)
        self._survival = SurvivalInNoise(settings.data_rate_mbit_s)
        self._noise_mw = noise_mw(settings.noise_figure_db)
        self._lossless_mw = self._noise_mw * self._survival.lossless_sinr()
        self._preamble_ratio = from_db(settings.preamble_snr_db)
        self._preamble_mw = from_db(settings.preamble_dbm)
        self._alone_mw = max(self._preamble_mw, self._preamble_ratio * self._noise_mw)
        self._sensitivity_mw = from_db(settings.sensitivity_dbm)
        self._energy_mw = from_db(settings.energy_detection_dbm)
        self._links = Links(settings, np.full((stations, 2), math.nan))
        self._stations = [Station(rng) for _ in range(stations)]
        self._counting: set[int] = set()
        """Stations with a running backoff or a frame to send."""
        self._busy_until = np.zeros(stations)
        self._eifs_until = np.zeros(stations)
        self._no_stations: Bools = np.zeros(stations, dtype=np.bool_)
        self._on_air: list[_OnAir] = []
        self._agenda: list[tuple[float, _EventKind, int, int, _OnAir | None]] = []
        self._order = count()
        self._numbers = count()
        self._received: deque[Reception] = deque()
        self.airtime_s = 0.0
        """Total airtime of all frames."""

    def receive_positions(
        self, position_m: Array, vehicles: VehicleShadowing | None = None
    ) -> None:
        """Update the positions of the stations.

        Args:
            position_m: (stations, 2), m; NaN for absent stations.
            vehicles: vehicles that shadow links, if the settings enable it.
        """
        self._links = Links(self._settings, position_m, vehicles)

    def receive_frame(
        self, station: int, payload_bytes: int, user_priority: int, now: float
    ) -> int:
        """Queue a frame for broadcast.

        Args:
            station: index of the sender.
            payload_bytes: size of the payload above the LLC.
            user_priority: 0 to 7.
            now: time, s.

        Returns:
            Number of the frame.
        """
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
        """Handle all events that are due."""
        agenda = self._agenda
        while agenda and agenda[0][0] <= now:
            at_s, moment, _, station, frame = heapq.heappop(agenda)
            if frame is None:
                if at_s == self._stations[station].access_s:
                    self._transmit(station, at_s)
            elif moment is _EventKind.DETECTED:
                self._detect(frame)
            else:
                self._end(frame)

    def next_event(self) -> Reception | None:
        """Return the oldest ended frame not yet taken; `None` if there is none."""
        return self._received.popleft() if self._received else None

    def _free_s(self, station: int) -> float:
        return max(float(self._busy_until[station]) + SIFS_S, float(self._eifs_until[station]))

    def _plan(self, station: int) -> None:
        at_s = self._stations[station].access_s
        if at_s < math.inf:
            entry = (at_s, _EventKind.ACCESS, next(self._order), station, None)
            heapq.heappush(self._agenda, entry)

    def _transmit(self, sender: int, now: float) -> None:
        its = self._stations[sender]
        if dropped := its.drop_expired(now):
            no_stations = np.zeros(0, dtype=np.int64)
            self._received += [
                Reception(each.number, sender, each.queued_s, math.nan, no_stations, np.zeros(0))
                for each in dropped
            ]
            self._replan(sender, now)
            return  # a next frame with access now has an event of its own
        queued = its.take(now, self._free_s(sender))
        settings = self._settings
        on_air_s = airtime_s(queued.psdu_bytes, settings.data_rate_mbit_s, settings.symbol_us)
        power_mw = self._fading.faded(self._links.mean_mw[sender])
        power_mw = power_mw * (power_mw >= self._sensitivity_mw)
        frame = _OnAir(
            queued,
            sender,
            now,
            now + on_air_s,
            power_mw,
            self._links.delay_s[sender],
            self._no_stations,
        )
        for other in self._on_air:
            other.overlapping.append(frame)
            frame.overlapping.append(other)
            other.listening[sender] = False  # a transmitting station receives nothing
        self._on_air.append(frame)
        self._busy_until[sender] = frame.end_s
        self._eifs_until[sender] = 0.0
        self.airtime_s += on_air_s
        order = next(self._order)
        detected_s = now + DETECTION_S
        heapq.heappush(self._agenda, (detected_s, _EventKind.DETECTED, order, sender, frame))
        heapq.heappush(self._agenda, (frame.end_s, _EventKind.ENDED, order, sender, frame))

    def _detect(self, frame: _OnAir) -> None:
        power_mw, here_s = frame.power_mw, frame.end_s + frame.delay_s
        if frame.overlapping:
            self._detect_with_interference(frame)
        else:
            frame.listening = power_mw >= self._alone_mw
        before = {each: float(self._busy_until[each]) for each in self._counting}
        np.maximum(self._busy_until, here_s, out=self._busy_until, where=frame.listening)
        if frame.overlapping:
            self._detect_energy(frame)
        for station, busy_until in before.items():
            self._hold(station, frame, busy_until)

    def _detect_with_interference(self, frame: _OnAir) -> None:
        """Detect a preamble unless the station is receiving, transmitting, or below the SINR."""
        others_mw = np.zeros_like(frame.power_mw)
        able = np.ones(len(others_mw), dtype=np.bool_)
        for other in frame.overlapping:
            able[other.sender] = False
            able &= ~other.listening
            if other.end_s > frame.start_s + DETECTION_S:
                others_mw += other.power_mw
        able &= frame.power_mw >= self._preamble_ratio * (self._noise_mw + others_mw)
        frame.listening = able & (frame.power_mw >= self._preamble_mw)

    def _detect_energy(self, frame: _OnAir) -> None:
        """Mark the channel busy until the total power falls below the threshold."""
        total_mw = np.zeros_like(frame.power_mw)
        for each in sorted([frame, *frame.overlapping], key=lambda it: -it.end_s):
            total_mw = total_mw + each.power_mw
            loud = total_mw >= self._energy_mw
            np.maximum(
                self._busy_until, each.end_s + each.delay_s, out=self._busy_until, where=loud
            )

    def _hold(self, station: int, frame: _OnAir, busy_until: float) -> None:
        """Pause a station's backoff if the channel stays busy beyond `busy_until`."""
        if self._busy_until[station] <= busy_until:
            return
        its = self._stations[station]
        onset_s = frame.start_s + float(frame.delay_s[station]) + DETECTION_S
        if its.access_s < onset_s:  # it transmits before it detects the frame
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
        lost, corrupt = self._losses(frame, listeners)
        if len(lost):
            self._eifs_until[listeners[corrupt]] = at_s[corrupt] + SIFS_S + EIFS_EXTRA_S
            for station in self._counting.intersection(listeners[corrupt].tolist()):
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
        """Return the indices of receivers that lost the frame, and of those that lost its data."""
        power_mw = frame.power_mw[listeners]
        header_s, data_s = frame.start_s + PREAMBLE_S, frame.start_s + HEADERS_S
        others = frame.overlapping
        if not others:
            at_risk = (power_mw < self._lossless_mw).nonzero()[0]
            if not len(at_risk):
                return at_risk, at_risk
            power_mw, listeners = power_mw[at_risk], listeners[at_risk]
            segments = [(header_s, data_s), (data_s, frame.end_s)]
            noise_mw = np.array([[self._noise_mw]])  # the same for all
        else:
            at_risk = np.arange(len(listeners))
            edges_s = {header_s, data_s, frame.end_s}
            for other in others:
                edges_s.update(
                    at_s for at_s in (other.start_s, other.end_s) if header_s < at_s < frame.end_s
                )
            segments = list(pairwise(sorted(edges_s)))
            noise_mw = np.full((len(segments), len(listeners)), self._noise_mw)
            for other in others:
                overlaps = [
                    other.start_s <= at_s and other.end_s >= to_s for at_s, to_s in segments
                ]
                noise_mw[overlaps] += other.power_mw[listeners]
        of_header = [from_s < data_s for from_s, _ in segments]
        log_survival = self._survival.log_survival(
            power_mw / noise_mw, of_header, [until_s - from_s for from_s, until_s in segments]
        )
        headers = sum(of_header)
        luck = self._rng.standard_exponential((2, len(listeners)))
        header: Bools = luck[0] > -log_survival[:headers].sum(axis=0)
        data: Bools = luck[1] > -log_survival[headers:].sum(axis=0)
        return at_risk[~(header & data)], at_risk[header & ~data]
