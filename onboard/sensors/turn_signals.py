"""The turn signals that are on, from lamps that blink."""

from onboard.observations import Side, TurnSignal

BLINK_PERIOD_S = 1.0
"""A turn signal counts as on for this time after its lamp was: UNECE R48 asks for 60 to 120 flashes
a minute."""


class TurnSignals:
    """Those of the host vehicle."""

    def __init__(self) -> None:
        self._on_at: dict[Side, float] = {}

    def receive_turn_signal(self, turn_signal: TurnSignal) -> None:
        """Take the state of one side."""
        if turn_signal.is_on:
            self._on_at[turn_signal.side] = turn_signal.stamp_s

    def on(self, now: float) -> frozenset[Side]:
        """Return the sides that are on; both are the hazard signal."""
        return frozenset(side for side, at_s in self._on_at.items() if now - at_s <= BLINK_PERIOD_S)
