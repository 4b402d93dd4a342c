"""What the cars of a study's platoon know of their leads: by camera and radio, or assumed."""

from collections.abc import Callable, Mapping
from typing import Literal

import numpy as np
from pydantic import PositiveFloat

from onboard.lcca.events import MeasuredLead
from onboard.messages.lcca import CarId
from onboard.observations import Lead
from onboard.vehicle.lcca_application import LccaApplication
from onboard.vision.settings import VisionSettings
from sim_rig.cars.camera_model import CameraModel, View
from sim_rig.cars.camera_view import FPS, calibration
from sim_rig.cars.derivation_delay import DerivationDelay
from sim_rig.rendering.scene import SceneCar
from sim_rig.scenario.sensor_settings import LensSettings
from sim_rig.studies.lcca.study_lcca import car_id_of

Sight = Literal["unlimited", "recommended", "rig"] | PositiveFloat
"""How a car knows its lead: always; by the camera model with the longest lens of
`docs/plates.md`, or with the rig's own; always up to this distance in m, and never beyond."""
RECOMMENDED_LENS = LensSettings(width_px=1280, focal_px=3300.0)
LENSES: Mapping[str, LensSettings] = {"recommended": RECOMMENDED_LENS, "rig": LensSettings()}


class AssumedSight:
    """The lead is known up to a distance."""

    def __init__(
        self, lcca: LccaApplication, gap_m: float, plate: str, phase_s: float, reach_m: float
    ) -> None:
        """Follow a car at a constant distance.

        Args:
            lcca: of this car.
            gap_m: to the lead.
            plate: of the lead.
            phase_s: time of the first image.
            reach_m: gap beyond which it is not known.
        """
        self._lcca = lcca
        car_id = car_id_of(plate) if gap_m <= reach_m else None
        self._lead = MeasuredLead(car_id, gap_m, 0.0)
        self._image_at = phase_s

    @property
    def lead_id(self) -> CarId | None:
        """The lead's communication ID; `None` while it is not known."""
        return self._lead.car_id

    def get_timer(self) -> float:
        """Return when the next image is due."""
        return self._image_at

    def look(self, now: float) -> None:
        """Take the image that is due, and give the group the lead that it shows."""
        self._image_at = now + 1 / FPS
        self._lcca.group.receive_lead(self._lead, now)


class MeasuredSight:
    """The lead is known by the camera model, the radio, and the cores of the car."""

    def __init__(
        self,
        lcca: LccaApplication,
        view: View,
        lens: LensSettings,
        phase_s: float,
        rng: np.random.Generator,
    ) -> None:
        """See nothing yet.

        Args:
            lcca: of this car.
            view: of its camera.
            lens: of the camera.
            phase_s: time of the first image.
            rng: source of the camera's errors.
        """
        self._lcca = lcca
        self._camera = CameraModel(view, VisionSettings(), phase_s, rng, calibration(lens))
        self._derivation = DerivationDelay()
        self.lead: Lead | None = None
        """What the last image shows."""

    @property
    def lead_id(self) -> CarId | None:
        """The lead's communication ID; `None` while it is not known."""
        identity = self._lcca.identification.identity
        return None if identity is None else identity.car_id

    def get_timer(self) -> float:
        """Return when the next image is due."""
        return self._camera.get_timer()

    def look(self, now: float) -> None:
        """Take the image that is due, and give LCCA the lead that it shows."""
        self._camera.handle_timer(now)
        leads = [each for each in iter(self._camera.next_event, None) if isinstance(each, Lead)]
        self.lead = leads[-1] if leads else None
        if self.lead is not None:
            self._lcca.receive_lead(self._derivation.derived(self.lead, now), now)


class ClearView:
    """A camera's view in images that are neither dark nor frozen."""

    def __init__(self, cars: Callable[[float], list[tuple[str, SceneCar]]]) -> None:
        """`cars` gives those ahead at a time, as `View`."""
        self.cars = cars

    def marked_lane(self, _at_s: float) -> None:
        """Without lines."""

    def is_dark(self, _at_s: float) -> bool:
        """Never."""
        return False

    def is_frozen(self, _at_s: float) -> bool:
        """Never."""
        return False
