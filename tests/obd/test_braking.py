"""All that shows hard braking, merged to one state."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.kinematics.units import STANDARD_GRAVITY_M_S2
from onboard.obd.braking import LEAST_M_S2, RELEASE_S, STALE_S, BrakeTrigger, Braking
from onboard.obd.hard_brake import WINDOW_S
from onboard.observations import BrakeCause, BrakePedal, HardBrake, Speed

THRESHOLD_M_S2 = 0.4 * STANDARD_GRAVITY_M_S2


class Car:
    """A car whose bus has speed and triggers at 20 Hz."""

    def __init__(self) -> None:
        self.braking = Braking(0.4)
        self.now = 0.0
        self.speed_m_s = 20.0
        self.found: list[HardBrake] = []

    def drive(
        self,
        for_s: float,
        *,
        deceleration_m_s2: float = 0.0,
        pedal: bool | None = None,
        has_speed: bool = True,
        **active: bool,
    ) -> "Car":
        """Go on for some time; `active` gives signals by cause, `None` sends none."""
        for _ in range(round(for_s * 20)):
            self.now += 0.05
            self.speed_m_s = max(self.speed_m_s - deceleration_m_s2 * 0.05, 0.0)
            self.braking.handle_timer(self.now)
            if has_speed:
                self.braking.receive_speed(Speed(self.now, self.speed_m_s, 0.1, "dbc"), self.now)
            if pedal is not None:
                self.braking.receive_pedal(BrakePedal(self.now, pedal, "dbc"), self.now)
            for cause, is_active in active.items():
                trigger = BrakeTrigger(self.now, BrakeCause[cause.upper()], is_active, cause)
                self.braking.receive_trigger(trigger, self.now)
            self.found += iter(self.braking.next_event, None)
        return self

    @property
    def causes(self) -> list[BrakeCause | None]:
        return [None if each.is_over else each.cause for each in self.found]


@pytest.mark.parametrize("cause", ["abs", "stability_control", "hazard_lights"])
def test_a_lamp_without_braking_is_no_hard_braking(cause: str) -> None:
    """ABS or ESC on a slippery bend, hazard lights in a jam's tail."""
    assert Car().drive(3.0, **{cause: True}).found == []
    assert Car().drive(3.0, deceleration_m_s2=1.0, **{cause: True}).found == []


@pytest.mark.parametrize("cause", ["abs", "stability_control"])
def test_abs_and_stability_control_count_with_the_pedal_pressed(cause: str) -> None:
    car = Car().drive(1.0).drive(2.0, pedal=True, deceleration_m_s2=1.0, **{cause: True})
    assert car.causes == [BrakeCause[cause.upper()]]
    assert 0.0 < car.found[0].deceleration_m_s2 < 2.0
    assert car.found[0].source == cause


def test_hazard_lights_do_not_count_with_the_pedal_pressed_only() -> None:
    assert Car().drive(3.0, pedal=True, hazard_lights=True).found == []


@pytest.mark.parametrize("cause", ["abs", "stability_control", "hazard_lights"])
def test_a_lamp_counts_while_the_vehicle_decelerates_with_half_the_threshold(cause: str) -> None:
    car = Car().drive(1.0).drive(2.0, deceleration_m_s2=2.5, **{cause: True})
    assert car.causes == [BrakeCause[cause.upper()]]
    assert car.found[0].deceleration_m_s2 == pytest.approx(2.5, abs=0.6)


def test_brake_pressure_counts_only_while_the_vehicle_moves() -> None:
    assert Car().drive(1.0).drive(1.0, brake_pressure=True).causes == [BrakeCause.BRAKE_PRESSURE]
    car = Car()
    car.speed_m_s = 0.0
    assert car.drive(3.0, brake_pressure=True).found == []


def test_an_airbag_counts_always_even_without_a_speed() -> None:
    car = Car().drive(1.0, airbag=False, has_speed=False).drive(5.0, airbag=True, has_speed=False)
    assert car.causes == [BrakeCause.AIRBAG]
    assert car.found[0].deceleration_m_s2 == pytest.approx(THRESHOLD_M_S2)


def test_an_airbag_at_constant_speed_claims_no_deceleration() -> None:
    (begin,) = Car().drive(1.0).drive(2.0, airbag=True).found
    assert begin.deceleration_m_s2 == LEAST_M_S2


def test_the_most_severe_cause_is_shown_and_the_end_is_that_of_the_last() -> None:
    car = Car().drive(1.0, abs=False)
    car.drive(1.0, deceleration_m_s2=5.0, abs=False)
    car.drive(0.3, deceleration_m_s2=5.0, abs=True, airbag=False)
    car.drive(0.1, deceleration_m_s2=5.0, abs=True, airbag=True)
    car.drive(1.5, deceleration_m_s2=4.0, abs=False, airbag=False)
    car.drive(1.5, abs=False)
    causes = [cause for n, cause in enumerate(car.causes) if n == 0 or cause != car.causes[n - 1]]
    assert causes == [
        BrakeCause.DECELERATION,
        BrakeCause.ABS,
        BrakeCause.AIRBAG,
        BrakeCause.DECELERATION,
        None,
    ]
    assert car.found[-1].deceleration_m_s2 == 0.0


def test_blinking_hazard_lights_are_one_braking() -> None:
    car = Car().drive(1.0)
    for _ in range(3):
        car.drive(0.4, deceleration_m_s2=2.5, hazard_lights=True)
        car.drive(0.4, deceleration_m_s2=2.5, hazard_lights=False)
    assert car.causes == [BrakeCause.HAZARD_LIGHTS]


def test_a_cause_that_ends_is_over_soon() -> None:
    car = Car().drive(1.0).drive(1.0, brake_pressure=True)
    ended_at = car.now
    car.drive(1.0, brake_pressure=False)
    assert car.causes == [BrakeCause.BRAKE_PRESSURE, None]
    assert car.found[-1].stamp_s - ended_at == pytest.approx(RELEASE_S, abs=0.11)


def test_a_cause_whose_signal_falls_silent_is_over() -> None:
    car = Car().drive(1.0, airbag=True)
    silent_at = car.now
    car.drive(4.0)
    assert car.causes == [BrakeCause.AIRBAG, None]
    assert car.found[-1].stamp_s - silent_at <= STALE_S + RELEASE_S + 0.06


def test_braking_is_over_when_the_speed_falls_silent() -> None:
    car = Car().drive(1.0).drive(1.0, deceleration_m_s2=6.0)
    silent_at = car.now
    assert car.braking.get_timer() == pytest.approx(silent_at + WINDOW_S)
    car.braking.handle_timer(silent_at + WINDOW_S)
    end = car.braking.next_event()
    assert isinstance(end, HardBrake)
    assert end.is_over
    assert end.stamp_s == pytest.approx(silent_at + WINDOW_S)
    assert car.braking.get_timer() == float("inf")


def test_at_standstill_braking_is_over_whatever_is_still_active() -> None:
    car = Car().drive(1.0)
    car.drive(5.0, deceleration_m_s2=8.0, pedal=True, abs=True, brake_pressure=True)
    assert car.causes[-1] is None
    assert car.found[-1].stamp_s < 1.0 + 20.0 / 8.0 + 0.7


SIGNALS = st.fixed_dictionaries(
    {
        cause: st.booleans()
        for cause in ("abs", "stability_control", "hazard_lights", "brake_pressure", "airbag")
    }
)


@pytest.mark.long
@given(
    st.lists(
        st.tuples(st.floats(0.05, 2.0), st.floats(-3.0, 10.0), st.booleans(), SIGNALS), max_size=12
    )
)
def test_every_braking_that_begins_ends_and_changes_are_rare(
    phases: list[tuple[float, float, bool, dict[str, bool]]],
) -> None:
    car = Car()
    for for_s, deceleration_m_s2, has_speed, signals in phases:
        car.drive(for_s, deceleration_m_s2=deceleration_m_s2, has_speed=has_speed, **signals)
    driven_s = car.now
    while (at := car.braking.get_timer()) < float("inf"):
        assert at >= car.now
        car.now = at
        car.braking.handle_timer(at)
        car.found += iter(car.braking.next_event, None)
    assert car.now <= driven_s + 10.0
    if car.found:
        assert car.found[-1].is_over
    assert len(car.found) <= 3 + 6.0 * driven_s
    for before, after in zip(car.found, car.found[1:], strict=False):
        assert not (before.is_over and after.is_over)
        assert after.is_over or after.deceleration_m_s2 > 0.0
