"""Where a lens shows the plates of a scene, and which of them nearer cars hide."""

from onboard.observations import ImageBox
from onboard.vision.settings import Calibration
from sim_rig.rendering.scene import SceneCar

PLATE_WIDTH_M, PLATE_HEIGHT_M = 0.52, 0.11
PLATE_OVER_ROAD_M = 0.6


class CameraProjection:
    """The image coordinates of one lens, for small angles of pitch."""

    def __init__(self, lens: Calibration) -> None:
        self.lens = lens

    def plate_width_px(self, car: SceneCar) -> float:
        """Width of the plate or tag in the image, px."""
        width_m = PLATE_WIDTH_M if car.tag_id is None else car.tag_side_m
        return self.lens.focal_x_px * width_m / car.ahead_m

    def rear_width_px(self, car: SceneCar) -> float:
        """Width of the vehicle's rear in the image, px."""
        return self.lens.focal_x_px * car.width_m / car.ahead_m

    def is_in_image(self, car: SceneCar) -> bool:
        """Whether the whole plate is in the image."""
        inside_u = abs(self._u_px(car)) + self.plate_width_px(car) / 2 < self.lens.width_px / 2
        return inside_u and abs(self._v_px(car)) < self.lens.height_px / 2

    def occludes(self, nearer: SceneCar, car: SceneCar) -> bool:
        """Whether a nearer car occludes the plate of another."""
        half_plate_px = self.plate_width_px(car) / 2
        if not nearer.is_turned:
            half_px = self.rear_width_px(nearer) / 2 + half_plate_px
            return abs(self._u_px(nearer) - self._u_px(car)) < half_px
        corners = nearer.corners()
        if min(ahead for ahead, _ in corners) <= 0.0:
            return False
        u_px = [self.lens.focal_x_px * right / ahead for ahead, right in corners]
        return min(u_px) - half_plate_px < self._u_px(car) < max(u_px) + half_plate_px

    def box(self, car: SceneCar) -> ImageBox:
        """The plate or tag in the image."""
        width_px = self.plate_width_px(car)
        is_tag = car.tag_id is not None
        height_px = width_px if is_tag else width_px * PLATE_HEIGHT_M / PLATE_WIDTH_M
        left_px = self.lens.principal_x_px + self._u_px(car) - width_px / 2
        top_px = self.lens.principal_y_px + self._v_px(car) - height_px / 2
        return ImageBox(left_px, top_px, width_px, height_px)

    def _u_px(self, car: SceneCar) -> float:
        """Horizontal position of the plate, right of the image centre, px."""
        return self.lens.focal_x_px * car.lateral_m / car.ahead_m

    def _v_px(self, car: SceneCar) -> float:
        """Vertical position of the plate, below the image centre, px."""
        drop_m = self.lens.mounting_height_m - PLATE_OVER_ROAD_M
        return self.lens.focal_y_px * (drop_m / car.ahead_m - self.lens.pitch_rad)
