"""Frames of what was recorded: a video, or pictures in a folder.

They are read as fast as they are asked for, and their stamps count from 0.
"""

import re
from collections.abc import Iterator
from itertools import takewhile
from pathlib import Path

import cv2
import numpy as np

from onboard.vision.frames import NO_IMAGE, CameraError, Frame, decode_picture

DEFAULT_FPS = 25.0
LONGEST_PAUSE_S = 60.0
"""Between two frames of a video whose times are believed."""
PICTURES = {".jpg", ".jpeg", ".png", ".bmp", ".webp", ".tif", ".tiff", ".ppm", ".pgm"}


def open_recording(source: str, fps: float | None) -> "Pictures | Clip":
    """The pictures in a folder or fitting a glob, or a video; `fps` overrules what it states.

    Raises:
        CameraError: it is neither, or not there.
    """
    if pictures := _picture_files(source):
        return Pictures(pictures, fps or DEFAULT_FPS)
    if not Path(source).is_file():
        raise CameraError(f"camera.source: {source}: {_why_nothing(source)}")
    return Clip(source, fps)


class Pictures:
    """Picture files as one drive."""

    live = False

    def __init__(self, files: list[tuple[str, Path]], fps: float) -> None:
        """`files`: name and path of each, in order."""
        self._files = files
        self.stated_frames = len(files)
        self.fps = fps
        self._closed = False

    def __iter__(self) -> Iterator[Frame]:
        for index, (name, path) in enumerate(self._files):
            if self._closed:
                return
            try:
                image = decode_picture(path.read_bytes())
            except OSError:
                image = NO_IMAGE
            yield Frame(index / self.fps, image, name)

    def close(self) -> None:
        """End the iteration."""
        self._closed = True


class Clip:
    """A video file; its frames stand when the file says, or evenly where it cannot be believed."""

    live = False
    even_from: int | None = None
    """The first frame whose time the file does not tell, or tells wrongly, once one was met."""

    def __init__(self, source: str, fps: float | None) -> None:
        """Open `source`; `fps` overrules what it states, and lets frames stand evenly.

        Raises:
            CameraError: it is no video.
        """
        self._name = Path(source).name
        self._capture = cv2.VideoCapture(source)
        if not self._capture.isOpened():
            raise CameraError(f"camera.source: {source}: not a video that can be read")
        self.stated_frames = max(0, int(self._capture.get(cv2.CAP_PROP_FRAME_COUNT)))
        """About how many there are, as the file says; 0 where it does not."""
        stated = self._capture.get(cv2.CAP_PROP_FPS)
        self.fps = fps or (stated if 1.0 <= stated <= 1000.0 else DEFAULT_FPS)
        self._stands_evenly = fps is not None
        self._closed = False

    def __iter__(self) -> Iterator[Frame]:
        index, stamp_s, first_s = 0, 0.0, 0.0
        while not self._closed:
            read, image = self._capture.read()
            if not read:
                break
            told_s = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1000.0  # of the frame just read
            if index == 0:
                first_s = told_s
            else:
                stamp_s = self._stamp_s(index, told_s - first_s, stamp_s)
            yield Frame(stamp_s, np.asarray(image, np.uint8), self._name)
            index += 1
        self._capture.release()

    def _stamp_s(self, index: int, told_s: float, last_s: float) -> float:
        """When a frame stands, by what the file tells and when the last one stood."""
        if self._stands_evenly:
            return index / self.fps
        if self.even_from is None:
            if last_s < told_s < last_s + LONGEST_PAUSE_S:
                return told_s
            self.even_from = index
        return last_s + 1.0 / self.fps

    def close(self) -> None:
        """End the iteration."""
        self._closed = True


def _picture_files(source: str) -> list[tuple[str, Path]]:
    """(name, path) of the pictures in a folder or fitting a glob, 2 before 10; else none."""
    path = Path(source)
    if path.is_file():
        return [(path.name, path)] if path.suffix.lower() in PICTURES else []
    if path.is_dir():
        base, pattern = path, "**/*"
    else:
        fixed = list(takewhile(lambda part: not set(part) & set("*?["), path.parts))
        if len(fixed) == len(path.parts):
            return []
        base, pattern = Path(*fixed), str(Path(*path.parts[len(fixed) :]))
    files = [file for file in base.glob(pattern) if file.suffix.lower() in PICTURES]
    named = [(file.relative_to(base).as_posix(), file) for file in files if file.is_file()]
    return sorted(named, key=lambda item: _natural(item[0]))


def _why_nothing(source: str) -> str:
    """Why neither a picture nor a video is there."""
    allowed = f"a picture's name ends in {', '.join(sorted(PICTURES))}"
    if Path(source).is_dir():
        return f"no picture in this folder; {allowed}"
    if set(source) & set("*?["):
        return f"no picture fits; {allowed}"
    return "no such file or folder"


def _natural(name: str) -> list[tuple[int, str]]:
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)]
