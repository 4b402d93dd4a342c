"""LCW: lane change warning (SAE J2945/1): a vehicle comes up in the lane that is signalled to."""

from typing import ClassVar

from typing_extensions import override

from onboard.risk.alarm import Cause
from onboard.risk.application import Application, Assessed
from onboard.risk.bsw import BLIND_SPOT_M
from onboard.risk.settings import RiskSettings
from onboard.risk.situation import Situation

LCW = Cause("lcw")
CLOSING_S = 3.5
"""Time in which a vehicle behind reaches the rear of the host vehicle, at its present speed, from
which on it is warned of: that of ISO 17387 for the largest closing speeds, 20 m/s."""


class LaneChangeWarning(Application):
    """Warns of each vehicle that is soon where the host vehicle is about to drive."""

    cause: ClassVar[Cause] = LCW

    def __init__(self, settings: RiskSettings) -> None:
        """Start; no setting has a part in it."""

    @override
    def assess(self, situation: Situation) -> Assessed:
        return [
            each.warning
            for each in situation.adjacent_vehicles
            if BLIND_SPOT_M < each.behind_m <= CLOSING_S * each.closing_speed_m_s
            and each.is_there()
        ]
