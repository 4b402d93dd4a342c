"""The own lane on the road ahead of the camera."""


class OwnLane:
    """Middle and width of the lane that the car drives in; straight ahead unless told otherwise."""

    def __init__(self, width_m: float) -> None:
        self.width_m = width_m

    def middle_m(self, ahead_m: float) -> float:  # noqa: ARG002 (a straight lane, for now)
        """How far right of the camera's heading the middle of the lane is, `ahead_m` away."""
        return 0.0
