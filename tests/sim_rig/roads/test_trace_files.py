"""Traces are read as they are, and what cannot be a recording of cars is refused with its place."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from sim_rig.roads.trace_files import TraceError, read_trace

HEAD = "t,id,x,y,heading,v,length,width\n"
NODE = "$node_(0) set X_ 10.0\n$node_(0) set Y_ 5.0\n"


def written(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text)
    return path


def test_a_node_drives_to_its_destination_and_waits_for_the_next_command(tmp_path: Path) -> None:
    moves = '$ns_ at 1.0 "$node_(0) setdest 30 5 10.0"\n$ns_ at 5.0 "$node_(0) setdest 30 25 5.0"\n'
    recording = read_trace(written(tmp_path, "a.ns2", NODE + moves))

    places = [recording.cars_at(at_s).middle_m.tolist() for at_s in (0.5, 1.0, 2.05, 4.0, 7.0)]

    assert places[0] == []
    assert np.ravel(places[1:]) == pytest.approx([10, 5, 20.5, 5, 30, 5, 30, 15])
    assert recording.cars_at(4.0).speed_m_s == pytest.approx(0.0)
    assert recording.cars_at(4.0).heading_rad == pytest.approx(0.0)
    assert recording.cars_at(7.0).heading_rad == pytest.approx(np.pi / 2)
    assert recording.end_s == pytest.approx(9.0)


def test_a_new_destination_cuts_the_way_short(tmp_path: Path) -> None:
    moves = '$ns_ at 0.0 "$node_(0) setdest 30 5 10.0"\n$ns_ at 1.0 "$node_(0) setdest 20 25 5.0"\n'
    recording = read_trace(written(tmp_path, "a.tcl", NODE + moves))

    assert recording.cars_at(3.0).middle_m[0] == pytest.approx([20.0, 15.0])


def test_a_car_that_is_switched_off_or_put_away_has_gone(tmp_path: Path) -> None:
    moves = (
        '$ns_ at 0.0 "$node_(0) switch OFF"\n$ns_ at 2.0 "$node_(0) setdest 0 0 1000000000.0"\n'
        '$ns_ at 2.0 "$node_(0) switch ON"\n$ns_ at 2.0 "$node_(0) setdest 100 0 10.0"\n'
        '$ns_ at 6.0 "$node_(0) switch OFF" ;# arrived\n'
        '$ns_ at 7.0 "$node_(0) setdest 0.01 0.01 1000000001.0"\n'
    )
    recording = read_trace(written(tmp_path, "a.ns2", NODE + moves))

    assert recording.cars_at(2.0).middle_m[0] == pytest.approx([0.0, 0.0])
    assert len(recording.cars_at(6.0)) == 1
    assert len(recording.cars_at(6.2)) == 0


def test_a_car_that_was_put_away_and_is_put_elsewhere_does_not_come_back(tmp_path: Path) -> None:
    moves = (
        '$ns_ at 0.0 "$node_(0) setdest 100 5 10.0"\n$ns_ at 4.0 "$node_(0) setdest 0 0 1e9"\n'
        '$ns_ at 8.0 "$node_(0) setdest 1 1 1e9"\n'
    )
    recording = read_trace(written(tmp_path, "a.ns2", NODE + moves))

    assert recording.end_s == pytest.approx(4.0)


def test_floating_car_data_gives_front_bumpers_and_compass_angles(tmp_path: Path) -> None:
    step = '<timestep time="{0}"><vehicle id="a" x="{1}" y="3" angle="90" speed="10"/></timestep>'
    text = "<fcd-export>" + step.format(4.0, 100) + step.format(5.0, 110) + "</fcd-export>"
    recording = read_trace(written(tmp_path, "a.xml", text))

    cars = recording.cars_at(0.5)

    assert cars.middle_m[0] == pytest.approx([105 - 4.5 / 2, 3.0])
    assert cars.heading_rad[0] == pytest.approx(0.0)


def test_csv_may_be_gzipped_and_has_lengths_of_cars(tmp_path: Path) -> None:
    rows = HEAD + "0.0,7,0,0,0,5,6.0,2.0\n0.5,7,2.5,0,0,5,6.0,2.0\n"
    path = tmp_path / "a.csv.gz"
    path.write_bytes(gzip.compress(rows.encode()))

    cars = read_trace(path).cars_at(0.2)

    assert cars.names == ("7",)
    assert cars.middle_m[0] == pytest.approx([1.0 - 3.0, 0.0])
    assert (cars.length_m[0], cars.width_m[0]) == (6.0, 2.0)


FCD = '<fcd-export><timestep time="1"/><timestep time="{}"/></fcd-export>'


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        (
            "hole.csv",
            HEAD + "0,a,0,0,0,5,4,2\n5,a,25,0,0,5,4,2\n",
            "car a is missing from 0 s to 5 s",
        ),
        ("jump.csv", HEAD + "0,a,0,0,0,5,4,2\n0.1,a,400,0,0,5,4,2\n", "car a jumps 400 m at 0.1 s"),
        ("twice.csv", HEAD + "0,a,0,0,0,5,4,2\n0,a,9,0,0,5,4,2\n", "two cars are named a at 0 s"),
        (
            "back.csv",
            HEAD + "1,a,0,0,0,5,4,2\n0.5,b,9,0,0,5,4,2\n",
            "line 3: time 0.5 s comes after 1",
        ),
        ("nowhere.csv", HEAD + "0,a,nan,0,0,5,4,2\n", "car a has no finite state at 0 s"),
        ("number.csv", HEAD + "0,a,here,0,0,5,4,2\n", "line 2: could not convert"),
        ("columns.csv", "t,x,y\n0,0,0\n", "no column id, v"),
        ("empty.csv", HEAD, "no car drives"),
        ("short.csv", HEAD + "0,a,0\n", "line 2: fields do not match columns"),
        ("long.csv", HEAD + "0,a,0,0,0,5,4,2,7\n", "line 2: fields do not match columns"),
        ("flat.csv", HEAD + "0,a,0,0,0,5,nan,2\n", "line 2: length and width must be positive"),
        ("degrees.csv", HEAD + "0,a,0,0,90,5,4,2\n", "a heading of 90 rad (degrees"),
        ("back.csv", HEAD + "0,a,0,0,0,-5,4,2\n", "car a drives at -5 m/s"),
        ("light.csv", HEAD + "0,a,0,0,0,1e300,4,2\n", "car a drives at 1e.300 m/s"),
        ("nobody.csv", HEAD + "0,,0,0,0,5,4,2\n", "a car without a name"),
        ("both.csv", "t,id,vin,x,y,heading,v\n0,a,b,0,0,0,5\n", "columns with the same meaning"),
        ("large.csv", HEAD + "0," + 200_000 * "a" + ",0,0,0,5,4,2\n", "cannot be read"),
        ("number.ns2", "$node_(0) set X_ 1e\n", "line 1: no command of setdest"),
        ("minus.ns2", "$node_(0) set X_ --1\n", "line 1: no command of setdest"),
        ("back.ns2", NODE + '$ns_ at 0 "$node_(0) setdest 1 1 -5"\n', "car 0 drives at -5 m/s"),
        ("ever.ns2", NODE + '$ns_ at 0 "$node_(0) setdest 1e12 1 5"\n', "more than a day"),
        ("twice.ns2", NODE + NODE, "line 3: two cars are named 0"),
        ("place.ns2", '$ns_ at 0 "$node_(3) setdest 1 1 5"\n', "car 3 moves before it has a place"),
        ("fast.ns2", NODE + '$ns_ at 0 "$node_(0) setdest 1 1 500"\n', "car 0 drives at 500 m/s"),
        (
            "back.ns2",
            NODE + '$ns_ at 9 "$node_(0) setdest 1 1 5"\n$ns_ at 3 "$node_(0) setdest 2 2 5"\n',
            "car 0 has a command earlier than its last one",
        ),
        (
            "jump.ns2",
            NODE + '$ns_ at 1 "$node_(0) setdest 20 5 5"\n$ns_ at 3 "$node_(0) setdest 2 2 1e9"\n'
            '$ns_ at 4 "$node_(0) setdest 9 9 5"\n',
            "line 5: car 0 jumps",
        ),
        ("words.ns2", "hello\n", "line 1: no command of setdest: 'hello'"),
        ("back.xml", FCD.format("0.5"), "time 0.5 s comes after 1 s"),
        ("words.xml", "<fcd-export><timestep", "not floating car data"),
        ("words.txt", "", "a trace ends in one of .csv"),
    ],
)
def test_what_is_no_recording_is_refused(tmp_path: Path, name: str, text: str, said: str) -> None:
    with pytest.raises(TraceError, match=said.replace("(", r"\(")):
        read_trace(written(tmp_path, name, text))


def test_a_missing_or_broken_file_is_the_users_mistake(tmp_path: Path) -> None:
    with pytest.raises(TraceError, match="cannot be read"):
        read_trace(tmp_path / "none.csv")
    broken = tmp_path / "a.csv.gz"
    whole = gzip.compress(HEAD.encode() + b"0,a,0,0,0,5,4,2\n")
    for wrong in (whole[:-9], b"no gzip", whole[:20] + b"\xff\xff\xff" + whole[23:], b"\x1f\x8b"):
        broken.write_bytes(wrong)
        with pytest.raises(TraceError, match="cannot be read"):
            read_trace(broken)


def test_a_spreadsheets_mark_of_utf8_is_no_part_of_the_first_column(tmp_path: Path) -> None:
    text = "\ufeff" + HEAD + "0,a,0,0,0,10,4,2\n0.1,a,1,0,0,10,4,2\n"

    assert len(read_trace(written(tmp_path, "a.csv", text)).drives) == 1


def test_hop_distances_of_setdest_are_ignored(tmp_path: Path) -> None:
    hops = '$god_ set-dist 0 1 2\n$ns_ at 1.5 "$god_ set-dist 0 1 3"\n'
    moves = '$ns_ at 0 "$node_(0) setdest 20 5 5"\n'

    recording = read_trace(written(tmp_path, "a.ns2", NODE + hops + moves + hops))

    assert [drive.name for drive in recording.drives] == ["0"]


@pytest.mark.realdata
def test_the_city_trace_has_99_moving_cars(rig_data: Path) -> None:
    recording = read_trace(rig_data / "traces/city-99-cars.ns2")

    assert len(recording.drives) == 99
    assert recording.end_s == pytest.approx(300.0, abs=0.1)
    assert [len(recording.cars_at(at_s)) for at_s in (0.1, 150.0, 290.0)] == [55, 42, 19]
    assert max(drive.speed_m_s.max() for drive in recording.drives) < 32.1


@pytest.mark.long
@pytest.mark.realdata
def test_one_crossing_written_in_two_formats_is_one_crossing(rig_data: Path) -> None:
    """AIM's CSV has front bumpers, its setdest file body centres moved by (200, 200) m."""
    by_csv = read_trace(rig_data / "traces/crossing-signals-100-cars.csv.gz").cars_at(123.4)
    by_ns2 = read_trace(rig_data / "traces/crossing-signals-100-cars.ns2.gz").cars_at(123.4)

    assert len(by_csv) == 90
    apart = np.hypot(*(by_csv.middle_m[:, None] + 200.0 - by_ns2.middle_m).transpose(2, 0, 1))
    assert np.median(apart.min(axis=1)) < 0.2
