"""What own sensors detect, which becomes direct measurements at the next update."""

from collections import deque
from collections.abc import Callable
from itertools import groupby

from onboard.kinematics.arrays import Array
from onboard.mvs.host_vehicle import HostVehicle
from onboard.observations import Discarded, VehicleDetection
from onboard.tracking.evidence import Measurement, ProvenanceSpans, as_arrays, measurement_id
from onboard.tracking.evidence_store import OWN, EvidenceBatch


class OwnDetections:
    """Detections since the last update; those of one image are assigned together."""

    def __init__(self, host: HostVehicle) -> None:
        """Start without any; `host` places them."""
        self._host = host
        self._detections: deque[VehicleDetection] = deque(maxlen=1024)
        self.stamps_ms: deque[int] = deque(maxlen=512)
        """Times of own measurements, UTC."""

    def receive_detection(self, detection: VehicleDetection) -> None:
        """Keep a detection until the next update."""
        self._detections.append(detection)

    def forget_stamps(self) -> None:
        """Forget when measurements were made, after a correction of UTC."""
        self.stamps_ms.clear()

    def take(
        self, own_id: bytes, now: float, utc_ms: Callable[[float], int]
    ) -> tuple[list[EvidenceBatch], list[Discarded]]:
        """Make direct measurements of the detections.

        Args:
            own_id: temporary ID under which they are known.
            now: the time.
            utc_ms: converts a time to UTC.

        Returns:
            one batch for each image, and what cannot be placed.
        """
        images = groupby(sorted(self._detections, key=_stamp_s), key=_stamp_s)
        batches: list[EvidenceBatch] = []
        refused: list[Discarded] = []
        for stamp_s, detections in images:
            stamp_ms = utc_ms(stamp_s)
            identity = measurement_id(own_id, stamp_ms)
            measured: dict[int, Measurement] = {}
            velocities: dict[int, tuple[Array, Array]] = {}
            for detection in detections:
                if detection.track_id in measured:  # of an image that was sent again
                    continue
                measurement = self._host.measure(detection)
                if isinstance(measurement, str):
                    detail = f"car {detection.track_id} seen"
                    refused.append(Discarded(now, "mvs", measurement, detail))
                    continue
                velocity = self._host.velocity(detection)
                if velocity is not None:
                    velocities[len(measured)] = velocity
                measured[detection.track_id] = Measurement(identity, *measurement)
            if measured:
                n = len(measured)
                self.stamps_ms.append(stamp_ms)
                provenances = [frozenset((identity,))] * n
                batches.append(
                    EvidenceBatch(
                        [OWN] * n,
                        list(measured),
                        provenances,
                        [utc_ms(now)] * n,
                        ProvenanceSpans.of(provenances),
                        [True] * n,
                        as_arrays(list(measured.values())).with_velocities(velocities),
                    )
                )
        self._detections.clear()
        return batches, refused


def _stamp_s(detection: VehicleDetection) -> float:
    return detection.stamp_s
