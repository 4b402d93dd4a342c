"""What is around one vehicle, ten times a second: from the tracks to the alarms."""

from collections.abc import Callable, Sequence

from onboard.intersections.intersections import Intersections
from onboard.lcca.identification import Identification
from onboard.misbehaviour.alarm_claims import AlarmClaims
from onboard.mvs.multi_vehicle_sensing import MultiVehicleSensing
from onboard.tracking.perceived_object import PerceivedObject, remote_offsets_m
from onboard.vehicle.risk_response import RiskResponse

ASSESSMENT_INTERVAL_S = 0.1
"""Period of the risk assessment: that of BSMs."""

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
        self.host_vehicle: PerceivedObject | None = None
        """At the last assessment; `None` without a position."""
        self.objects: list[PerceivedObject] = []
        """All others, at the last assessment."""

    def get_timer(self) -> float:
        """Return when the next assessment is due."""
        return self._assess_at

    def assess(self, now: float) -> Sequence[PerceivedObject]:
        """Do the next slice: of the update of the tracks, or the assessment of the risk after it.

        The timer stays due until the risk is assessed.

        Returns:
            Those to report now: the host vehicle and the others, or none.
        """
        if self._next_at <= self._assess_at:
            self._next_at = now + ASSESSMENT_INTERVAL_S
        mvs = self._mvs
        if not mvs.update_slice(now):
            return ()
        self._assess_at = self._next_at
        self.host_vehicle, self.objects = mvs.host_vehicle(now), mvs.kinematic_info(now)
        self._intersections.receive_host_vehicle(self.host_vehicle, mvs.frame, now)
        alarming = self.objects
        if self._claims is not None:
            alarming = self._claims.alarming(self.objects, now)
        heading = mvs.heading(now)
        self._risk.assess(
            self.host_vehicle,
            alarming,
            now,
            heading=heading,
            sensed=mvs.sensed_objects(now),
            signals=self._intersections,
        )
        offsets_m = (
            {}
            if self.host_vehicle is None or heading is None
            else remote_offsets_m(self.host_vehicle, self.objects, heading.heading_rad)
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
