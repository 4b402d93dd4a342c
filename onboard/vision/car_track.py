"""One car ahead, followed from frame to frame."""

import math

from onboard.vision.identity import LEAST_READ_CONFIDENCE, PlateVote
from onboard.vision.motion import FrameMotion
from onboard.vision.plate_formats import CarsKind, PlateKinds
from onboard.vision.plate_observation import Cue, Sighting
from onboard.vision.rear import Growth

MOST_OFF = 3.0
"""Sigmas that a sighting may be off; one that is farther off is taken to be that much worse."""
CONFIRM_SIGHTINGS = 3
"""Fewer may be a trick of the light."""
BEARING_SIGMA = 0.003
"""In rad, of where the middle of a rear is."""
SIZE_SIGMA = {Cue.TAG: 0.02, Cue.PLATE: 0.06, Cue.VEHICLE: 0.1}
"""What no averaging removes: how far sizes are from nominal, and where the detector places the
edges of one plate. Those of photographed ones scatter by 6 % about their labels."""


class CarTrack:
    """A car: where it is, how it moves, what its plate says."""

    def __init__(
        self,
        track_id: int,
        first: Sighting,
        stamp_s: float,
        identity_confidence: float,
        kinds: PlateKinds,
    ) -> None:
        self.track_id = track_id
        self._kind = CarsKind(kinds)
        self._has_only_plates = first.cue is Cue.PLATE
        first = self._of_its_kind(first)
        self.seen_at = stamp_s
        """When it was last sighted."""
        self.present_at = stamp_s
        """When it was last sighted, or its rear was still there."""
        self.looked_at = stamp_s
        """When it was last looked for."""
        self.read_at = stamp_s
        """When it was last tried what text it carries."""
        self.is_doubted = False
        """Whether its text last read as something else than it is known by."""
        self.sightings = 1
        self.last = first
        """The latest plate or tag, else the latest vehicle."""
        self.corners_px = first.corners_px
        """Where that is now."""
        self.ahead = FrameMotion(
            first.place.ahead_m,
            first.ahead_sigma_m,
            stamp_s,
            rate_sigma_m_s=8.0,
            acceleration_sigma_m_s2=3.0,
        )
        self.right = FrameMotion(
            first.place.right_m,
            first.right_sigma_m,
            stamp_s,
            rate_sigma_m_s=1.5,
            acceleration_sigma_m_s2=1.0,
        )
        self.followed_at = stamp_s
        """Up to when its rear was followed."""
        self._identity_confidence = identity_confidence
        self._plate = PlateVote(identity_confidence)
        self._tag = PlateVote(identity_confidence)
        self._vote(first, stamp_s)

    @property
    def confirmed(self) -> bool:
        """Whether it was sighted often enough to be a car."""
        return self.sightings >= CONFIRM_SIGHTINGS

    @property
    def text(self) -> str | None:
        """Its identity: the tag's, which cannot be misread, before the plate's."""
        return self._tag.text or self._plate.text

    def text_of(self, sighting: Sighting) -> tuple[str | None, float]:
        """What the plate of a sighting of this car says, and how sure that is by all its frames.

        A read that is not certain gives way to what the plate is known by; a certain one is as
        certain as the other frames leave it.
        """
        if sighting.cue is not Cue.PLATE:
            return sighting.text, sighting.confidence
        known = self._plate.text
        if known is not None and sighting.identity_confidence < self._identity_confidence:
            return known, self._plate.share(known)
        if sighting.text is None:
            return None, 0.0
        return sighting.text, min(sighting.confidence, self._plate.share(sighting.text))

    @property
    def gap_sigma_m(self) -> float:
        """Of the gap: the filter's and what nominal sizes leave open."""
        return math.hypot(
            self.ahead.position_sigma_m, SIZE_SIGMA[self.last.cue] * self.ahead.position_m
        )

    @property
    def size_sigma(self) -> float:
        """Of the gap, as a share of it: which kind of plate it is may be open."""
        return self._kind.sigma if self._has_only_plates else 0.0

    def predict(self, stamp_s: float) -> None:
        """Go on to the time of the next frame."""
        self.ahead.predict(stamp_s)
        self.right.predict(stamp_s)

    def if_of_its_kind(self, sighting: Sighting) -> Sighting:
        """A sighting, if its plate is of the kind that this car's is taken to be."""
        width_m = self._kind.width_m
        return sighting if width_m is None else sighting.if_wide(width_m)

    def update(self, sighting: Sighting, stamp_s: float) -> None:
        """Take in a sighting of this car in the frame that it was predicted to."""
        sighting = self._of_its_kind(sighting)
        # What is far off, such as a piece of the plate, counts for less.
        off_m = abs(sighting.place.ahead_m - self.ahead.position_m)
        self.ahead.update(sighting.place.ahead_m, max(sighting.ahead_sigma_m, off_m / MOST_OFF))
        self.right.update(sighting.place.right_m, sighting.right_sigma_m)
        if stamp_s > self.seen_at:
            self.sightings += 1
        if sighting.cue is not Cue.VEHICLE or self.last.cue is Cue.VEHICLE:
            self.last = sighting
            self.corners_px = sighting.corners_px
        self.seen_at = self.present_at = stamp_s
        self._vote(sighting, stamp_s)

    def receive_growth(self, growth: Growth, right_slope: float, stamp_s: float) -> None:
        """Take in how its rear grew since the frame before, up to `stamp_s`.

        Args:
            growth: of the rear.
            right_slope: how far right of the heading it is now, a metre ahead.
            stamp_s: of the frame that it was predicted to.
        """
        seconds = stamp_s - self.followed_at
        self.followed_at = stamp_s
        if seconds <= 0:
            return
        ahead_m = self.ahead.position_m
        self.ahead.update_rate(
            -ahead_m * math.log(growth.factor) / seconds, ahead_m * growth.sigma / seconds
        )
        sigma_m = abs(right_slope) * self.gap_sigma_m
        self.right.update(ahead_m * right_slope, math.hypot(sigma_m, BEARING_SIGMA * ahead_m))
        self.present_at = stamp_s

    def _of_its_kind(self, sighting: Sighting) -> Sighting:
        """The sighting, once it has had its say about the kind of this car's plate.

        If that is another than was taken, the car is and always was that much nearer or farther.
        """
        self._has_only_plates &= sighting.cue is Cue.PLATE
        if not sighting.places:
            return sighting
        taken_m = self._kind.width_m
        width_m = self._kind.add(sighting.shape, sighting.box.w_px, has_band=sighting.has_band)
        if taken_m is not None and self._has_only_plates:
            self.ahead.scale(width_m / taken_m)
            self.right.scale(width_m / taken_m)
            self.last = self.last.if_wide(width_m)
        return sighting.if_wide(width_m)

    def _vote(self, sighting: Sighting, stamp_s: float) -> None:
        if sighting.was_read:
            self.read_at = stamp_s
        if sighting.text is None or sighting.identity_confidence < LEAST_READ_CONFIDENCE:
            return
        self.is_doubted = sighting.text != self.text
        ballot = self._tag if sighting.cue is Cue.TAG else self._plate
        ballot.vote(
            sighting.text, sighting.identity_confidence, sighting.character_confidences, stamp_s
        )
