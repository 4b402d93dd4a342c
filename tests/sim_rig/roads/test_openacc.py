"""A recorded platoon drives along a straight lane, at its spacings and speeds."""

from pathlib import Path

import pytest

from onboard.errors import UserError
from onboard.settings import parse_settings
from sim_rig.roads.breakpoints import BreakpointRoad
from sim_rig.roads.openacc import LENGTH_M
from sim_rig.roads.trace_files import read_trace
from sim_rig.scenario.schema import Scenario

HEAD = "Date,8,10,2019\nVehicle_order,A,B,\nNumber_of_vehicles,2\nACC,1\nDistance_setting,S\n"
COLUMNS = "Time,Speed1,E1,Speed2,E2,IVS1\n"
ROWS = "5.0,10,0,9,0,20\n5.1,10,0,9,0,20.1\n5.2,12,0,,0,20.3\n"


def written(folder: Path, text: str = HEAD + COLUMNS + ROWS) -> Path:
    path = folder / "platoon.csv"
    path.write_text(text)
    return path


def road_of(path: Path) -> BreakpointRoad:
    tree = {
        "title": "Two cars drive as recorded.",
        "seed": 1,
        "duration_s": 0.2,
        "radio": {"reach_m": 300},
        "cars": {
            "car1": {"plate": "AA1", "trajectory": str(path)},
            "car2": {"plate": "BB2", "trajectory": str(path)},
        },
        "expect": [],
    }
    return BreakpointRoad(parse_settings(tree, Scenario, "test"))


def test_gaps_and_speeds_are_those_of_the_recording(tmp_path: Path) -> None:
    road = road_of(written(tmp_path))

    for at_s, gap_m, speed_m_s in ((0.0, 20.0, 9.0), (0.05, 20.05, 9.0), (0.2, 20.3, 9.0)):
        one, other = (road.car_at(name, at_s) for name in ("car1", "car2"))
        assert one.x_m - other.x_m - LENGTH_M == pytest.approx(gap_m)
        assert other.speed_m_s == pytest.approx(speed_m_s)  # also where it is missing
    driven_m = road.car_at("car1", 0.2).front_m - road.car_at("car1", 0.0).front_m
    assert driven_m == pytest.approx(0.1 * 10.0 + 0.1 * 11.0)


def test_a_platoon_of_which_only_some_cars_were_recorded_is_read(tmp_path: Path) -> None:
    columns = "Time,Speed2,E2,N2,Speed4,E4,N4,Speed5,E5,N5,IVS4\n"
    rows = "".join(f"{5 + i / 10},10,{i},30,9,{i},0,9,0,0,12\n" for i in range(3))

    drives = read_trace(written(tmp_path, HEAD + columns + rows)).drives

    assert [drive.name for drive in drives] == ["car2", "car4", "car5"]
    second, fourth, fifth = (drive.middle_m[:, 0] for drive in drives)
    assert (second - fourth).tolist() == pytest.approx([30.0] * 3)
    assert (fourth - fifth).tolist() == pytest.approx([12.0 + LENGTH_M] * 3)


def test_cars_keep_to_the_lane_and_stand_after_the_end(tmp_path: Path) -> None:
    road = road_of(written(tmp_path))

    seen = road.car_at("car2", 0.1).seen_from_front(*road.car_at("car1", 0.1).point(0.0, 0.0))
    assert seen == pytest.approx((20.1 + LENGTH_M / 2, 0.0))
    assert road.car_at("car1", 9.0).speed_m_s == 0.0
    assert road.car_at("car1", 9.0).x_m == road.car_at("car1", 0.2).x_m


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (HEAD + "Speed1\n1\n2\n", "no column Time"),
        (HEAD + COLUMNS.replace("IVS1", "X") + ROWS, "no column IVS1"),
        (HEAD + COLUMNS + "5.0,10,0,9,0,20\n5.1,ten,0,9,0,20\n", "line 8: could not convert"),
        (HEAD + COLUMNS + "5.0,10,0,9,0,20\n", "two rows at least"),
        (HEAD + COLUMNS + "5.0,10,0,,0,20\n5.1,10,0,,0,20\n", "the column Speed2 is empty"),
    ],
)
def test_what_is_no_platoon_is_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(UserError, match=message):
        read_trace(written(tmp_path, text))


def test_times_positions_and_speeds_are_a_trace(tmp_path: Path) -> None:
    path = written(tmp_path, "t,id,x,v\n0,car1,30,10\n0,car2,0,10\n0.1,car1,31,10\n0.1,car2,1,10\n")

    road = road_of(path)
    assert road.car_at("car1", 0.1).x_m == pytest.approx(31.0 - LENGTH_M / 2)
    assert road.car_at("car2", 0.0).speed_m_s == 10.0


def test_a_car_that_the_file_does_not_have_is_named(tmp_path: Path) -> None:
    path = written(tmp_path, "t,id,x,v\n0,car1,30,10\n0.1,car1,31,10\n")

    with pytest.raises(UserError, match="no car 'car2' in the recording; cars: car1"):
        road_of(path)


@pytest.mark.realdata
def test_the_recorded_platoons_are_read(rig_data: Path) -> None:
    for name, cars, end_s in (("long", 7, 119.9), ("short", 11, 129.8), ("mixed", 6, 98.9)):
        recording = read_trace(rig_data / f"platoons/acc-{name}.csv")
        assert len(recording.drives) == cars
        assert recording.end_s == pytest.approx(end_s)
