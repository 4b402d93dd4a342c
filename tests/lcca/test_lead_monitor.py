"""Too close, far enough, and who it is."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.lcca.events import PrecedingVehicle
from onboard.lcca.lead_monitor import LeadMonitor
from onboard.lcca.settings import LccaSettings
from onboard.settings import SettingsError, parse_settings

A, B = b"car-aaaa", b"car-bbbb"


def lookout(speed_m_s: float = 20.0, **changes: float) -> LeadMonitor:
    out = LeadMonitor(LccaSettings(**{"identity_dwell_s": 0.0, **changes}))  # type: ignore[arg-type]
    out.receive_speed(speed_m_s, 0.0)
    return out


@given(st.floats(1.0, 200.0))
def test_the_safety_distance_is_0_55_m_for_each_km_h(speed_km_h: float) -> None:
    look = lookout(speed_km_h / 3.6)
    look.receive_preceding_vehicle(PrecedingVehicle(A, 0.55 * speed_km_h * 0.999, 0.0), 0.0)
    assert look.to_join(0.0) == A
    look.receive_preceding_vehicle(PrecedingVehicle(A, 0.55 * speed_km_h * 1.001, 0.0), 0.0)
    assert look.to_join(0.0) is None


def test_a_standing_car_keeps_any_distance() -> None:
    look = lookout(0.0)
    look.receive_preceding_vehicle(PrecedingVehicle(A, 0.5, 0.0), 0.0)
    assert look.to_join(0.0) is None


def test_between_the_two_headways_nothing_is_joined_and_nothing_left() -> None:
    look = lookout(20.0)
    look.receive_preceding_vehicle(PrecedingVehicle(A, 2.1 * 20.0, 0.0), 0.5)
    assert look.to_join(0.5) is None
    assert look.close_at(A) == 0.5
    look.receive_preceding_vehicle(PrecedingVehicle(A, 2.2 * 20.0, 0.0), 0.6)
    assert look.close_at(A) == 0.5


def test_without_a_fresh_speed_no_car_is_too_close() -> None:
    look = lookout(20.0, speed_hold_s=1.0)
    look.receive_preceding_vehicle(PrecedingVehicle(A, 10.0, 0.0), 1.0)
    assert look.to_join(1.0) is None
    assert look.speed_at(1.0) is None
    assert look.close_at(A) < 0.0


def test_a_plate_must_be_read_the_same_for_a_while() -> None:
    look = lookout(identity_dwell_s=0.2)
    for now, car_id in ((0.0, A), (0.1, A), (0.15, B), (0.2, A), (0.3, A)):
        look.receive_preceding_vehicle(PrecedingVehicle(car_id, 20.0, 0.0), now)
        assert look.to_join(now) is None
    look.receive_preceding_vehicle(PrecedingVehicle(A, 20.0, 0.0), 0.4)
    assert look.to_join(0.4) == A


def test_frames_in_which_the_plate_cannot_be_read_do_not_start_the_wait_again() -> None:
    look = lookout(identity_dwell_s=0.2)
    for now, car_id in ((0.0, A), (0.1, None)):
        look.receive_preceding_vehicle(PrecedingVehicle(car_id, 20.0, 0.0), now)
    assert look.to_join(0.1) is None
    look.receive_preceding_vehicle(PrecedingVehicle(A, 20.0, 0.0), 0.25)
    assert look.to_join(0.25) == A


def test_an_unknown_car_is_not_joined() -> None:
    look = lookout()
    look.receive_preceding_vehicle(PrecedingVehicle(None, 10.0, 0.0), 0.0)
    assert look.to_join(0.0) is None


def test_a_frame_without_a_car_forgets_the_plate() -> None:
    look = lookout()
    look.receive_preceding_vehicle(PrecedingVehicle(A, 20.0, 0.0), 0.0)
    look.receive_preceding_vehicle(None, 0.1)
    assert look.named is None
    assert look.to_join(0.1) is None


@pytest.mark.parametrize(
    ("speed_m_s", "fits"), [(17.0, True), (21.9, True), (22.1, False), (11.9, False), (None, True)]
)
def test_an_answer_must_fit_the_speed_that_the_camera_sees(
    speed_m_s: float | None, fits: bool
) -> None:
    look = lookout(20.0, speed_tolerance_m_s=5.0)
    look.receive_preceding_vehicle(
        PrecedingVehicle(A, 20.0, 3.0), 0.0
    )  # closing: the car ahead drives 17 m/s
    assert look.fits(speed_m_s, 0.0) is fits


def test_where_the_camera_has_no_closing_speed_yet_any_answer_fits() -> None:
    look = lookout(20.0)
    look.receive_preceding_vehicle(PrecedingVehicle(A, 20.0, None), 0.0)
    assert look.fits(99.0, 0.0)


def test_a_user_who_swaps_the_headways_is_told() -> None:
    with pytest.raises(SettingsError, match=r"leave_headway_s must not be below join_headway_s"):
        parse_settings({"join_headway_s": 2.5}, LccaSettings, "car.yaml")
