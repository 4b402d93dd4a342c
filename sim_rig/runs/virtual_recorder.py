"""The black box of a car in virtual time, which writes synchronously."""

from pathlib import Path

from onboard.recorder.header import RecordingHeader
from onboard.recorder.records import RecordedMessage
from onboard.recorder.segments import Segments
from onboard.recorder.settings import RecorderSettings


class VirtualRecorder:
    """Records one drive as one segment, or one after each start."""

    def __init__(self, folder: Path) -> None:
        """Write into `folder`, which is created."""
        folder.mkdir(parents=True, exist_ok=True)
        self.settings = RecorderSettings(folder=folder, segment_s=3600.0)
        self._segments: Segments | None = None

    def begin(self, header: RecordingHeader) -> None:
        """See `onboard.recorder.black_box.BlackBox`; an earlier drive ends here."""
        if self._segments is not None:
            self._segments.close(header.now_s)
        self._segments = Segments(self.settings, header)
        self._segments.open(header.now_s, header.utc_s)

    def record(self, record: RecordedMessage) -> None:
        """See `onboard.recorder.black_box.BlackBox`."""
        assert self._segments is not None  # noqa: S101 (`begin` comes first)
        self._segments.write(record)

    def close(self, now: float) -> None:
        """Finish the file."""
        assert self._segments is not None  # noqa: S101 (`begin` comes first)
        self._segments.close(now)
