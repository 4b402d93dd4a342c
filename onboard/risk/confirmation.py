"""A level counts when measurements have shown it for a while."""

from onboard.risk.alarm import Level


class Confirmation:
    """The level of one vehicle."""

    def __init__(self, confirm_s: float) -> None:
        """Confirm a level when it, or a higher one, has lasted for `confirm_s`."""
        self._confirm_s = confirm_s
        self._since_s: dict[Level, float] = {}

    def receive_level(self, level: Level, stamp_s: float) -> Level:
        """Take an assessment; returns the highest confirmed level.

        Args:
            level: assessed.
            stamp_s: time of the measurement that it rests on; the same measurement, assessed
                again, confirms nothing.
        """
        for each in (Level.CAUTION, Level.WARNING):
            if level.rank >= each.rank:
                self._since_s.setdefault(each, stamp_s)
            else:
                self._since_s.pop(each, None)
        return max(
            (at for at, since_s in self._since_s.items() if stamp_s - since_s >= self._confirm_s),
            key=lambda at: at.rank,
            default=Level.NONE,
        )
