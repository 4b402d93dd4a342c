"""What is around one vehicle, ten times a second: from the tracks to the alarms."""

from collections.abc import Callable, Generator, Sequence

from onboard.intersections.intersections import Intersections
from onboard.lcca.identification import Identification
from onboard.misbehaviour.alarm_claims import AlarmClaims
from onboard.mvs.multi_vehicle_sensing import MultiVehicleSensing
from onboard.tracking.perceived_object import PerceivedObject, remote_offsets_m
from onboard.vehicle.risk_response import RiskResponse

ASSESSMENT_INTERVAL_S = 0.1
"""Period of the risk assessment: that of BSMs."""

OBJECTS_AT_ONCE = 32
"""With more perceived objects, the risk is assessed in slices."""

REPORT_INTERVAL_S = 1.0
"""Period at which host vehicle and perceived objects are put out as events."""


class Surroundings:
    """Gives the alarms, the intersections and the identification where the vehicles are."""

    def __init__(
        self,
        mvs: MultiVehicleSensing,
        intersections: Intersections,
        claims: AlarmClaims | None,
        risk: RiskResponse,
        identification: Identification,
        *,
        signer_of: Callable[[bytes], bytes | None],
        now: float,
    ) -> None:
        """Assess first at `now`.

        Args:
            mvs: has the vehicles.
            intersections: know which signals are red for whom.
            claims: leave out the vehicles that only ignored signers claim; `None`: none.
            risk: is assessed.
            identification: compares the lead with the vehicles that send BSMs.
            signer_of: the sender of a remote vehicle's BSMs, by its remote ID; `None`: not known.
            now: the present time.
        """
        self._mvs = mvs
        self._intersections = intersections
        self._claims = claims
        self._risk = risk
        self._identification = identification
        self._signer_of = signer_of
        self._assess_at = self._next_at = self._report_at = now
        self._slices: Generator[None, None, Sequence[PerceivedObject]] | None = None
        """What is left of an assessment that has begun."""
        self.host_vehicle: PerceivedObject | None = None
        """At the last assessment; `None` without a position."""
        self.objects: list[PerceivedObject] = []
        """All others, at the last assessment."""

    def get_timer(self) -> float:
        """Return when the next assessment is due."""
        return self._assess_at

    def assess(self, now: float) -> Sequence[PerceivedObject]:
        """Do the next slice of the update of the tracks or, after it, of the assessment of risk.

        The timer stays due until the risk is assessed, with many objects in several slices,
        all by the places at the first one.

        Returns:
            Those to report now: the host vehicle and the others, or none.
        """
        if self._next_at <= self._assess_at:
            self._next_at = now + ASSESSMENT_INTERVAL_S
        try:
            if self._slices is None:
                if not self._mvs.update_slice(now):
                    return ()
                self._slices = self._assess_in_slices(now)
            next(self._slices)
            while len(self.objects) <= OBJECTS_AT_ONCE:
                next(self._slices)
        except StopIteration as end:
            self._slices, self._assess_at = None, self._next_at
            to_report: Sequence[PerceivedObject] = end.value
            return to_report
        except Exception:  # a defect: until the next assessment all else has its turns
            self._slices, self._assess_at = None, self._next_at
            raise
        return ()

    def _assess_in_slices(self, now: float) -> Generator[None, None, Sequence[PerceivedObject]]:
        mvs = self._mvs
        # All in one frame, which the next position may change.
        frame, heading, sensed = mvs.frame, mvs.heading(now), mvs.sensed_objects(now)
        host_vehicle = mvs.host_vehicle(now)
        objects = yield from mvs.kinematic_info_in_slices(now)
        self.host_vehicle, self.objects = host_vehicle, objects
        self._intersections.receive_host_vehicle(host_vehicle, frame, now)
        yield
        alarming = objects
        if self._claims is not None:
            alarming = self._claims.alarming(objects, now)
            yield
        yield from self._risk.assess_in_slices(
            host_vehicle,
            alarming,
            now,
            heading=heading,
            sensed=sensed,
            signals=self._intersections,
        )
        yield
        offsets_m = (
            {}
            if host_vehicle is None or heading is None
            else remote_offsets_m(host_vehicle, objects, heading.heading_rad)
        )
        self._identification.receive_offsets(
            {
                sender: offset_m
                for remote_id, offset_m in offsets_m.items()
                if (sender := self._signer_of(remote_id)) is not None
            }
        )
        return self._to_report(now)

    def _to_report(self, now: float) -> Sequence[PerceivedObject]:
        if now < self._report_at:
            return ()
        self._report_at = now + REPORT_INTERVAL_S
        return () if self.host_vehicle is None else (self.host_vehicle, *self.objects)
