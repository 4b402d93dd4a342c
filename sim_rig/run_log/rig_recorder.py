"""Records the rig's side of a run: speed samples on the bus, frames on the air."""

from collections import Counter
from collections.abc import Iterable
from typing import Any

from onboard.obd.can_frame import CanFrame

_SPEED_ANSWER = bytes([0x41, 0x0D])


class RigRecorder:
    """Collects the rig's trace, in the form of a car's trace."""

    def __init__(self, boxes: Iterable[str] = ()) -> None:
        """Keep the frames of `boxes`, whose clocks are measured by them."""
        self.records: list[dict[str, Any]] = []
        self.answers: Counter[str] = Counter()
        """Speeds that the ECU of each car has sent."""
        self.from_box: dict[str, dict[bytes, float]] = {car: {} for car in boxes}
        """When each WSM of a box arrived first, s."""
        self.to_box: dict[str, dict[bytes, float]] = {car: {} for car in boxes}
        """When each WSM was first handed to a box, s."""

    def note_answer(self, car: str, frame: CanFrame) -> None:
        """Record a frame that the ECU of `car` has sent, if it has a speed."""
        if frame.data[1:3] == _SPEED_ANSWER:
            self.answers[car] += 1
            self._note(frame.stamp_s, "ecu_answer", car=car, speed_km_h=frame.data[3])

    def note_on_air(self, car: str, wsm: bytes, user_priority: int, now: float) -> None:
        """Record a frame that a radio unit transmits.

        Args:
            car: name of the sender.
            wsm: the frame.
            user_priority: its user priority.
            now: monotonic time, s.
        """
        if car in self.from_box:
            self.from_box[car].setdefault(wsm, now)
        self._note(now, "on_air", car=car, size_bytes=len(wsm), user_priority=user_priority)

    def note_delivery(
        self, car: str, sender: str, user_priority: int, wsm: bytes, now: float
    ) -> None:
        """Record the arrival of a frame at a radio unit.

        Args:
            car: name of the receiver.
            sender: name of the sender.
            user_priority: user priority of the frame.
            wsm: the frame.
            now: monotonic time, s.
        """
        if car in self.to_box:
            self.to_box[car].setdefault(wsm, now)
        self._note(now, "delivered", car=car, sender=sender, user_priority=user_priority)

    def _note(self, stamp_s: float, kind: str, **fields: object) -> None:
        self.records.append({"stamp_s": stamp_s, "kind": kind, **fields})
