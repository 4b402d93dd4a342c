"""Accuracy of the tracks of cars without a radio: MVS compared with other fusion methods.

Every half second, for each car with a radio and each car without one that it tracks, the error of
MVS is recorded, and the errors that other methods have with the same evidence. The lower limit is a
centralised filter that receives every measurement of every car without loss.
"""

from collections import defaultdict
from dataclasses import dataclass, field

import numpy as np

from onboard.kinematics.arrays import Array
from onboard.mvs.settings import MvsSettings, SensingSettings
from onboard.tracking.evidence import Measurement, observer_of
from onboard.tracking.tracks import TrackingParameters
from sim_rig.roads.cars import Cars
from sim_rig.studies.mvs.methods import covariance_intersection, use_all
from sim_rig.studies.mvs.roads import SixLaneRoad, states_of
from sim_rig.studies.mvs.world import ORIGIN, START_UTC_S, MvsWorld
from sim_rig.studies.mvs.world_settings import WorldSettings

CENTRALISED, MVS, NAIVE, INTERSECTION, OWN = "centralised", "mvs", "naive", "intersection", "own"
Q = 1.0
"""Density of the acceleration noise, m^2/s^3."""
MEMORY_MS = 4000
"""The centralised filter ignores older measurements."""
FRESH_MS = 1000
"""A car counts as present if it was measured within this time."""
FARTHEST_MATCH_M = 3.0
CONFIRMED_BY = 3
"""Own measurements that confirm a track from own sensing alone."""
INSIDE_95 = 9.488
"""The 95 % quantile of chi^2 with 4 degrees of freedom."""

Estimated = tuple[Array, Array]
"""State (4,) and covariance (4, 4)."""


@dataclass(slots=True)
class Errors:
    """Squared errors of one method, an entry for each track of each car at each comparison."""

    position_m2: list[float] = field(default_factory=list)
    speed_m2_s2: list[float] = field(default_factory=list)
    nees: list[float] = field(default_factory=list)
    """e' P^-1 e: 4 on average if P is consistent."""

    def add(self, error: Array, covariance: Array) -> None:
        """Add an error (4,) with its reported covariance (4, 4)."""
        self.position_m2.append(float(error[:2] @ error[:2]))
        self.speed_m2_s2.append(float(error[2:] @ error[2:]))
        self.nees.append(float(error @ np.linalg.solve(covariance, error)))

    @property
    def position_rmse_m(self) -> float:
        """Root of the mean square error of the position."""
        return float(np.sqrt(np.mean(self.position_m2)))

    @property
    def speed_rmse_m_s(self) -> float:
        """Root of the mean square error of the velocity."""
        return float(np.sqrt(np.mean(self.speed_m2_s2)))

    @property
    def mean_nees(self) -> float:
        """Mean NEES; above 4 the covariances are too small."""
        return float(np.mean(self.nees))

    @property
    def inside_95(self) -> float:
        """Share of the errors inside their 95 % ellipsoid."""
        return float(np.mean(np.array(self.nees) <= INSIDE_95))


@dataclass(slots=True)
class Accuracy:
    """Errors by method, and counts of tracks."""

    errors: dict[str, Errors] = field(default_factory=lambda: defaultdict(Errors))
    centralised_of_own: Errors = field(default_factory=Errors)
    """The centralised filter for the cars that own sensors detect: the limit of `own`."""
    matched: int = 0
    present: int = 0
    """Cars without a radio that any car measured in the last second, once for each car in reach."""
    wrong: int = 0
    """Tracks that match no car without a radio, or one that is matched already."""


MODELLED = MvsSettings(
    sensing=SensingSettings(
        face_to_centre_m=0.0, face_to_centre_sigma_m=0.0, heading_sigma_rad=0.001
    ),
)
"""Sensors have no mounting error."""

TRACKING = TrackingParameters(acceleration_density=Q)
"""The filter's motion model is the true one along the lane; across it, cars do not move."""


def accuracy(
    mvs: MvsSettings,
    radio: float,
    loss: float,
    seed: int,
    *,
    seconds: float = 4.0,
    road: type[SixLaneRoad] = SixLaneRoad,
) -> Accuracy:
    """Run the road and compare all methods twice a second.

    Args:
        mvs: settings of every car's MVS core.
        radio: share of the cars with a radio, 0 to 1.
        loss: share of the messages that are lost, 0 to 1.
        seed: of traffic, radios and noise.
        seconds: length of the evaluated time.
        road: how the cars move.
    """
    rng = np.random.default_rng(seed)
    traffic = road(7, 25.0, seconds + 2.0, Q, rng)
    n = len(traffic.names)
    equipped = {traffic.names[i] for i in rng.permutation(n)[: round(radio * n)]}
    world = MvsWorld(
        traffic,
        equipped,
        WorldSettings(loss=loss),
        mvs,
        seed,
        tracking=TRACKING,
        records_measurements=True,
    )
    result = Accuracy()
    measured: dict[str, list[Measurement]] = defaultdict(list)
    for tick in range(round((seconds + 1.5) * 10)):
        world.tick()
        for made in world.measurements:
            measured[made.car].append(made.measurement)
        if tick >= 15 and tick % 5 == 0:
            _compare(world, measured, result)
    return result


def _compare(world: MvsWorld, measured: dict[str, list[Measurement]], result: Accuracy) -> None:
    """Compare the tracks of every car with a radio at this time."""
    now_ms = _now_ms(world)
    cars = world.traffic.cars_at(world.now)
    limits = _limits(world, measured, now_ms)
    fresh = [car for car in limits if now_ms - measured[car][-1].stamp_ms <= FRESH_MS]
    for own in world.cars:
        here = cars.middle_m[cars.names.index(own)]
        in_reach = np.hypot(*(cars.middle_m - here).T) < world.settings.reach_m
        present = {car: limits[car] for car in fresh if in_reach[cars.names.index(car)]}
        result.present += len(present)
        _compare_tracks(world, own, cars, present, result)


def _limits(
    world: MvsWorld, measured: dict[str, list[Measurement]], now_ms: int
) -> dict[str, Estimated]:
    """The centralised estimate of each car without a radio that was measured recently."""
    limits: dict[str, Estimated] = {}
    for car, measurements in measured.items():
        recent = [made for made in measurements if now_ms - made.stamp_ms <= MEMORY_MS]
        if recent and car not in world.equipped:
            limits[car] = use_all(recent, now_ms, Q)
    return limits


def _compare_tracks(
    world: MvsWorld, own: str, cars: Cars, limits: dict[str, Estimated], result: Accuracy
) -> None:
    """Match the tracks of the car `own` with the cars in `limits`, and add their errors."""
    now_ms, own_id = _now_ms(world), world.own_id(own)
    states = states_of(cars)
    to_world = ORIGIN.mapping_from(world.frame_of(own))
    matched: set[str] = set()
    core = world.cars[own].sharing.mvs
    core.update(world.now)
    for track in core.reported_tracks():
        mvs = use_all([piece.mapped(*to_world) for piece in track.used], now_ms, Q)
        away_m = np.hypot(*(states[:, :2] - mvs[0][:2]).T)
        nearest = int(away_m.argmin())
        car, true = cars.names[nearest], states[nearest]
        if away_m[nearest] > FARTHEST_MATCH_M or car not in limits or car in matched:
            result.wrong += 1
            continue
        matched.add(car)
        evidence = [piece.mapped(*to_world) for piece in track.pieces]
        by_method = {
            CENTRALISED: limits[car],
            MVS: mvs,
            NAIVE: use_all(evidence, now_ms, Q),
            INTERSECTION: covariance_intersection(evidence, now_ms, Q),
        }
        seen = [
            piece
            for piece in evidence
            if isinstance(piece, Measurement) and observer_of(piece.id) == own_id
        ]
        if len(seen) >= CONFIRMED_BY:
            by_method[OWN] = use_all(seen, now_ms, Q)
            result.centralised_of_own.add(limits[car][0] - true, limits[car][1])
        for method, (state, covariance) in by_method.items():
            result.errors[method].add(state - true, covariance)
    result.matched += len(matched)


def _now_ms(world: MvsWorld) -> int:
    return round((world.now + START_UTC_S) * 1000)
