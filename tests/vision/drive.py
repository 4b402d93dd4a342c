"""Rendered drives, and the events of perception on them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from onboard.observations import (
    Discarded,
    Lead,
    Plate,
    SensorLost,
    SensorRecovered,
    VehicleDetection,
)
from onboard.vision.perception import Perception
from onboard.vision.seen import Event
from onboard.vision.settings import CameraSettings, VisionSettings
from sim_rig.rendering.scene import CameraRenderer, Scene

CAMERA = CameraSettings(
    source="rendered",
    width_px=960,
    height_px=540,
    focal_x_px=825.0,
    focal_y_px=825.0,
    principal_x_px=480.0,
    principal_y_px=270.0,
    mounting_height_m=1.3,
    pitch_rad=0.02,
)
RENDERER = CameraRenderer(CAMERA)
TAGS = VisionSettings(plates=False)
FPS = 10.0


@dataclass
class Observed:
    """Events of one drive."""

    events: list[Event] = field(default_factory=list)

    @property
    def leads(self) -> list[Lead]:
        return [event for event in self.events if isinstance(event, Lead)]

    @property
    def plates(self) -> list[Plate]:
        return [event for event in self.events if isinstance(event, Plate)]

    @property
    def cars(self) -> list[VehicleDetection]:
        return [event for event in self.events if isinstance(event, VehicleDetection)]

    @property
    def discarded(self) -> list[Discarded]:
        return [event for event in self.events if isinstance(event, Discarded)]

    @property
    def health(self) -> list[SensorLost | SensorRecovered]:
        return [event for event in self.events if isinstance(event, SensorLost | SensorRecovered)]


def frames(
    scene_at: Callable[[float], Scene],
    duration_s: float,
    *,
    fps: float = FPS,
    camera: CameraSettings = CAMERA,
    seed: int = 1,
) -> Iterator[tuple[float, npt.NDArray[np.uint8]]]:
    """Yield stamp and image of each frame of a drive."""
    renderer = RENDERER if camera is CAMERA else CameraRenderer(camera)
    rng = np.random.default_rng(seed)
    for index in range(round(duration_s * fps)):
        yield index / fps, renderer.draw(scene_at(index / fps), rng)


def observe(
    perception: Perception, drive: Iterator[tuple[float, npt.NDArray[np.uint8]]]
) -> Observed:
    """Collect the events of `perception` on a drive."""
    observed = Observed()
    for stamp_s, image in drive:
        perception.receive_frame(image, stamp_s)
        while (event := perception.next_event()) is not None:
            observed.events.append(event)
    return observed
