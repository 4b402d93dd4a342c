"""Observations of plates, vehicles and the lead, made from tracks."""

import math
from collections.abc import Iterable, Iterator

from onboard.observations import Lead, LeadIdentity, Plate, VehicleDetection
from onboard.vision.detection import Detection, DetectionKind
from onboard.vision.perspective import bounding_box
from onboard.vision.plates import MIN_TEXT_CONFIDENCE
from onboard.vision.vehicle_track import VehicleTrack


class TrackReport:
    """Makes the observations of one frame; all tracks are predicted to its stamp."""

    def __init__(self, lens_sigma: float) -> None:
        """Take the sigma of all distances by the lens, as a share of them."""
        self._lens_sigma = lens_sigma
        self.picture_sigma = 0.0
        """The same by what impairs the picture."""
        self.bearing_sigma_rad = 0.0
        """Sigma of all bearings by it."""

    def plates(
        self,
        pairs: Iterable[tuple[Detection, VehicleTrack | None]],
        lead: VehicleTrack | None,
        stamp_s: float,
    ) -> Iterator[Plate]:
        """Report each plate and tag of the frame.

        Args:
            pairs: each detection with the track that it was associated with, if any.
            lead: one of the tracks, if there is one.
            stamp_s: of the frame.
        """
        for detection, track in pairs:
            if detection.kind is not DetectionKind.VEHICLE:
                is_lead = track is not None and track is lead and track.has_settled
                yield _plate(detection, track, stamp_s, is_lead=is_lead)

    def vehicle_detections(
        self, tracks: Iterable[VehicleTrack], stamp_s: float
    ) -> Iterator[VehicleDetection]:
        """Report range and bearing of each vehicle of these tracks."""
        for track in tracks:
            yield self._vehicle_detection(track, stamp_s)

    def lead(self, track: VehicleTrack | None, stamp_s: float, *, is_free: bool) -> Lead:
        """Report gap, closing speed and identity of the lead, once its motion is known.

        Args:
            track: of the lead, if there is one.
            stamp_s: of the frame.
            is_free: whether the lane was seen to be free: without a lead, there is none then.
        """
        if track is None or not track.has_settled:
            return Lead(stamp_s, LeadIdentity.NO_LEAD if is_free else LeadIdentity.UNKNOWN)
        text, ahead = track.text, track.ahead
        return Lead(
            stamp_s=stamp_s,
            identity=LeadIdentity.UNKNOWN if text is None else LeadIdentity.KNOWN,
            text=text,
            gap_m=ahead.position_m,
            gap_sigma_m=self._distance_sigma_m(track, ahead.position_m),
            closing_speed_m_s=-ahead.rate_m_s,
            closing_speed_sigma_m_s=ahead.rate_sigma_m_s,
            track_id=track.track_id,
            candidates=track.candidates,
            box=bounding_box(track.corners_px) if track.observed_at == stamp_s else None,
        )

    def _vehicle_detection(self, track: VehicleTrack, stamp_s: float) -> VehicleDetection:
        ahead_m, right_m = track.ahead.position_m, track.right.position_m
        range_m, bearing_rad = math.hypot(ahead_m, right_m), math.atan2(right_m, ahead_m)
        return VehicleDetection(
            stamp_s=stamp_s,
            track_id=track.track_id,
            range_m=range_m,
            range_sigma_m=self._distance_sigma_m(track, range_m),
            bearing_rad=bearing_rad,
            bearing_sigma_rad=math.hypot(
                track.right.position_sigma_m / range_m,
                self._lens_sigma * bearing_rad,
                self.bearing_sigma_rad,
            ),
            text=track.text,
        )

    def _distance_sigma_m(self, track: VehicleTrack, distance_m: float) -> float:
        """Sigma with the errors common to all distances of this track, or of this drive."""
        share = math.hypot(track.size_sigma, self._lens_sigma, self.picture_sigma)
        return math.hypot(track.gap_sigma_m, share * distance_m)


def _plate(
    detection: Detection, track: VehicleTrack | None, stamp_s: float, *, is_lead: bool
) -> Plate:
    text, confidence = detection.text, detection.confidence
    if track is not None:
        text, confidence = track.text_of(detection)
    if confidence < MIN_TEXT_CONFIDENCE:
        text, confidence = None, 0.0
    return Plate(stamp_s, detection.box, text, confidence, is_lead)
