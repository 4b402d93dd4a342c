"""The track of one vehicle: position, speed, format of its plate, and texts it may bear."""

import math

import numpy as np
import numpy.typing as npt

from onboard.observations import ImageBox, PlateCandidate
from onboard.vision.detection import Detection, DetectionKind
from onboard.vision.look_alikes import folded
from onboard.vision.motion import FrameMotion
from onboard.vision.perspective import Perspective, RoadPosition, bounding_box
from onboard.vision.plate_formats import PlateFormats, TrackPlateFormat
from onboard.vision.plate_posterior import PlatePosterior
from onboard.vision.plate_reader import CERTAIN
from onboard.vision.plate_views import PlateViews
from onboard.vision.rear import ScaleChange
from onboard.vision.still_in_picture import StillInPicture

MAX_INNOVATION_SIGMAS = 3.0
"""Innovation in sigmas above which a detection's sigma is enlarged until it is no more than
this."""
CONFIRM_DETECTIONS = 3
"""Frames with a detection that confirm a track."""
CONFIRM_S = 0.2
"""Least time from the first to the last of them."""
VEHICLE_S = 1.5
"""Time for which a plate counts as on a vehicle after the vehicle was found as such."""
MAX_INCONSISTENCY, INCONSISTENCY_SHARE = 3.0, 0.3
"""Mean square of the innovations by their sigmas above which a track is of no body that moves, and
the weight of each detection in that mean, and at least in that of its sizes."""
REPORTED_SIGMA_M_S = 4.0
"""Sigma of the speed along the road above which nothing is known of it: half of the 8 m/s that it
starts at. With 3 m/s, 39 of 44 leads of the labelled clip `small-leads` were found, with 4 m/s 40;
ghosts were the same. Alarms take back what is above
`onboard.risk.vehicle_motion.SETTLED_SIGMA_M_S`."""
MIN_READ_CONFIDENCE = 0.3
"""Confidence below which a reading contradicts no text."""
RULED_OUT = 1e-3
"""Probability below which a reading rules a text out."""
ACROSS_SIGMA_M_S, ACROSS_SIGMA_M_S2 = 8.0, 3.0
"""Sigmas of the speed across the road of a vehicle that crosses, and of its change in one second:
as of speeds along the road; 8 m/s is that of any up to 50 km/h in both directions."""
FASTEST_ACROSS = 2.0
"""The fastest speed across the road by its sigma."""
CROSSES_WITHIN_S = 0.35
"""Time after a detection for which what was not known to cross may be found in the next lane:
until the next search around what is new, and not until the next one of the whole picture."""
SETTLED_ACROSS_M_S = 2.5
"""Sigma of the speed across the road from which on a crossing vehicle is searched for like others:
until the next search of the whole picture, it moves by a quarter of its length more or less."""
GOES_ALONG = 0.5
"""Sigma of the speed across the road that a turn gives, as a share of what it gives to one that
stands: one that goes along is two sigmas away."""
BEARING_SIGMA = 0.003
"""Sigma of the direction to the middle of a rear, in rad."""
SIZE_SIGMA = {DetectionKind.TAG: 0.02, DetectionKind.PLATE: 0.06, DetectionKind.VEHICLE: 0.1}
"""Relative sigma of distances that averaging does not remove: the spread of true sizes, and a
constant error of the detector's edges on one plate. Widths of photographed plates scatter by 6
%."""


class VehicleTrack:
    """State of one tracked vehicle."""

    def __init__(
        self,
        track_id: int,
        first: Detection,
        stamp_s: float,
        formats: PlateFormats,
    ) -> None:
        """Start a tentative track.

        Args:
            track_id: unique in this tracker.
            first: detection that starts the track.
            stamp_s: of its frame.
            formats: formats of plates in this drive.
        """
        self.track_id = track_id
        self._format = TrackPlateFormat(formats)
        self._has_only_plates = first.kind is DetectionKind.PLATE
        first = self._update_format(first)
        self._started_at = stamp_s
        is_vehicle = first.kind is DetectionKind.VEHICLE
        self._vehicle_at = stamp_s if is_vehicle else -math.inf
        self._vehicles = int(is_vehicle)
        self._inconsistency = 1.0
        self._log_size_ratio, self._sizes = 0.0, 0
        self.detected_at = stamp_s
        """Time of the last detection."""
        self.observed_at = stamp_s
        """Time of the last detection, or of the last frame in which the rear was found again."""
        self.searched_at = stamp_s
        """Time of the last search for it."""
        self.read_at = stamp_s
        """Time of the last reading."""
        self.is_contradicted = False
        """Whether the last reading differs from the certain text."""
        self.detections = 1
        self.last = first
        """The latest detection of a plate or tag, else of a vehicle."""
        self.corners_px = first.corners_px
        """Its corners in the current frame."""
        self.ahead = FrameMotion(
            first.position.ahead_m,
            first.ahead_sigma_m,
            stamp_s,
            rate_sigma_m_s=8.0,
            acceleration_sigma_m_s2=3.0,
        )
        self.right = FrameMotion(
            first.position.right_m,
            first.right_sigma_m,
            stamp_s,
            rate_sigma_m_s=1.5,
            acceleration_sigma_m_s2=1.0,
        )
        self._cornered = stamp_s, self._place
        """Stamp and place that `corners_px` are of."""
        self.is_crossing = False
        """Whether it was found where only one that crosses can be."""
        self.rear_tracked_at = stamp_s
        """Time up to which the rear was tracked."""
        self.still_in_picture = StillInPicture()
        """Watches whether it stays on its pixels."""
        self.views: PlateViews | None = None
        """The mean of the plate's views."""
        self._posteriors = {kind: PlatePosterior() for kind in DetectionKind}
        self._receive_reading(first, stamp_s)

    @property
    def confirmed(self) -> bool:
        """Whether enough frames had a detection."""
        return self.detections >= CONFIRM_DETECTIONS and self.detected_s >= CONFIRM_S - 1e-3

    @property
    def detected_s(self) -> float:
        """Time from the first to the last detection."""
        return self.detected_at - self._started_at

    def is_consistent(self, slack: float = 1.0) -> bool:
        """Whether the detections are where a moving body would be; `slack` widens the bound."""
        return self._inconsistency <= slack * MAX_INCONSISTENCY

    @property
    def size_ratio(self) -> float:
        """Size of the boxes at their gaps, by that of their kind of vehicle; 1 if it is unknown."""
        return math.exp(self._log_size_ratio)

    @property
    def has_settled(self) -> bool:
        """Whether its speed is known well enough to be reported."""
        return self.ahead.rate_sigma_m_s <= REPORTED_SIGMA_M_S

    @property
    def is_crossing_unsettled(self) -> bool:
        """Whether it crosses, at a speed that is not known well yet."""
        return self.is_crossing and self.right.rate_sigma_m_s > SETTLED_ACROSS_M_S

    @property
    def has_vehicle(self) -> bool:
        """Whether it is more than a plate: a tag, a certain text, or found as a vehicle."""
        return (
            self.last.kind is not DetectionKind.PLATE
            or self.text is not None
            or self._is_found_vehicle
        )

    @property
    def _is_found_vehicle(self) -> bool:
        """Whether a vehicle was found as such there shortly before."""
        return self.observed_at - self._vehicle_at <= VEHICLE_S

    def is_still_in_picture(self, stamp_s: float) -> bool:
        """Whether it is part of the camera or of its picture, and no vehicle.

        One that is found as a vehicle for a moment, such as a stamp that one passes behind, is.
        """
        is_vehicle = self._is_found_vehicle and self._vehicles >= CONFIRM_DETECTIONS
        return not is_vehicle and self.still_in_picture.is_still(stamp_s)

    def receive_image(self, image: npt.NDArray[np.uint8], stamp_s: float) -> None:
        """Watch whether it stays on its pixels, if it was observed in this (h, w, 3) BGR image."""
        if self.observed_at == stamp_s:
            self.still_in_picture.receive_frame(image, bounding_box(self.corners_px), stamp_s)

    @property
    def text(self) -> str | None:
        """The certain text: the tag's, which detects errors, before the plate's."""
        tag, plate = self._tag_and_plate
        return tag.certain_text or plate.certain_text

    @property
    def candidates(self) -> tuple[PlateCandidate, ...]:
        """Texts that it may bear, the likeliest first: of the tag, or else of the plate."""
        tag, plate = self._tag_and_plate
        return tag.candidates() or plate.candidates()

    @property
    def _tag_and_plate(self) -> tuple[PlatePosterior, PlatePosterior]:
        return self._posteriors[DetectionKind.TAG], self._posteriors[DetectionKind.PLATE]

    def is_contradicted_by(self, detection: Detection) -> bool:
        """Whether both texts are certain, and the detection's reading rules the track's out."""
        texts, read = self._posteriors[detection.kind].candidates(1), detection.candidates
        if not texts or not read:
            return False
        are_certain = min(texts[0].probability, read[0].probability) >= CERTAIN
        text = folded(texts[0].text)
        return are_certain and all(
            folded(each.text) != text for each in read if each.probability >= RULED_OUT
        )

    def text_of(self, detection: Detection) -> tuple[str | None, float]:
        """Text of one of this track's detections, and its confidence by the readings of all frames.

        A reading that is not certain is replaced by the certain text, if there is one; otherwise
        the confidence is the lower of the reading's and of the text's posterior.
        """
        if detection.kind is not DetectionKind.PLATE:
            return detection.text, detection.confidence
        _, plate = self._tag_and_plate
        known = plate.certain_text
        if known is not None and detection.identity_confidence < CERTAIN:
            return known, plate.probability(known)
        if detection.text is None:
            return None, 0.0
        return detection.text, min(detection.confidence, plate.probability(detection.text))

    @property
    def gap_sigma_m(self) -> float:
        """Sigma of the gap: the filter's, and that of true sizes."""
        return math.hypot(
            self.ahead.position_sigma_m, SIZE_SIGMA[self.last.kind] * self.ahead.position_m
        )

    @property
    def size_sigma(self) -> float:
        """Relative sigma of the gap by the plate formats that are still possible."""
        return self._format.sigma if self._has_only_plates else 0.0

    def predict(self, stamp_s: float) -> None:
        """Predict the state to the time of the next frame."""
        self.ahead.predict(stamp_s)
        self.right.predict(stamp_s)

    def crossed_m(self, stamp_s: float) -> float:
        """How far to each side it can be of where it is expected; 0 if it shows a rear."""
        if self.is_crossing:
            return FASTEST_ACROSS * self.right.position_sigma_m
        since_s = stamp_s - self.detected_at
        if not self.last.may_cross or since_s > CROSSES_WITHIN_S:
            return 0.0
        return FASTEST_ACROSS * ACROSS_SIGMA_M_S * since_s

    def cross(self, stamp_s: float) -> None:
        """Take it to have crossed since its last detection, at a speed that is not known yet."""
        self.is_crossing = True
        self.right = FrameMotion(
            self.last.position.right_m,
            self.last.right_sigma_m,
            self.detected_at,
            rate_sigma_m_s=ACROSS_SIGMA_M_S,
            acceleration_sigma_m_s2=ACROSS_SIGMA_M_S2,
        )
        self.right.predict(stamp_s)

    def receive_turn(self, before_rad_s: float, now_rad_s: float) -> None:
        """Take another turn rate of the host vehicle, to the right: others seem to move across.

        One that stands does by the turn, one that goes along in it does not.
        """
        ahead_m = self.ahead.position_m
        self.right.move(0.0, (before_rad_s - now_rad_s) * ahead_m)
        change_rad2_s2 = abs(now_rad_s**2 - before_rad_s**2)
        self.right.disturb((GOES_ALONG * ahead_m) ** 2 * change_rad2_s2)

    def follow(self, perspective: Perspective, stamp_s: float) -> None:
        """Predict the state, and move the corners sideways to where it is then."""
        before, _ = perspective.project(self._place)
        self.predict(stamp_s)
        if self.ahead.position_m > 0.0:
            after, _ = perspective.project(self._place)
            self.corners_px = self.corners_px + np.array([after - before, 0.0], np.float32)
            self._cornered = stamp_s, self._place

    def box_at(self, stamp_s: float, perspective: Perspective) -> ImageBox:
        """Return its box in a frame: as found there, or moved and scaled as its place has since."""
        box, (found_at, found) = bounding_box(self.corners_px), self._cornered
        if stamp_s == found_at:
            return box
        scale = found.ahead_m / self._place.ahead_m
        from_px, to_px = perspective.project(found), perspective.project(self._place)
        return ImageBox(
            to_px[0] + scale * (box.x_px - from_px[0]),
            to_px[1] + scale * (box.y_px - from_px[1]),
            scale * box.w_px,
            scale * box.h_px,
        )

    @property
    def _place(self) -> RoadPosition:
        return RoadPosition(self.ahead.position_m, self.right.position_m, 0.0)

    def with_track_format(self, detection: Detection) -> Detection:
        """The detection with the plate width of this track's format."""
        width_m = self._format.width_m
        return detection if width_m is None else detection.with_width(width_m)

    def update(self, detection: Detection, stamp_s: float) -> None:
        """Update the state by a detection in the frame that it was predicted to."""
        detection = self._update_format(detection)
        # An outlier, such as a fragment of the plate, gets a lower weight.
        off_m = abs(detection.position.ahead_m - self.ahead.position_m)
        if detection.kind is self.last.kind:  # another kind's errors repeat, and are no leaps
            in_sigmas = off_m / math.hypot(detection.ahead_sigma_m, self.ahead.position_sigma_m)
            self._inconsistency += INCONSISTENCY_SHARE * (in_sigmas**2 - self._inconsistency)
        self.ahead.update(
            detection.position.ahead_m, max(detection.ahead_sigma_m, off_m / MAX_INNOVATION_SIGMAS)
        )
        self.right.update(detection.position.right_m, detection.right_sigma_m)
        is_ahead = self.ahead.position_m > 0.0  # else the tracker drops it
        if detection.ahead_by_size_m is not None and is_ahead:
            self._sizes += 1
            log_ratio = math.log(self.ahead.position_m / detection.ahead_by_size_m)
            share = max(INCONSISTENCY_SHARE, 1 / self._sizes)
            self._log_size_ratio += share * (log_ratio - self._log_size_ratio)
        if stamp_s > self.detected_at:
            self.detections += 1
        if detection.kind is DetectionKind.VEHICLE:
            self._vehicle_at = stamp_s
            self._vehicles += 1
        if detection.kind is not DetectionKind.VEHICLE or self.last.kind is DetectionKind.VEHICLE:
            self.last = detection
            self.corners_px = detection.corners_px
            self._cornered = stamp_s, self._place
        self.detected_at = self.observed_at = stamp_s
        self._receive_reading(detection, stamp_s)

    def receive_scale_change(
        self, scale_change: ScaleChange, right_slope: float, stamp_s: float
    ) -> None:
        """Update the closing speed by the rear's change of scale since the frame before.

        Args:
            scale_change: of the rear, from `rear_tracked_at` to `stamp_s`.
            right_slope: right of the heading per metre ahead, in this frame.
            stamp_s: of the frame that the state was predicted to.
        """
        seconds = stamp_s - self.rear_tracked_at
        self.rear_tracked_at = stamp_s
        if seconds <= 0:
            return
        ahead_m = self.ahead.position_m
        self.ahead.update_rate(
            -ahead_m * math.log(scale_change.factor) / seconds,
            ahead_m * scale_change.sigma / seconds,
        )
        sigma_m = abs(right_slope) * self.gap_sigma_m
        self.right.update(ahead_m * right_slope, math.hypot(sigma_m, BEARING_SIGMA * ahead_m))
        self.observed_at = stamp_s
        self._cornered = stamp_s, self._place

    def _update_format(self, detection: Detection) -> Detection:
        """Update the format of the plate; returns the detection with its width.

        When the format changes, position and speed are scaled to the new width.
        """
        self._has_only_plates &= detection.kind is DetectionKind.PLATE
        if not detection.positions:
            return detection
        old_width_m = self._format.width_m
        width_m = self._format.add(detection.shape, detection.box.w_px, has_band=detection.has_band)
        if old_width_m is not None and self._has_only_plates:
            self.ahead.scale(width_m / old_width_m)
            self.right.scale(width_m / old_width_m)
            self.last = self.last.with_width(width_m)
        return detection.with_width(width_m)

    def _receive_reading(self, detection: Detection, stamp_s: float) -> None:
        if detection.seen is not None and detection.seen is not self.views:
            detection = detection.unread()  # views of another vehicle took part
        if detection.was_read:
            self.read_at = stamp_s
        if detection.views is not None:
            self.views = detection.views
        self._posteriors[detection.kind].update(detection.candidates, stamp_s, detection.box.w_px)
        if detection.text is None or detection.identity_confidence < MIN_READ_CONFIDENCE:
            return
        self.is_contradicted = detection.text != self.text
