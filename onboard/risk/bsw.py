"""BSW: blind spot warning (SAE J2945/1), while the turn signal announces a change of lanes."""

from typing import ClassVar

from typing_extensions import override

from onboard.risk.alarm import Cause
from onboard.risk.application import Application, Assessed
from onboard.risk.settings import RiskSettings
from onboard.risk.situation import Situation

BSW = Cause("bsw")
BLIND_SPOT_M = 3.0
"""How far it reaches behind the rear of the host vehicle (ISO 17387)."""


class BlindSpotWarning(Application):
    """Warns of each vehicle that is beside the host vehicle, or just behind it, in that lane."""

    cause: ClassVar[Cause] = BSW

    def __init__(self, _settings: RiskSettings) -> None:
        """Start without vehicles; no setting has a part in it."""
        self._warned_of: set[str] = set()

    @override
    def assess(self, situation: Situation) -> Assessed:
        beside = [
            each.warning
            for each in situation.adjacent_vehicles
            if each.behind_m <= BLIND_SPOT_M
            and each.is_there(was_there=each.warning.vehicle in self._warned_of)
        ]
        self._warned_of = {warning.vehicle for warning in beside}
        return beside
