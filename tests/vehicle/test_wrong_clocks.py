"""Clocks that differ by a second or two neither delay a warning nor lose it."""

import pytest

from onboard.lcca.events import WarningRaised
from onboard.observations import HardBrake, Sensor, SensorLost, SensorRecovered
from onboard.tools.test_ca.authority import make_pseudonyms
from sim_rig.studies.attacks.attack_world import AttackedHost, Signer
from tests.security.trial import ALICE, BSM, ISSUING, LCCA, UTC_S, VALID, new_key
from tests.typed import every
from tests.vehicle.platoon import Platoon, car

CARS = 24
EPOCH_S = 300.0


def signed_row(clock_errors_s: list[float], utc_s: float) -> Platoon:
    """Signed vehicles in one lane, each with its clock's error, whose radios reach one another."""
    cars = {}
    for i, error_s in enumerate(clock_errors_s):
        keys = make_pseudonyms(ISSUING, 1, {BSM, LCCA}, new_key=new_key, **VALID)
        cars[f"CAR{i:02d}"] = car(
            f"CAR{i:02d}", EPOCH_S, keys, utc_s + error_s, seed=i, beacons=False
        )
    return Platoon(cars, reach=1)


def brake(platoon: Platoon, plate: str) -> None:
    platoon.receive(plate, HardBrake(platoon.now, 7.0, source="obd"))
    platoon.drive(0.3)


@pytest.mark.long
def test_in_a_chain_of_24_with_clocks_a_second_apart_all_are_warned() -> None:
    """The age of a warning is what each vehicle held it: 23 hops add 23 times a millisecond."""
    platoon = signed_row([float(i % 2) for i in range(CARS)], UTC_S)
    platoon.drive(9.0)
    assert platoon.cars["CAR23"].group.group_number == CARS
    braked_at = platoon.now

    brake(platoon, "CAR00")

    for i in range(1, CARS):
        (warning,) = every(WarningRaised, platoon.events_of(f"CAR{i:02d}", "warning"))
        assert warning.hops == i
        assert warning.age_s == pytest.approx(warning.stamp_s - braked_at + 0.001 * i, abs=0.005)


@pytest.mark.long
@pytest.mark.parametrize("until_change_s", [0.6, 0.0, -0.9])
def test_while_ids_change_by_clocks_two_seconds_apart_all_are_warned_at_once(
    until_change_s: float,
) -> None:
    errors_s = [0.0, 2.0, 0.9, 0.0, 1.4, 2.0, 0.2, 1.1]
    ends_at = (UTC_S // EPOCH_S + 1) * EPOCH_S
    platoon = signed_row(errors_s, ends_at - 8.0)
    platoon.drive(8.0 - until_change_s)
    before = [len(list(platoon.events_of(plate, "transition"))) for plate in platoon.cars]

    brake(platoon, "CAR00")

    for i, plate in enumerate(platoon.cars):
        raised = list(platoon.events_of(plate, "warning"))
        assert len(raised) == int(i > 0), plate
    platoon.drive(3.0)
    after = [len(list(platoon.events_of(plate, "transition"))) for plate in platoon.cars]
    assert after == before


def test_a_unit_that_is_reached_again_does_not_hide_that_the_clock_is_wrong() -> None:
    radio = {"endpoint": "iwcu", "listen_port": 2001, "unit_port": 2002}
    host = AttackedHost(ALICE, UTC_S, radio=radio)
    others = [
        Signer(make_pseudonyms(ISSUING, 1, {BSM, LCCA}, new_key=new_key, **VALID), UTC_S - 100.0)
        for _ in range(2)
    ]
    host.stack.step([SensorLost(0.0, Sensor.RADIO, None, "unreachable")], 0.0)
    host.drive(0.5, *[lambda now, each=each: [each.signed(b"?", LCCA, now)] for each in others])
    events = host.stack.step([SensorRecovered(1.0, Sensor.RADIO)], 1.0).events
    radio_states = [each for each in events if isinstance(each, SensorLost | SensorRecovered)]
    assert isinstance(radio_states[-1], SensorLost)
    assert radio_states[-1].reason == "clock_wrong"
