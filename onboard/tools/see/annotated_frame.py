"""One frame and the events of perception: the rows and images of `onboard see`."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from onboard.observations import Discarded, ImageBox, Lead, LeadIdentity, Plate, PlateCandidate
from onboard.vision.frames import Frame
from onboard.vision.perception import Perception
from onboard.vision.seen import Event

COLUMNS = (
    "file",
    "frame",
    "stamp_s",
    "x_px",
    "y_px",
    "w_px",
    "h_px",
    "text",
    "confidence",
    "is_lead",
    "lead",
    "gap_m",
    "closing_speed_m_s",
    "candidates",
)
"""Columns of the CSV: a row for each plate in each frame, and one for a lead without a plate or a
frame without any. `lead` is the answer on the lead; the columns after it are the lead's."""
DRAWN_CANDIDATES, MIN_DRAWN = 3, 0.01
"""Candidates in the caption of a frame, and the probability from which they are drawn."""

_LEAD_BGR, _OTHER_BGR = (60, 220, 60), (60, 160, 255)
_FONT, _LEAST_SCALE, _SCALE_1_ROWS, _MARGIN_PX = cv2.FONT_HERSHEY_SIMPLEX, 0.4, 900, 12


@dataclass(frozen=True, slots=True, eq=False)
class AnnotatedFrame:
    """A frame with the events that perception gave for it."""

    index: int
    frame: Frame
    events: tuple[Event, ...]
    vehicles: tuple[ImageBox, ...] | None = None
    """Where vehicles are; `None` in an independent image, where no frame before tells them from
    what looks like a plate."""

    @property
    def plates(self) -> list[Plate]:
        """All plates and tags in the frame."""
        return [event for event in self.events if isinstance(event, Plate)]

    @property
    def lead(self) -> Lead | None:
        """The lead's state; `None` if the frame was discarded."""
        return next((event for event in self.events if isinstance(event, Lead)), None)

    @property
    def is_frozen(self) -> bool:
        """Whether it was skipped as a repeat of a frozen camera."""
        return self.lead is None and not self._faults

    @property
    def _faults(self) -> list[str]:
        return [event.reason for event in self.events if isinstance(event, Discarded)]

    def rows(self) -> Iterator[tuple[str | int, ...]]:
        """Rows of the CSV, values as text in the order of `COLUMNS`."""
        lead = self.lead
        for plate in self.plates:
            what = (plate.text or "", f"{plate.confidence:.3f}", int(plate.is_lead))
            yield self._row(plate.box, what, lead if plate.is_lead else None)
        if lead is None or any(plate.is_lead for plate in self.plates):
            return
        if lead.gap_m is not None or not self.plates:
            yield self._row(lead.box, ("", "", int(lead.gap_m is not None)), lead)

    def sentences(self) -> Iterator[str]:
        """A line for each plate, for the terminal."""
        for plate in self.plates:
            box = plate.box
            what = "not read" if plate.text is None else f"{plate.text} ({plate.confidence:.2f})"
            place = f"{box.w_px:.0f} px wide at {box.x_px:.0f}, {box.y_px:.0f}"
            yield f"{self.frame.name}: {what}, {place}"
        if not self.plates:
            yield f"{self.frame.name}: no plate found"

    def _row(
        self, box: ImageBox | None, what: tuple[str, str, int], of_lead: Lead | None
    ) -> tuple[str | int, ...]:
        """One row: of a plate's text, confidence and `is_lead`, or of the lead alone."""
        sides = (None,) * 4 if box is None else (box.x_px, box.y_px, box.w_px, box.h_px)
        return (
            self.frame.name,
            self.index,
            f"{self.frame.stamp_s:.3f}",
            *("" if side is None else f"{side:.1f}" for side in sides),
            *what,
            "" if self.lead is None else self.lead.identity,
            _metres(of_lead.gap_m if of_lead else None),
            _metres(of_lead.closing_speed_m_s if of_lead else None),
            _candidates(of_lead.candidates if of_lead else ()),
        )

    def annotated(self) -> npt.NDArray[np.uint8]:
        """The image with boxes around vehicles and their plates, and the lead's state below.

        Plates that are on no vehicle are not drawn: they may be anything.
        """
        image = self.frame.image.copy()
        if image.size == 0:
            return image
        for box in self.vehicles or ():
            _draw(image, box, _OTHER_BGR)
        lead = self.lead
        if lead is not None and lead.box is not None:
            _draw(image, lead.box, _LEAD_BGR)
        for plate in self.plates:
            if self.vehicles is not None and plate.box not in self.vehicles:
                continue
            colour = _LEAD_BGR if plate.is_lead else _OTHER_BGR
            _draw(image, plate.box, colour)
            if plate.text is not None:
                label = f"{plate.text} {plate.confidence:.2f}"
                _write(image, label, (round(plate.box.x_px), round(plate.box.y_px) - 6), colour)
        at = _MARGIN_PX, image.shape[0] - _MARGIN_PX
        _write(image, self.caption, at, _LEAD_BGR, image.shape[1] - 2 * _MARGIN_PX)
        return image

    @property
    def caption(self) -> str:
        """The answer on the lead, in words."""
        lead = self.lead
        if lead is None:
            return f"{self.frame.stamp_s:.1f} s  skipped: {', '.join(self._faults) or 'frozen'}"
        caption = f"{self.frame.stamp_s:.1f} s  "
        if lead.gap_m is None:
            is_free = lead.identity is LeadIdentity.NO_LEAD
            return caption + ("the lane is free" if is_free else "no lead found")
        caption += f"{lead.text or 'plate unknown'}  {lead.gap_m:.1f} m"
        caption += f"  closing {lead.closing_speed_m_s:+.1f} m/s"
        likely = [each for each in lead.candidates if each.probability >= MIN_DRAWN]
        return f"{caption}  {_candidates(likely[:DRAWN_CANDIDATES])}".rstrip()


def annotate_frames(
    frames: Iterable[Frame], perception: Perception, *, alone: bool = False
) -> Iterator[AnnotatedFrame]:
    """Run `perception` on a recording.

    Args:
        frames: in order of time.
        perception: gets each frame.
        alone: resets `perception` before each frame, as for unrelated images.
    """
    for index, frame in enumerate(frames):
        if alone:
            perception.reset()
        perception.receive_frame(frame.image, frame.stamp_s)
        events: list[Event] = []
        while (event := perception.next_event()) is not None:
            events.append(event)
        yield AnnotatedFrame(index, frame, tuple(events), None if alone else perception.vehicles)


def _candidates(candidates: Iterable[PlateCandidate]) -> str:
    return " ".join(f"{each.text}:{each.probability:.3f}" for each in candidates)


def _metres(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"


def _draw(image: npt.NDArray[np.uint8], box: ImageBox, bgr: tuple[int, int, int]) -> None:
    opposite = (round(box.x_px + box.w_px), round(box.y_px + box.h_px))
    cv2.rectangle(image, (round(box.x_px), round(box.y_px)), opposite, bgr, 2)


def _write(
    image: npt.NDArray[np.uint8],
    text: str,
    at: tuple[int, int],
    bgr: tuple[int, int, int],
    most_px: float = math.inf,
) -> None:
    """Letters with a dark outline, as large as the image's height asks, and at most so wide."""
    scale = max(_LEAST_SCALE, image.shape[0] / _SCALE_1_ROWS)
    width_px = cv2.getTextSize(text, _FONT, scale, 1)[0][0]
    scale *= min(1.0, max(most_px, 1.0) / width_px)
    for colour, thickness in (((0, 0, 0), 4), (bgr, 1)):
        cv2.putText(image, text, at, _FONT, scale, colour, thickness, cv2.LINE_AA)
