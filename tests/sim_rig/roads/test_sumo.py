"""Traffic from the real libsumo: one interface with the other sources, and clear errors."""

import gzip
import math
import shutil
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("libsumo", reason="SUMO lacks libraries", exc_type=ImportError)

from sim_rig.roads.crashes import Crash, boxes_overlap
from sim_rig.roads.disturbed import DisturbedTraffic
from sim_rig.roads.driver import ReactionSettings
from sim_rig.roads.events import TrafficEvent, TrafficEventKind, TrafficEvents
from sim_rig.roads.recording import RecordedTraffic, record
from sim_rig.roads.road import CarState
from sim_rig.roads.sources import open_traffic
from sim_rig.roads.sumo import NETWORKS, SumoError, SumoTraffic

pytestmark = pytest.mark.long

NOBODY_LOOKS = ReactionSettings(unwarned_median_s=5.0, unwarned_sigma=0.0)


@pytest.fixture(scope="module")
def crossing() -> RecordedTraffic:
    with SumoTraffic(NETWORKS / "crossing.sumocfg", seed=1) as traffic:
        return record(traffic, 100.0, begin_s=60.0)


def test_the_crossing_has_about_a_hundred_cars_that_come_and_go(crossing: RecordedTraffic) -> None:
    there = [set(crossing.cars_at(at_s).names) for at_s in range(0, 100, 20)]

    assert 75 < np.mean([len(names) for names in there]) < 130
    assert all(before - after and after - before for before, after in pairwise(there))


def test_positions_agree_with_speed_and_heading(crossing: RecordedTraffic) -> None:
    for drive in crossing.drives:
        moved = np.hypot(*np.diff(drive.middle_m, axis=0).T) / 0.1
        assert np.abs(moved - drive.speed_m_s[1:]).max() < 3.0
        assert np.median(np.abs(moved - drive.speed_m_s[1:])) < 0.1


def test_few_cars_overlap(crossing: RecordedTraffic) -> None:
    """A car that has to stop while it changes over stands in two lanes, which SUMO lets others."""
    for at_s in range(0, 100, 10):
        assert len(boxes_overlap(crossing.cars_at(float(at_s)))) <= 3


def test_drivers_keep_off_a_guest_who_stops() -> None:
    """A car that SUMO does not drive comes after 60 s into the middle lane, and stops there."""

    def guests(at_s: float) -> dict[str, CarState]:
        since_s = at_s - 60.0
        speed_m_s = max(22.0 - 8.0 * max(since_s - 3.0, 0.0), 0.0)
        x_m = 700.0 + 22.0 * min(since_s, 3.0) + (22.0**2 - speed_m_s**2) / 16.0
        state = CarState(x_m, -6.0, math.pi / 2.0, 0.0, x_m, speed_m_s, 0.0, 4.5, 1.8, 1.5)
        return {"guest": state} if since_s >= 0.0 else {}

    with SumoTraffic(NETWORKS / "dense-highway.sumocfg", 3, guests) as traffic:
        gaps_m, speed_m_s = [], math.inf
        for at_s in range(60, 90):
            cars, (guest,) = traffic.cars_at(float(at_s)), guests(float(at_s)).values()
            assert "guest" not in cars.names
            behind = (abs(cars.middle_m[:, 1] + 6.0) < 1.0) & (cars.middle_m[:, 0] < guest.x_m)
            nearest = np.flatnonzero(behind)[cars.middle_m[behind, 0].argmax()]
            lengths_m = (guest.length_m + cars.length_m[nearest]) / 2.0
            gaps_m.append(guest.x_m - cars.middle_m[nearest, 0] - lengths_m)
            speed_m_s = cars.speed_m_s[nearest]

    assert min(gaps_m) > 1.0
    assert gaps_m[-1] < 5.0
    assert speed_m_s < 0.5


def test_the_crossings_of_the_grid_are_oblique() -> None:
    """Its six roads have six directions."""
    with SumoTraffic(NETWORKS / "grid.sumocfg", seed=0) as traffic:
        cars = traffic.cars_at(60.0)

    directions_deg = set((np.degrees(cars.heading_rad) % 180.0).round(-1) % 180.0)
    assert len(cars) > 40
    assert len(directions_deg) >= 6


@pytest.mark.long
def test_the_roads_of_the_grid_cross_at_junctions_only() -> None:
    """Elsewhere SUMO's cars would drive through each other."""
    with SumoTraffic(NETWORKS / "grid.sumocfg", seed=0) as traffic:
        steps = [traffic.cars_at(0.5 * step) for step in range(120, 400)]

    assert [pair for cars in steps for pair in boxes_overlap(cars)] == []


@pytest.mark.parametrize("kind", list(TrafficEventKind))
def test_things_go_wrong_and_warned_drivers_react(
    crossing: RecordedTraffic, kind: TrafficEventKind
) -> None:
    found = TrafficEvents(crossing, has_lights=True).situations(kind, np.random.default_rng(0))
    crashes, avoided = 0, 0
    for seed in range(5):
        event = found[seed * len(found) // 5].event
        crash = _crash(crossing, event, seed, warned=())
        if crash is not None:
            crashes += 1
            then = _crash(crossing, event, seed, warned=crash.names)
            # Who comes behind is not warned, and may run into those who now stand.
            avoided += then is None or set(then.names) != set(crash.names)

    assert crashes >= 3
    assert avoided >= 2


def _crash(
    recording: RecordedTraffic, event: TrafficEvent, seed: int, warned: Sequence[str]
) -> Crash | None:
    traffic = DisturbedTraffic(recording, event, NOBODY_LOOKS, seed)
    for step in range(70):
        at_s = event.at_s + step / 10
        there = traffic.cars_at(at_s).names
        for name in warned if step else ():
            if name in there:
                traffic.warn(name, at_s)
    return traffic.crash


def test_the_seed_determines_cars_and_departures() -> None:
    def first_cars(seed: int) -> list[list[float]]:
        traffic = open_traffic("sumo-highway", np.random.default_rng(seed))
        assert isinstance(traffic, SumoTraffic)
        with traffic:
            found: list[list[float]] = traffic.cars_at(12.05).middle_m.tolist()
        return found

    assert len(first_cars(1)) > 5
    assert first_cars(1) == first_cars(1)
    assert first_cars(1) != first_cars(2)


def test_threads_of_one_process_run_their_simulations_in_turn() -> None:
    def middles(seed: int) -> list[list[float]]:
        with SumoTraffic(NETWORKS / "highway.sumocfg", seed) as traffic:
            found: list[list[float]] = traffic.cars_at(12.0).middle_m.tolist()
        return found

    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(middles, (1, 2, 3))) == [middles(seed) for seed in (1, 2, 3)]


def test_one_thread_runs_one_simulation() -> None:
    with (
        SumoTraffic(NETWORKS / "highway.sumocfg", seed=1),
        pytest.raises(SumoError, match="already runs a simulation of SUMO"),
    ):
        SumoTraffic(NETWORKS / "crossing.sumocfg", seed=1)


@pytest.mark.parametrize(
    ("routes", "said"),
    [
        ('<vehicle id="a" depart="900"><route edges="from_west to_mars"/></vehicle>', "'to_mars'"),
        ('<flow id="f" from="from_west" to="to_mars" begin="0" end="9" number="2"/>', "'to_mars'"),
        (
            '<vehicle id="a" depart="1"><route edges="from_west to_west"/></vehicle>',
            "No connection",
        ),
        ("<vehicle", "SUMO says"),
    ],
)
def test_routes_that_do_not_fit_the_network_are_refused(
    tmp_path: Path, routes: str, said: str
) -> None:
    for name in ("crossing.sumocfg", "crossing.net.xml"):
        shutil.copy(NETWORKS / name, tmp_path)
    (tmp_path / "crossing.rou.xml").write_text(f"<routes>{routes}</routes>")

    with pytest.raises(SumoError, match=said):
        open_traffic(str(tmp_path / "crossing.sumocfg"), np.random.default_rng(1)).cars_at(5.0)
    with SumoTraffic(NETWORKS / "highway.sumocfg", seed=1) as next_one:
        assert next_one.cars_at(1.0).at_s == 1.0


def test_a_simulation_that_is_not_there_is_the_users_mistake(tmp_path: Path) -> None:
    with pytest.raises(SumoError, match="Could not access"):
        open_traffic(str(tmp_path / "none.sumocfg"), np.random.default_rng(1))


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("crossing.net.xml", None, "cannot be read: No such file or directory"),
        ("crossing.net.xml", b"<net><edge", "is not XML: unclosed token"),
        ("crossing.net.xml.gz", b"<net/>", "cannot be read: Not a gzipped file"),
        ("crossing.net.xml.gz", gzip.compress(b"<net/>", mtime=0)[:9], "cannot be read: "),
    ],
)
def test_a_network_that_cannot_be_loaded_is_named(
    tmp_path: Path, name: str, content: bytes | None, said: str
) -> None:
    """SUMO would say "Process Error", and the next simulation of the process would crash."""
    config = (NETWORKS / "crossing.sumocfg").read_text()
    (tmp_path / "crossing.sumocfg").write_text(config.replace("crossing.net.xml", name))
    if content is not None:
        (tmp_path / name).write_bytes(content)

    with pytest.raises(SumoError, match=f"crossing.sumocfg: its network .*{name} {said}"):
        SumoTraffic(tmp_path / "crossing.sumocfg", seed=1)


def test_a_network_that_does_not_match_its_routes_is_an_error(tmp_path: Path) -> None:
    for name in ("crossing.sumocfg", "crossing.rou.xml"):
        shutil.copy(NETWORKS / name, tmp_path)
    shutil.copy(NETWORKS / "highway.net.xml", tmp_path / "crossing.net.xml")

    with pytest.raises(SumoError, match="'from_east' within the route for flow"):
        SumoTraffic(tmp_path / "crossing.sumocfg", seed=1)
