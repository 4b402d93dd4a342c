"""Frames of recordings: a video, or images in a folder.

They are read as fast as they are consumed, and their stamps count from 0.
"""

import re
from collections.abc import Iterator
from itertools import takewhile
from pathlib import Path

import cv2
import numpy as np

from onboard.vision.frames import NO_IMAGE, CameraError, Frame, decode_image

DEFAULT_FPS = 25.0
LONGEST_PAUSE_S = 60.0
"""Longest plausible pause between the stamps of two frames of a video."""
IMAGE_SUFFIXES = {".jpg", ".jpeg", ".png", ".bmp", ".webp", ".tif", ".tiff", ".ppm", ".pgm"}


def open_recording(source: str, fps: float | None) -> "ImageSequence | VideoFile":
    """Open the images in a folder or of a glob, or a video; `fps` overrides the stated rate.

    Raises:
        CameraError: it is neither, or does not exist.
    """
    if images := _image_files(source):
        return ImageSequence(images, fps or DEFAULT_FPS)
    if not Path(source).is_file():
        raise CameraError(f"camera.source: {source}: {_why_nothing(source)}")
    return VideoFile(source, fps)


class ImageSequence:
    """Image files as one drive."""

    live = False

    def __init__(self, files: list[tuple[str, Path]], fps: float) -> None:
        """Take the name and path of each image, in order."""
        self._files = files
        self.stated_frames = len(files)
        self.fps = fps
        self._closed = False

    def __iter__(self) -> Iterator[Frame]:
        for index, (name, path) in enumerate(self._files):
            if self._closed:
                return
            try:
                image = decode_image(path.read_bytes())
            except OSError:
                image = NO_IMAGE
            yield Frame(index / self.fps, image, name)

    def close(self) -> None:
        """End the iteration."""
        self._closed = True


class VideoFile:
    """A video file, with its own stamps, or evenly spaced ones where those are implausible."""

    live = False
    even_from: int | None = None
    """The first frame with a missing or implausible stamp, once one was met."""

    def __init__(self, source: str, fps: float | None) -> None:
        """Open `source`; `fps` overrides the stated rate, and frames are evenly spaced.

        Raises:
            CameraError: it is no video.
        """
        self._name = Path(source).name
        self._capture = cv2.VideoCapture(source)
        if not self._capture.isOpened():
            raise CameraError(f"camera.source: {source}: not a video that can be read")
        self.stated_frames = max(0, int(self._capture.get(cv2.CAP_PROP_FRAME_COUNT)))
        """Approximate number of frames, as stated in the file; 0 if it is not."""
        stated = self._capture.get(cv2.CAP_PROP_FPS)
        self.fps = fps or (stated if 1.0 <= stated <= 1000.0 else DEFAULT_FPS)
        self._is_even = fps is not None
        self._closed = False

    def __iter__(self) -> Iterator[Frame]:
        index, stamp_s, first_s = 0, 0.0, 0.0
        while not self._closed:
            read, image = self._capture.read()
            if not read:
                break
            stated_s = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1000.0  # of the frame just read
            if index == 0:
                first_s = stated_s
            else:
                stamp_s = self._stamp_s(index, stated_s - first_s, stamp_s)
            yield Frame(stamp_s, np.asarray(image, np.uint8), self._name)
            index += 1
        self._capture.release()

    def _stamp_s(self, index: int, stated_s: float, last_s: float) -> float:
        """Stamp of a frame, by the stated one and the stamp of the frame before."""
        if self._is_even:
            return index / self.fps
        if self.even_from is None:
            if last_s < stated_s < last_s + LONGEST_PAUSE_S:
                return stated_s
            self.even_from = index
        return last_s + 1.0 / self.fps

    def close(self) -> None:
        """End the iteration."""
        self._closed = True


def _image_files(source: str) -> list[tuple[str, Path]]:
    """Name and path of the images in a folder or of a glob, 2 before 10; else empty."""
    path = Path(source)
    if path.is_file():
        return [(path.name, path)] if path.suffix.lower() in IMAGE_SUFFIXES else []
    if path.is_dir():
        base, pattern = path, "**/*"
    else:
        fixed = list(takewhile(lambda part: not set(part) & set("*?["), path.parts))
        if len(fixed) == len(path.parts):
            return []
        base, pattern = Path(*fixed), str(Path(*path.parts[len(fixed) :]))
    files = [file for file in base.glob(pattern) if file.suffix.lower() in IMAGE_SUFFIXES]
    named = [(file.relative_to(base).as_posix(), file) for file in files if file.is_file()]
    return sorted(named, key=lambda item: _natural(item[0]))


def _why_nothing(source: str) -> str:
    """Reason why there is neither an image nor a video."""
    allowed = f"an image's name ends in {', '.join(sorted(IMAGE_SUFFIXES))}"
    if Path(source).is_dir():
        return f"no image in this folder; {allowed}"
    if set(source) & set("*?["):
        return f"no image matches; {allowed}"
    return "no such file or folder"


def _natural(name: str) -> list[tuple[int, str]]:
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)]
