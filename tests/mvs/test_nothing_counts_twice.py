"""Whatever the radio does: no measurement is used twice, and as good as all of them are used."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.messages import mvs_footer
from onboard.tracking.evidence import Measurement, MeasurementId, observer_of
from onboard.tracking.evidence_store import OWN
from onboard.tracking.fusion import fuse, propagate
from onboard.tracking.track import Track
from onboard.tracking.tracks import DEFAULTS
from tests.mvs.world import (
    Car,
    Message,
    World,
    assert_lists_each_measurement_once,
    only,
    ring,
)
from tests.typed import a


def test_evidence_forwarded_in_circles_is_used_once() -> None:
    world = ring(4)

    for _ in range(15):
        world.run(0.2)
        assert_lists_each_measurement_once(world)

    for k in range(4):
        x = only(world.without_radio(f"c{k}"))
        assert {observer_of(each) for each in x.provenance} == {car.id for car in world.with_radio}
        assert np.abs(world.place_of(f"c{k}", x) - world.truth("x"))[:2].max() < 0.7


@pytest.mark.long
def test_a_ring_that_has_lost_sight_does_not_keep_a_car_alive() -> None:
    world = ring(4)
    world.run(2.0)

    for car in world.cars:
        car.sees = frozenset()
    world.run(1.6)

    assert all(world.without_radio(f"c{k}") == [] for k in range(4))
    assert all(
        len(a(bytes, message.footer)) == mvs_footer.HEADER.size_bytes for message in world.sent[-4:]
    )


@pytest.mark.long
@settings(max_examples=12)
@given(
    seed=st.integers(0, 2**16),
    loss=st.sampled_from([0.0, 0.3, 0.8]),
    longest_delay=st.sampled_from([0.0, 0.25, 1.5]),
    doubled=st.sampled_from([0.0, 0.5]),
)
def test_whatever_the_radio_does_no_measurement_is_used_twice(
    seed: int, loss: float, longest_delay: float, doubled: float
) -> None:
    rng = np.random.default_rng(seed)

    def radio(message: Message, receiver: Car, t: float) -> list[float]:
        copies = 0 if rng.random() < loss else 2 if rng.random() < doubled else 1
        return [0.002 + longest_delay * rng.random() for _ in range(copies)]

    world = ring(3, radio=radio, seed=seed)
    for _ in range(4):
        world.run(0.4)
        assert_lists_each_measurement_once(world)


def test_what_a_car_knows_is_what_a_central_filter_of_all_measurements_knows() -> None:
    """The limit: a filter that is handed every car's measurements, unrounded and without radio."""
    world = ring(4)
    mvs = world.mvs["c0"]
    everything: dict[MeasurementId, Measurement] = {}
    for _ in range(20):
        world.run(0.1)
        for core in world.mvs.values():
            frame, own_frame = mvs._host.frame, core._host.frame
            assert frame is not None
            assert own_frame is not None
            mapping = frame.mapping_from(own_frame)
            for held in (held for track in core._tracks for held in track.evidence.values()):
                piece = held.piece
                if isinstance(piece, Measurement) and held.sender == OWN:
                    everything[piece.id] = piece.mapped(*mapping)
    x = only(world.without_radio("c0"))

    (central,) = fuse([list(everything.values())], DEFAULTS.acceleration_density)
    (track,) = mvs.reported_tracks()

    assert x.provenance <= set(everything)
    assert len(x.provenance) > 0.85 * len(everything)
    states, _ = propagate([central], track.estimate.stamp_ms, DEFAULTS.acceleration_density)
    apart = states[:, 0] - track.estimate.state
    assert np.abs(apart[:2]).max() < 0.3
    assert np.abs(apart[2:]).max() < 0.6
    sigma_m = np.sqrt(np.diagonal(track.estimate.covariance)[:2].sum())
    central_sigma_m = np.sqrt(np.diagonal(central.covariance)[:2].sum())
    assert sigma_m == pytest.approx(central_sigma_m, rel=0.25)


def test_without_the_selection_measurements_would_be_used_twice(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The property above can fail: it is the selection that keeps it."""

    def use_everything(track: Track) -> bool:
        track.chosen = track.stored
        return True

    monkeypatch.setattr(Track, "choose_evidence", use_everything)
    world = ring(3)
    world.run(1.0)

    with pytest.raises(AssertionError):
        assert_lists_each_measurement_once(world)


def test_a_measurement_that_was_lost_comes_in_an_estimate() -> None:
    """Figure 5: dm<v, t> is lost on its way, but e<v, T> with t in T arrives by another."""

    def radio(message: Message, receiver: Car, t: float) -> list[float]:
        return [] if (message.sender.name, receiver.name) == ("a", "c") else [0.002]

    cars = [
        Car("a", -30, 0, sees=frozenset({"x"}), heading_rad=0.0),
        Car("b", 30, 0, sees=frozenset({"x"}), heading_rad=0.0),
        Car("c", 0, 60, heading_rad=0.0),
        Car("x", 0, 0, 3.0, 0.0, radio=False),
    ]
    world = World(cars, radio=radio)

    world.run(2.0)

    x = only(world.without_radio("c"))
    assert {observer_of(each) for each in x.provenance} == {cars[0].id, cars[1].id}


def test_when_everything_is_lost_a_car_knows_what_it_sees() -> None:
    world = ring(3, radio=lambda message, receiver, t: [])

    world.run(1.0)

    x = only(world.without_radio("c0"))
    assert {observer_of(each) for each in x.provenance} == {world.car("c0").id}
    assert len(x.provenance) == 10


def test_a_late_message_is_used_where_it_belongs_and_the_state_is_of_now() -> None:
    world = ring(2, radio=lambda message, receiver, t: [0.4])

    world.run(3.0)

    x = only(world.without_radio("c0"))
    assert {observer_of(each) for each in x.provenance} == {b"--c0", b"--c1"}
    assert np.abs(world.place_of("c0", x) - world.truth("x"))[:2].max() < 0.8


def test_the_same_message_a_hundred_times_changes_nothing() -> None:
    once, often = ring(2), ring(2)
    once.run(1.0)
    often.run(1.0)

    message = often.sent[-1]
    mvs = often.mvs["c0"]
    for _ in range(100):
        mvs.receive_bsm(message.sender.id, None, message.footer, often.t)
    once.run(0.1)
    often.run(0.1)

    assert only(once.without_radio("c0")).state == only(often.without_radio("c0")).state
    assert "too_often" in often.discarded("c0")
