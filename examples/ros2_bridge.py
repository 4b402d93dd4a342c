"""A ROS 2 node between a detector of your own, `onboard`, and a controller: standard messages only.

    python3 examples/ros2_bridge.py --ros-args -r detections:=/my_detector/detections

It sends each `vision_msgs/Detection3DArray` on `detections` to `detector: {port: 5300}`, and
publishes each request to brake that `brake_request: {udp: {port: 5310}}` sends on `brake` as
`geometry_msgs/AccelStamped`: linear.x negative, 0 at the end. Detections are relative to the
camera, x ahead and y to the left (REP 103); `id` stays the same while a vehicle is tracked. It
needs ROS 2 with vision_msgs 4, and nothing of `onboard`.
"""

import contextlib
import json
import math
import socket
import time
from collections.abc import Sequence
from typing import Any

DETECTOR = ("127.0.0.1", 5300)
BRAKE_REQUESTS = ("127.0.0.1", 5310)
POLLED_EVERY_S = 0.01

RANGE_SIGMA_M = 1.5
BEARING_SIGMA_RAD = 0.02
"""Of detections whose pose has no covariance, or none that can be."""

MOST_RANGE_M = 500.0
MOST_RANGE_SIGMA_M = 100.0
MOST_BEARING_SIGMA_RAD = 1.0

MOST_M_S2 = 20.0
LONGEST_VALID_S = 1.0
"""Of requests to brake; `onboard` asks for no more."""


class VehicleNumbers:
    """Gives each ROS identity a number."""

    def __init__(self) -> None:
        self._numbers: dict[str, int] = {}

    def number(self, identity: str) -> int:
        """The number of an identity, the same each time."""
        return self._numbers.setdefault(identity, len(self._numbers))


def object_list(
    detections: Sequence[Any], numbers: VehicleNumbers, age_s: float, sent_s: float
) -> bytes:
    """Return the datagram for `onboard`: the detections of one image or sweep.

    Args:
        detections: `vision_msgs/Detection3D`s; those without an identity, or whose box contains the
            camera, are left out.
        numbers: of the vehicles.
        age_s: age of the image.
        sent_s: time of sending on a steady clock.
    """
    cars = [_object(each, numbers) for each in detections if each.id and _range_m(each) > 0.0]
    near = [each for each in cars if each["range_m"] <= MOST_RANGE_M]
    return json.dumps({"sent_s": sent_s, "age_s": age_s, "cars": near}).encode()


class BrakeAcceleration:
    """The acceleration that is asked for: 0 once a request is too old, as its sender may hang."""

    def __init__(self) -> None:
        self._acceleration_m_s2 = 0.0
        self._valid_until_s = -math.inf

    def receive_request(self, datagram: bytes, now: float) -> float:
        """Take a datagram of `onboard`, and return the acceleration in m/s^2, not positive.

        Raises:
            ValueError: it is no request.
        """
        try:
            request = json.loads(datagram)
            asked_m_s2, valid_s = float(request["deceleration_m_s2"]), float(request["valid_s"])
        except (KeyError, TypeError, OverflowError, RecursionError):
            asked_m_s2 = valid_s = math.nan
        if not (0.0 <= asked_m_s2 <= MOST_M_S2 and 0.0 <= valid_s <= LONGEST_VALID_S):
            raise ValueError(f"no request to brake: {datagram[:80]!r}")
        self._acceleration_m_s2, self._valid_until_s = -asked_m_s2, now + valid_s
        return self._acceleration_m_s2

    def has_ended(self, now: float) -> bool:
        """Whether a request has just become too old; true once for each."""
        if now <= self._valid_until_s or self._acceleration_m_s2 == 0.0:
            return False
        self._acceleration_m_s2 = 0.0
        return True


def _object(detection: Any, numbers: VehicleNumbers) -> dict[str, float]:
    middle = detection.bbox.center.position
    away_m = math.hypot(middle.x, middle.y)
    along, across = middle.x / away_m, middle.y / away_m
    range_sigma_m, bearing_sigma_rad = RANGE_SIGMA_M, BEARING_SIGMA_RAD
    if detection.results and any(covariance := detection.results[0].pose.covariance):
        # Row by row of x, y, z, and three angles: the upper left 2 x 2 is that of x and y.
        xx, xy, yy = covariance[0], covariance[1], covariance[7]
        along_m2 = xx * along**2 + 2 * xy * along * across + yy * across**2
        across_m2 = xx * across**2 - 2 * xy * along * across + yy * along**2
        if (
            0.0 < along_m2 <= MOST_RANGE_SIGMA_M**2
            and 0.0 < across_m2 <= (away_m * MOST_BEARING_SIGMA_RAD) ** 2
        ):
            range_sigma_m = math.sqrt(along_m2)
            bearing_sigma_rad = math.sqrt(across_m2) / away_m
    return {
        "id": numbers.number(detection.id),
        "range_m": _range_m(detection),
        "range_sigma_m": range_sigma_m,
        "bearing_rad": -math.atan2(middle.y, middle.x),
        "bearing_sigma_rad": bearing_sigma_rad,
    }


def _range_m(detection: Any) -> float:
    """To the side of the box that faces the camera; not positive for a camera inside it."""
    middle, turn = detection.bbox.center.position, detection.bbox.center.orientation
    yaw_rad = 2.0 * math.atan2(turn.z, turn.w)  # a vehicle stands on the road
    away_m = math.hypot(middle.x, middle.y)
    towards_rad = math.atan2(middle.y, middle.x) - yaw_rad
    half_m = [
        size / 2 / abs(part)
        for size, part in (
            (detection.bbox.size.x, math.cos(towards_rad)),
            (detection.bbox.size.y, math.sin(towards_rad)),
        )
        if abs(part) > 1e-9
    ]
    return float(away_m - min(half_m))


def main() -> None:
    """Run the node until it is stopped."""
    import rclpy  # noqa: PLC0415 (the functions above are tested without ROS)
    from geometry_msgs.msg import AccelStamped  # noqa: PLC0415
    from vision_msgs.msg import Detection3DArray  # noqa: PLC0415

    rclpy.init()
    node = rclpy.create_node("onboard_bridge")
    numbers = VehicleNumbers()
    to_onboard = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    from_onboard = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    from_onboard.bind(BRAKE_REQUESTS)
    from_onboard.setblocking(False)
    publisher = node.create_publisher(AccelStamped, "brake", 10)
    brake = BrakeAcceleration()

    def detected(message: Any) -> None:
        taken_s = message.header.stamp.sec + message.header.stamp.nanosec * 1e-9
        age_s = max(0.0, node.get_clock().now().nanoseconds * 1e-9 - taken_s)
        data = object_list(message.detections, numbers, age_s, time.monotonic())
        to_onboard.sendto(data, DETECTOR)

    def publish(acceleration_m_s2: float) -> None:
        message = AccelStamped()
        message.header.stamp = node.get_clock().now().to_msg()
        message.accel.linear.x = acceleration_m_s2
        publisher.publish(message)

    def pass_requests() -> None:
        with contextlib.suppress(BlockingIOError):
            while True:
                datagram = from_onboard.recv(65_536)
                try:
                    publish(brake.receive_request(datagram, time.monotonic()))
                except ValueError as error:
                    node.get_logger().warning(str(error))
        if brake.has_ended(time.monotonic()):
            publish(0.0)

    node.create_subscription(Detection3DArray, "detections", detected, 10)
    node.create_timer(POLLED_EVERY_S, pass_requests)
    rclpy.spin(node)


if __name__ == "__main__":
    main()
