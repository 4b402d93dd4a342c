"""Images of 3840x2160 px: searched at half the size, located at full size."""

import numpy as np
import pytest
from typing_extensions import override

from onboard.observations import ImageBox
from onboard.vision.detection import DetectionKind, SearchPlan
from onboard.vision.perspective import Perspective
from onboard.vision.plate_detector import Image, PlateDetection, PlateDetector
from onboard.vision.plate_formats import PlateFormats
from onboard.vision.plate_reader import PlateReader
from onboard.vision.plates import PlateRecognizer
from onboard.vision.settings import CameraSettings
from onboard.vision.syntax import PlateSyntax
from onboard.vision.tags import TagDetector
from sim_rig.rendering.scene import CameraRenderer, Scene, SceneCar

CAMERA = CameraSettings(
    source="rendered",
    width_px=3840,
    height_px=2160,
    focal_x_px=3300.0,
    focal_y_px=3300.0,
    principal_x_px=1920.0,
    principal_y_px=1080.0,
)
PERSPECTIVE = Perspective(CAMERA)
TAG_SIDE_M = 0.3


class WatchedFinder(PlateDetector):
    """Remembers how large the images were in which it searched."""

    def __init__(self) -> None:
        super().__init__()
        self.widths_px: list[int] = []

    @override
    def find(self, image: Image, region: ImageBox | None = None) -> list[PlateDetection]:
        self.widths_px.append(image.shape[1])
        return super().find(image, region)


def picture(car: SceneCar) -> Image:
    return CameraRenderer(CAMERA).draw(Scene((car,)), np.random.default_rng(1))


@pytest.mark.long
def test_plates_are_found_in_less_of_a_large_image_and_placed_in_all_of_it() -> None:
    image, finder = picture(SceneCar(14.0, plate="GN417KB")), WatchedFinder()
    plates = PlateRecognizer(finder, PlateReader(), PlateSyntax(()), PERSPECTIVE, PlateFormats())

    (fast,) = plates.find(image, SearchPlan(finds_vehicles=True))
    (slow,) = plates.find(image, SearchPlan())

    assert finder.widths_px == [1920, 3840]
    assert fast.text == slow.text == "GN417KB"
    assert fast.position.ahead_m == pytest.approx(slow.position.ahead_m, rel=0.005)


@pytest.mark.long
@pytest.mark.parametrize("gap_m", [6.0, 14.0, 30.0])
def test_tags_are_located_as_well_in_a_large_image(gap_m: float) -> None:
    image = picture(SceneCar(gap_m, plate=None, tag_id=3, tag_side_m=TAG_SIDE_M))

    (tag,) = TagDetector("4X4_50", TAG_SIDE_M, PERSPECTIVE).find(image, SearchPlan())

    assert (tag.kind, tag.text) == (DetectionKind.TAG, "TAG3")
    assert tag.position.ahead_m == pytest.approx(gap_m, rel=0.01)
