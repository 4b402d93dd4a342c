"""The plates that `onboard see` prints: each one of images, or each text of a drive."""

from collections.abc import Iterator
from dataclasses import dataclass

from onboard.tools.see.annotated_frame import AnnotatedFrame

MOST_LINES = 20
"""Misread plates make many texts, each in few frames."""


@dataclass(slots=True)
class _Text:
    """What is known of one text."""

    from_s: float
    until_s: float
    confidence: float = 0.0
    least_px: float = float("inf")
    most_px: float = 0.0
    frames: int = 0


class PlatesOfImages:
    """Collects the plates of independent images."""

    def __init__(self) -> None:
        self._sentences: list[str] = []

    def add(self, frame: AnnotatedFrame) -> None:
        """Note the plates of an image."""
        self._sentences += frame.sentences()

    def sentences(self) -> Iterator[str]:
        """A line for each plate, for the terminal."""
        yield from self._sentences


class PlatesOfDrive:
    """Collects the plates of frames, in order of time."""

    def __init__(self) -> None:
        self._texts: dict[str, _Text] = {}

    def add(self, frame: AnnotatedFrame) -> None:
        """Note the plates that were read in a frame."""
        at_s = frame.frame.stamp_s
        for plate in frame.plates:
            if plate.text is None:
                continue
            text = self._texts.setdefault(plate.text, _Text(at_s, at_s))
            text.until_s = at_s
            text.confidence = max(text.confidence, plate.confidence)
            text.least_px = min(text.least_px, plate.box.w_px)
            text.most_px = max(text.most_px, plate.box.w_px)
            text.frames += 1

    def sentences(self) -> Iterator[str]:
        """A line for each text, for the terminal; those of most frames first."""
        texts = sorted(self._texts.items(), key=lambda item: -item[1].frames)
        for text, of in texts[:MOST_LINES]:
            yield (
                f"{text} ({of.confidence:.2f}): frames: {of.frames}, {of.from_s:.1f} to"
                f" {of.until_s:.1f} s, {of.least_px:.0f} to {of.most_px:.0f} px wide"
            )
        if len(texts) > MOST_LINES:
            yield f"{len(texts) - MOST_LINES} more texts, each in fewer frames: --csv has all"
