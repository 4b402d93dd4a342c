"""Observations of plates, vehicles and the lead, made from tracks."""

import math

from onboard.observations import Lead, LeadIdentity, Plate, VehicleDetection
from onboard.vision.detection import Detection
from onboard.vision.perspective import bounding_box
from onboard.vision.plates import MIN_TEXT_CONFIDENCE
from onboard.vision.vehicle_track import VehicleTrack


def plate(
    detection: Detection, track: VehicleTrack | None, stamp_s: float, *, is_lead: bool
) -> Plate:
    """Report one plate or tag.

    Args:
        detection: of the frame.
        track: that it was associated with, if any.
        stamp_s: of the frame.
        is_lead: whether `track` is the lead.
    """
    text, confidence = detection.text, detection.confidence
    if track is not None:
        text, confidence = track.text_of(detection)
    if confidence < MIN_TEXT_CONFIDENCE:
        text, confidence = None, 0.0
    return Plate(stamp_s, detection.box, text, confidence, is_lead)


def vehicle_detection(track: VehicleTrack, stamp_s: float, lens_sigma: float) -> VehicleDetection:
    """Report range and bearing of one track.

    Args:
        track: predicted to `stamp_s`.
        stamp_s: of the frame.
        lens_sigma: of all distances, as a share of them.
    """
    ahead_m, right_m = track.ahead.position_m, track.right.position_m
    range_m, bearing_rad = math.hypot(ahead_m, right_m), math.atan2(right_m, ahead_m)
    return VehicleDetection(
        stamp_s=stamp_s,
        track_id=track.track_id,
        range_m=range_m,
        range_sigma_m=_distance_sigma_m(track, range_m, lens_sigma),
        bearing_rad=bearing_rad,
        bearing_sigma_rad=math.hypot(
            track.right.position_sigma_m / range_m, lens_sigma * bearing_rad
        ),
        text=track.text,
    )


def without_lead(stamp_s: float, *, is_free: bool) -> Lead:
    """Report that there is no lead, or that none is known if the lane was not seen to be free."""
    return Lead(stamp_s, LeadIdentity.NO_LEAD if is_free else LeadIdentity.UNKNOWN)


def lead(track: VehicleTrack, stamp_s: float, lens_sigma: float) -> Lead:
    """Report gap, closing speed and identity of the lead.

    Args:
        track: of the lead, predicted to `stamp_s`.
        stamp_s: of the frame.
        lens_sigma: of all distances and speeds, as a share of them.
    """
    text, ahead = track.text, track.ahead
    return Lead(
        stamp_s=stamp_s,
        identity=LeadIdentity.UNKNOWN if text is None else LeadIdentity.KNOWN,
        text=text,
        gap_m=ahead.position_m,
        gap_sigma_m=_distance_sigma_m(track, ahead.position_m, lens_sigma),
        closing_speed_m_s=-ahead.rate_m_s,
        closing_speed_sigma_m_s=math.hypot(ahead.rate_sigma_m_s, lens_sigma * ahead.rate_m_s),
        track_id=track.track_id,
        candidates=track.candidates,
        box=bounding_box(track.corners_px) if track.observed_at == stamp_s else None,
    )


def _distance_sigma_m(track: VehicleTrack, distance_m: float, lens_sigma: float) -> float:
    """Sigma with the errors that are common to all distances of this track, or of this drive."""
    return math.hypot(track.gap_sigma_m, track.size_sigma * distance_m, lens_sigma * distance_m)
