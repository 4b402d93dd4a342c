"""Remote vehicles by CAMs: the same values that BSMs give, so that no core knows the message set.

A CAM's position is the middle of the front, a BSM's that of the vehicle. A path point of a CAM is
an offset from the point before it, one of a BSM from the vehicle. Signs of what turns differ.
"""

import math
from collections.abc import Iterator, Mapping
from functools import lru_cache

from onboard.its_g5.its_timestamp import nearest_utc_s, timestamp_ms
from onboard.kinematics.geodesy import point_ahead_deg
from onboard.messages.bsm import BasicSafetyMessage
from onboard.messages.bsm_core import (
    ALL_WHEELS,
    AccelerationSet,
    BrakeSystemStatus,
    CoreData,
    PositionalAccuracy,
    VehicleSize,
    WheelBrakes,
)
from onboard.messages.bsm_safety import (
    MAX_OFFSET_DEG,
    ExteriorLights,
    PathHistory,
    PathHistoryPoint,
    VehicleEventFlags,
    VehicleSafetyExtensions,
)
from onboard.messages.cam import (
    NO_LIGHTS,
    VEHICLE,
    Acceleration,
    AccelerationControl,
    BasicContainer,
    Cam,
    CamLights,
    CamParameters,
    HighFrequency,
    LowFrequency,
    ReportedCurvature,
    ReportedYawRate,
    VehicleLength,
)
from onboard.messages.fields import Chosen
from onboard.messages.its_common import (
    MAX_DELTA_DEG,
    PASSENGER_CAR,
    Altitude,
    ConfidenceEllipse,
    DeltaPosition,
    PathPoint,
    ReferencePosition,
    ReportedHeading,
    ReportedSpeed,
)

ELLIPSE_SIGMAS = math.sqrt(-2.0 * math.log(1.0 - 0.95))
"""Axes of the ellipse in which a normally distributed position is with 95 %, in sigma: 2.45."""
PERIOD_MS = 1 << 16
"""Of `generationDeltaTime`."""
_LIGHTS: Mapping[ExteriorLights, CamLights] = {
    ExteriorLights.LOW_BEAM: CamLights.LOW_BEAM,
    ExteriorLights.HIGH_BEAM: CamLights.HIGH_BEAM,
    ExteriorLights.LEFT_TURN_SIGNAL: CamLights.LEFT_TURN_SIGNAL,
    ExteriorLights.RIGHT_TURN_SIGNAL: CamLights.RIGHT_TURN_SIGNAL,
    ExteriorLights.HAZARD_SIGNAL: CamLights.LEFT_TURN_SIGNAL | CamLights.RIGHT_TURN_SIGNAL,
    ExteriorLights.DAYTIME_RUNNING: CamLights.DAYTIME_RUNNING,
    ExteriorLights.FOG_LIGHT: CamLights.FOG_LIGHT,
    ExteriorLights.PARKING_LIGHTS: CamLights.PARKING_LIGHTS,
}
_PEDAL = AccelerationControl(0), AccelerationControl.BRAKE_PEDAL
"""Released, and pressed."""
_HAZARD = _LIGHTS[ExteriorLights.HAZARD_SIGNAL]


def cam_of(bsm: BasicSafetyMessage, utc_s: float, *, low_frequency: bool) -> Cam:
    """Return the CAM that says what a BSM says.

    Args:
        bsm: of the host vehicle.
        utc_s: the present time, seconds since 1970.
        low_frequency: whether it has the low frequency container.
    """
    core = bsm.core
    age_s = 0.0 if core.sec_mark_s is None else (utc_s - core.sec_mark_s + 30.0) % 60.0 - 30.0
    position = _reference_position(core)
    low = Chosen(VEHICLE, _low_frequency(bsm, position)) if low_frequency else None
    return Cam(
        core.temporary_id,
        timestamp_ms(utc_s - age_s) % PERIOD_MS / 1e3,
        CamParameters(
            BasicContainer(PASSENGER_CAR, position),
            Chosen(VEHICLE, _high_frequency(bsm)),
            low,
        ),
    )


def bsm_of(cam: Cam, utc_s: float) -> BasicSafetyMessage | None:
    """Return the BSM that says what a CAM says of a vehicle; `None` if its sender is none.

    Args:
        cam: as received.
        utc_s: the present time, seconds since 1970.
    """
    parameters = cam.parameters
    high, low = parameters.high_frequency.value, parameters.low_frequency
    if not isinstance(high, HighFrequency):
        return None
    position = parameters.basic.position
    centre = _centre(position, high)
    ellipse = position.ellipse
    generated_s = nearest_utc_s(round(cam.generation_delta_time_s * 1e3), PERIOD_MS, utc_s)
    control = high.acceleration_control
    core = CoreData(
        msg_cnt=0,
        temporary_id=cam.station_id,
        sec_mark_s=round(generated_s * 1e3) % 60_000 / 1e3,
        latitude_deg=None if centre is None else centre[0],
        longitude_deg=None if centre is None else centre[1],
        elevation_m=position.altitude.altitude_m,
        accuracy=PositionalAccuracy(
            _divided(ellipse.semi_major_m, ELLIPSE_SIGMAS),
            _divided(ellipse.semi_minor_m, ELLIPSE_SIGMAS),
            ellipse.orientation_rad,
        ),
        speed_m_s=high.speed.speed_m_s,
        heading_rad=high.heading.heading_rad,
        acceleration=AccelerationSet(
            high.longitudinal.acceleration_m_s2,
            _divided(None if high.lateral is None else high.lateral.acceleration_m_s2, -1.0),
            yaw_rate_rad_s=_divided(high.yaw_rate.yaw_rate_rad_s, -1.0) or 0.0,
        ),
        brakes=BrakeSystemStatus() if control is None else BrakeSystemStatus(_wheels(control)),
        size=VehicleSize(high.width_m, high.length.length_m),
    )
    is_emergency = control is not None and AccelerationControl.EMERGENCY_BRAKE in control
    events = VehicleEventFlags.HARD_BRAKING if is_emergency else None
    history, lights = None, None
    if low is not None and isinstance(low.value, LowFrequency):
        if centre is not None:
            ahead_deg = _front_deg(position, centre)
            history = path_history_of(low.value.path, ahead_deg)
        lights = _lights_of(low.value.lights)
    safety = VehicleSafetyExtensions(events, history, None, lights)
    return BasicSafetyMessage(core, safety)


def _reference_position(core: CoreData) -> ReferencePosition:
    if core.latitude_deg is None or core.longitude_deg is None:
        return ReferencePosition()
    front = core.latitude_deg, core.longitude_deg
    if core.heading_rad is not None and core.size.length_m is not None:
        front = point_ahead_deg(*front, core.heading_rad, core.size.length_m / 2.0)
    accuracy = core.accuracy
    ellipse = ConfidenceEllipse(
        _divided(accuracy.semi_major_m, 1.0 / ELLIPSE_SIGMAS),
        _divided(accuracy.semi_minor_m, 1.0 / ELLIPSE_SIGMAS),
        accuracy.orientation_rad,
    )
    return ReferencePosition(*front, ellipse, Altitude(core.elevation_m))


def _high_frequency(bsm: BasicSafetyMessage) -> HighFrequency:
    core, safety = bsm.core, bsm.safety
    wheels = core.brakes.wheel_brakes
    control = None if WheelBrakes.UNAVAILABLE in wheels else _PEDAL[bool(wheels)]
    if safety is not None and (safety.events or 0) & VehicleEventFlags.HARD_BRAKING:
        control = AccelerationControl.BRAKE_PEDAL
    lateral_m_s2 = core.acceleration.lateral_m_s2
    return HighFrequency(
        heading=ReportedHeading(core.heading_rad),
        speed=ReportedSpeed(core.speed_m_s),
        length=VehicleLength(core.size.length_m),
        width_m=core.size.width_m,
        longitudinal=Acceleration(core.acceleration.longitudinal_m_s2),
        curvature=ReportedCurvature(_curvature_per_m(safety)),
        yaw_rate=ReportedYawRate(-core.acceleration.yaw_rate_rad_s),
        acceleration_control=control,
        lateral=None if lateral_m_s2 is None else Acceleration(-lateral_m_s2),
    )


def _low_frequency(bsm: BasicSafetyMessage, front: ReferencePosition) -> LowFrequency:
    if bsm.safety is None:
        return LowFrequency()
    lights = NO_LIGHTS if bsm.safety.lights is None else _cam_lights(bsm.safety.lights)
    start = front.latitude_deg or 0.0, front.longitude_deg or 0.0
    return LowFrequency(lights=lights, path=tuple(path_of(bsm, start)))


@lru_cache(maxsize=1 << 9)
def _cam_lights(lights: ExteriorLights) -> CamLights:
    found = NO_LIGHTS
    for one, other in _LIGHTS.items():
        if one in lights:
            found |= other
    return found


def path_of(
    bsm: BasicSafetyMessage, start: tuple[float, float] | None = None
) -> Iterator[PathPoint]:
    """Yield the points of a path history, each from the one before it, the first from `start`.

    The path ends where two are too far apart for the fields.

    Args:
        bsm: of the host vehicle.
        start: latitude and longitude; by default the vehicle's.
    """
    core, history = bsm.core, bsm.safety.path_history if bsm.safety is not None else None
    if history is None or core.latitude_deg is None or core.longitude_deg is None:
        return
    before, age_s = start or (core.latitude_deg, core.longitude_deg), 0.0
    for point in history.crumb_data:
        if point.latitude_offset_deg is None or point.longitude_offset_deg is None:
            return
        here = (
            core.latitude_deg + point.latitude_offset_deg,
            core.longitude_deg + point.longitude_offset_deg,
        )
        north_deg = here[0] - before[0]
        east_deg = math.remainder(here[1] - before[1], 360.0)
        if max(abs(north_deg), abs(east_deg)) > MAX_DELTA_DEG:
            return
        elapsed_s = None if point.age_s is None else max(0.01, point.age_s - age_s)
        yield PathPoint(DeltaPosition(north_deg, east_deg), elapsed_s)
        before, age_s = here, point.age_s or age_s


def path_history_of(
    path: tuple[PathPoint, ...], start_deg: tuple[float, float]
) -> PathHistory | None:
    """Return the points as offsets from the vehicle, up to the first unknown or distant one.

    Args:
        path: as received.
        start_deg: offset of the point that the first one is relative to, north and east.
    """
    north_deg, east_deg = start_deg
    age_s: float | None = 0.0
    points: list[PathHistoryPoint] = []
    for point in path:
        step = point.position
        if step.latitude_deg is None or step.longitude_deg is None:
            break
        north_deg, east_deg = north_deg + step.latitude_deg, east_deg + step.longitude_deg
        if max(abs(north_deg), abs(east_deg)) > MAX_OFFSET_DEG:
            break
        age_s = None if age_s is None or point.elapsed_s is None else age_s + point.elapsed_s
        points.append(PathHistoryPoint(north_deg, east_deg, None, age_s))
    return PathHistory(None, None, tuple(points)) if points else None


def _front_deg(front: ReferencePosition, centre: tuple[float, float]) -> tuple[float, float]:
    """Return the offset of the front from the middle, north and east, in degrees."""
    north_deg = (front.latitude_deg or 0.0) - centre[0]
    return north_deg, math.remainder((front.longitude_deg or 0.0) - centre[1], 360.0)


def _centre(front: ReferencePosition, high: HighFrequency) -> tuple[float, float] | None:
    """Return latitude and longitude of the middle of a vehicle; `None` if they are not known."""
    if front.latitude_deg is None or front.longitude_deg is None:
        return None
    place = front.latitude_deg, front.longitude_deg
    heading_rad, length_m = high.heading.heading_rad, high.length.length_m
    if heading_rad is None or length_m is None:
        return place
    return point_ahead_deg(*place, heading_rad, -length_m / 2.0)


@lru_cache(maxsize=1 << 8)
def _lights_of(lights: CamLights) -> ExteriorLights | None:
    found = ExteriorLights(0)
    for one, other in _LIGHTS.items():
        is_half = other is not _HAZARD and other & _HAZARD and _HAZARD in lights
        if other in lights and not is_half:
            found |= one
    return found or None


def _curvature_per_m(safety: VehicleSafetyExtensions | None) -> float | None:
    if safety is None or safety.path_prediction is None:
        return None
    radius_m = safety.path_prediction.radius_of_curve_m
    return 0.0 if not radius_m else -1.0 / radius_m


def _wheels(control: AccelerationControl) -> WheelBrakes:
    return ALL_WHEELS if AccelerationControl.BRAKE_PEDAL in control else WheelBrakes(0)


def _divided(value: float | None, by: float) -> float | None:
    return None if value is None else value / by
