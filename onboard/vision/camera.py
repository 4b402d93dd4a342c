"""Opens the source of frames that the settings name."""

from onboard.vision.frames import CameraError
from onboard.vision.live_frames import LiveFrames, device_frames, mjpeg_frames
from onboard.vision.recordings import ImageSequence, VideoFile, open_recording
from onboard.vision.settings import CameraSettings

FrameSource = ImageSequence | VideoFile | LiveFrames
"""Iterable over `Frame` in order of time, until its end or `close`. Where `live`, stamps are
`time.monotonic()`; otherwise they count from 0."""


def open_frames(settings: CameraSettings) -> FrameSource:
    """Open the source that the settings name.

    Raises:
        CameraError: it is missing, or is of no known kind.
    """
    source = settings.source
    if not settings.is_live:
        return open_recording(source, settings.fps)
    if "://" not in source:
        return device_frames(settings)
    if source.startswith(("http://", "https://")):
        return mjpeg_frames(source)
    raise CameraError(f"camera.source: {source}: the only streams are MJPEG by http:// or https://")


def open_recorded(settings: CameraSettings) -> ImageSequence | VideoFile:
    """Open a recorded source, which has an end.

    Raises:
        CameraError: it cannot be opened, or is live.
    """
    frames = open_frames(settings)
    if isinstance(frames, LiveFrames):
        raise CameraError(f"{settings.source}: a live camera has no end; record it first")
    return frames
