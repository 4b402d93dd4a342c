"""What the rig notes of its own doing, for the ledger: samples on the bus, frames on the air."""

from typing import Any

from onboard.obd.can_frame import CanFrame

_SPEED_ANSWER = bytes([0x41, 0x0D])


class RigRecorder:
    """Collects the rig's own trace, which looks like a car's."""

    def __init__(self) -> None:
        self.records: list[dict[str, Any]] = []

    def note_answer(self, car: str, frame: CanFrame) -> None:
        """The ECU of `car` has put a frame on its bus; speeds are noted."""
        if frame.data[1:3] == _SPEED_ANSWER:
            self._note(frame.stamp_s, "ecu_answer", car=car, speed_km_h=frame.data[3])

    def note_on_air(self, car: str, wsm: bytes, user_priority: int, now: float) -> None:
        """The unit of `car` transmits."""
        self._note(now, "on_air", car=car, size_bytes=len(wsm), user_priority=user_priority)

    def note_delivery(self, car: str, sender: str, user_priority: int, now: float) -> None:
        """A copy has arrived at a unit."""
        self._note(now, "delivered", car=car, sender=sender, user_priority=user_priority)

    def _note(self, stamp_s: float, kind: str, **fields: object) -> None:
        self.records.append({"stamp_s": stamp_s, "kind": kind, **fields})
