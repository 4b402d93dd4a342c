"""The networks that perception runs, loaded from their files."""

from onboard.vision.box_model import BoxModel
from onboard.vision.external_plate_detector import ExternalPlateDetector
from onboard.vision.parameters import DEFAULT_PARAMETERS, PerceptionParameters
from onboard.vision.perception import Perception
from onboard.vision.plate_detector import PlateDetector
from onboard.vision.plate_reader import PlateReader
from onboard.vision.plates import PlateFinder
from onboard.vision.settings import Calibration, VisionSettings
from onboard.vision.sized_camera import Networks
from onboard.vision.syntax import PlateSyntax
from onboard.vision.vehicle_finder import VehicleFinder


def load_perception(
    calibration: Calibration | None,
    settings: VisionSettings,
    parameters: PerceptionParameters = DEFAULT_PARAMETERS,
) -> Perception:
    """Build a perception with the networks that `settings` name.

    Args:
        calibration: of the camera; `None` assumes a lens of 60 degrees, and distances are rough.
        settings: what to detect.
        parameters: periods and timeouts.

    Raises:
        UserError: a model of the user is missing, or does not run.
    """
    return Perception(calibration, settings, load_networks(settings), parameters)


def load_networks(settings: VisionSettings) -> Networks:
    """Load the networks that `settings` name.

    Raises:
        UserError: a model of the user is missing, or does not run.
    """
    return Networks(
        plate_finder=_plate_finder(settings) if settings.plates else None,
        plate_reader=PlateReader(syntax=PlateSyntax(settings.plate_patterns))
        if settings.plates
        else None,
        vehicle_model=_vehicle_model(settings),
    )


def _vehicle_model(settings: VisionSettings) -> VehicleFinder | BoxModel | None:
    if settings.vehicle_model is not None:
        return BoxModel(settings.vehicle_model, "vision.vehicle_model")
    return VehicleFinder() if settings.detects_vehicles else None


def _plate_finder(settings: VisionSettings) -> PlateFinder:
    shipped = PlateDetector()
    if settings.plate_model is None:
        return shipped
    return ExternalPlateDetector(BoxModel(settings.plate_model, "vision.plate_model"), shipped)
