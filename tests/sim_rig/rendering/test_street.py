"""Rendered streets: what the vehicle detector is trained on."""

import numpy as np
import pytest

from onboard.vision.vehicle_network import VehicleKind
from sim_rig.rendering.street.street import Street, StreetLight, random_street

_SIZE = (320, 192)


def _streets(count: int, **options: object) -> list[Street]:
    rng = np.random.default_rng(11)
    return [random_street(_SIZE, rng, **options) for _ in range(count)]  # type: ignore[arg-type]


def test_the_same_seed_draws_the_same_street() -> None:
    one, other = (random_street(_SIZE, np.random.default_rng(4)) for _ in range(2))
    assert (one.image == other.image).all()
    assert one.vehicles == other.vehicles


def test_a_street_without_vehicles_has_none() -> None:
    assert not any(street.vehicles for street in _streets(5, kinds=()))


@pytest.mark.long
@pytest.mark.parametrize("kind", list(VehicleKind))
def test_only_the_kind_that_is_asked_for_is_drawn(kind: VehicleKind) -> None:
    streets = _streets(6, kinds=(kind,))
    vehicles = [vehicle for street in streets for vehicle in street.vehicles]
    assert vehicles
    assert {vehicle.kind for vehicle in vehicles} == {kind}


@pytest.mark.long
def test_boxes_have_a_size_and_stand_before_the_camera() -> None:
    for street in _streets(12):
        for vehicle in street.vehicles:
            left, top, right, bottom = vehicle.box_px
            assert left < right
            assert top < bottom
            assert vehicle.ahead_m > 0
            assert 0 < vehicle.visible <= 1
            if vehicle.end_px is not None:
                assert vehicle.end_px[0] < vehicle.end_px[1]


@pytest.mark.long
def test_night_is_darker_than_day() -> None:
    day, night = (
        np.median([street.image.mean() for street in _streets(8, light=light)])
        for light in (StreetLight.SUN, StreetLight.NIGHT)
    )
    assert night < day
