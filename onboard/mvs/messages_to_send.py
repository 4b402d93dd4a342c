"""What a vehicle sends of its tracks: footers, SDSMs and CPMs."""

import math
from collections.abc import Generator, Sequence

import numpy as np

from onboard.kinematics.arrays import Array
from onboard.kinematics.local_frame import LocalFrame
from onboard.messages import mvs_footer
from onboard.messages.cpm import CollectivePerceptionMessage
from onboard.messages.message_frame import MESSAGE_COUNTS
from onboard.messages.sdsm import SensorDataSharingMessage
from onboard.mvs import cpm_coding
from onboard.mvs.cpm_coding import SharedObject
from onboard.mvs.evidence_to_send import EvidenceToSend
from onboard.mvs.footer_coding import fitting_entries, footer_of
from onboard.mvs.host_vehicle import HostVehicle
from onboard.mvs.sdsm_coding import MeasuredObject, Sender, message_of
from onboard.mvs.tracked_objects import without_radio
from onboard.tracking.evidence import observer_of
from onboard.tracking.track import Track
from onboard.tracking.tracks import Tracks


class MessagesToSend:
    """Composes messages of tracks that are up to date; the host vehicle has a position.

    Arguments of all: the tracks, the temporary IDs under which own measurements are known, the last
    of which is the present one, and the time, on the vehicle's clock and in ms of UTC.
    """

    def __init__(self, host: HostVehicle, evidence: EvidenceToSend, max_bytes: int) -> None:
        """Start with nothing sent.

        Args:
            host: sends them.
            evidence: selects what they contain.
            max_bytes: of a footer.
        """
        self._host = host
        self._evidence = evidence
        self._max_bytes = max_bytes
        self._sdsms = 0
        """Sent under the present ID."""

    def restart(self) -> None:
        """Begin anew after a correction of UTC."""
        self._evidence.restart()

    def begin_anew(self) -> None:
        """Count anew under another pseudonym."""
        self._sdsms = 0

    def merge(self, kept: Track, merged: Track) -> None:
        """Take what was sent of one track for sent of another, of the same vehicle."""
        self._evidence.sent.merge(kept, merged)

    def footer_in_slices(
        self, tracks: Tracks, own_ids: Sequence[bytes], now_ms: int
    ) -> Generator[None, None, bytes]:
        """Compose in slices the footer of a BSM, which is returned."""
        reported = without_radio(tracks)
        selected = yield from self._evidence.of_footer(reported, now_ms, own_ids)
        chosen = [
            (self._evidence.sent.wire_number(track, tracks), piece) for track, piece in selected
        ]
        frame, anchor = self._frame, LocalFrame(*self._host.anchor)
        yield
        fitting = fitting_entries(chosen, now_ms, self._max_bytes)
        self._evidence.sent.receive_sent(fitting, reported, now_ms)
        yield
        footer = footer_of(fitting, now_ms, frame, anchor)
        yield
        return mvs_footer.encode(footer)

    def sdsm(
        self, tracks: Tracks, own_ids: Sequence[bytes], now: float, now_ms: int
    ) -> SensorDataSharingMessage | None:
        """Return an SDSM; `None` without anything newly measured.

        It has the newest own measurement of each vehicle, those first that were last sent the
        longest ago.
        """
        measured = self._evidence.of_sdsm(without_radio(tracks), now_ms, own_ids)
        if not measured:
            return None
        objects = [
            MeasuredObject(
                self._evidence.sent.wire_number(track, tracks), newest, *_velocity(track)
            )
            for track, newest in measured
        ]
        # The count begins anew with each pseudonym, at a number that only the pseudonym gives.
        msg_cnt = (own_ids[-1][0] + self._sdsms) % MESSAGE_COUNTS
        self._sdsms += 1
        return message_of(objects, self._sender(own_ids[-1], now), now_ms, self._frame, msg_cnt)

    def cpm(
        self, tracks: Tracks, own_ids: Sequence[bytes], now: float, now_ms: int
    ) -> CollectivePerceptionMessage | None:
        """Return a CPM; `None` without a vehicle that is due.

        What a footer would have of a vehicle since its last CPM is evidence behind an object.
        """
        reported = without_radio(tracks)
        objects = [
            SharedObject(
                self._evidence.sent.wire_number(track, tracks),
                piece,
                *_velocity(track),
                is_sensed=any(observer_of(each) in own_ids for each in piece.provenance),
            )
            for track, piece in self._evidence.of_cpm(reported, now_ms, own_ids)
        ]
        if not objects:
            return None
        sender = self._sender(own_ids[-1], now)
        message, fitting = cpm_coding.encode_within(
            objects, sender, now_ms, self._frame, self._max_bytes, perceived=len(reported)
        )
        entries = [(each.number, each.piece) for each in fitting]
        self._evidence.sent.receive_sent(entries, reported, now_ms)
        return message if fitting else None

    @property
    def _frame(self) -> LocalFrame:
        frame = self._host.frame
        assert frame is not None  # noqa: S101 (a position comes with a frame)
        return frame

    def _sender(self, own_id: bytes, now: float) -> Sender:
        own, heading = self._host.state(), self._host.heading(now)
        assert own is not None  # noqa: S101 (the host vehicle has a position)
        sigma_m = math.sqrt(float(own.covariance[0, 0]))
        heading_rad = None if heading is None else heading.heading_rad
        return Sender(own_id, LocalFrame(*self._host.anchor), sigma_m, heading_rad)


def _velocity(track: Track) -> tuple[Array, float]:
    """Return the velocity of a track (2), and its sigma on either axis."""
    sigma_m_s = math.sqrt(float(np.trace(track.estimate.covariance[2:, 2:])) / 2.0)
    return track.estimate.state[2:], sigma_m_s
