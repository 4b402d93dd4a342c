"""What Foxglove shows of a recording: positions on a map, and the layout of the examples."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from onboard.observations import Position
from onboard.recorder.reader import RecordedDrive
from onboard.recorder.records import CameraImage, RecordedMessage
from onboard.recorder.segment import IMAGES, LOCATIONS, Segment
from tests.recorder.headers import HEADER

ROOT = Path(__file__).parents[2]
LAYOUT = json.loads((ROOT / "examples" / "foxglove-layout.json").read_text("utf-8"))
FIX = Position(1000.0, 52.1, 13.2, 34.0, 1.5, 10.0, 0.1)


def segment_with(folder: Path, *messages: RecordedMessage) -> Path:
    segment = Segment(folder / "drive-0000.mcap", HEADER, 0)
    for message in messages:
        segment.add(message)
    segment.close()
    return segment.path


def test_a_position_is_also_a_location_fix(tmp_path: Path) -> None:
    path = segment_with(tmp_path, RecordedMessage("/in/position", 1_750_000_000.25, FIX))
    with path.open("rb") as file:
        read = {
            channel.topic: (schema, message)
            for schema, channel, message in make_reader(file).iter_messages()
        }
    assert set(read) == {"/in/position", LOCATIONS}
    schema, message = read[LOCATIONS]
    fix = json.loads(message.data)
    assert schema is not None
    assert schema.name == "foxglove.LocationFix"
    assert set(json.loads(schema.data)["properties"]) == set(fix)
    assert (fix["latitude"], fix["longitude"], fix["altitude"]) == (52.1, 13.2, 34.0)
    assert fix["position_covariance"][::4] == [2.25, 2.25, 0.0]
    assert fix["timestamp"] == {"sec": 1_750_000_000, "nsec": 250_000_000}


def test_the_layout_shows_the_topics_of_images_and_positions(tmp_path: Path) -> None:
    image = RecordedMessage(IMAGES, HEADER.utc_s, CameraImage(1000.0, b"\xff\xd8"))
    position = RecordedMessage("/in/position", HEADER.utc_s, FIX)
    segment_with(tmp_path, image, position)
    topics = {entry.topic for entry in RecordedDrive([tmp_path]).entries()}
    panels = LAYOUT["configById"]
    assert panels["Image!camera"]["imageMode"]["imageTopic"] in topics
    assert panels["map!fixes"]["followTopic"] in topics
    assert set(panels["map!fixes"]["topicColors"]) <= topics


def paths_of(tree: object) -> Iterator[str]:
    if isinstance(tree, dict):
        for key, value in tree.items():
            if key in {"value", "topicPath"}:
                yield value
            yield from paths_of(value)
    elif isinstance(tree, list):
        for each in tree:
            yield from paths_of(each)


@pytest.mark.parametrize("path", sorted(paths_of(LAYOUT)))
def test_every_path_of_the_layout_is_in_a_recorded_drive(path: str) -> None:
    topic, _, field = path.partition(".")
    drive = RecordedDrive([ROOT / "tests" / "drives" / "warned.mcap"])
    records: list[dict[str, Any]] = [e.record for e in drive.entries() if e.topic == topic]
    assert records
    assert not field or any(field in record for record in records)


def test_the_layout_places_every_panel_once() -> None:
    placed = re.findall(r'"(?:first|second)": "([^"]+)"', json.dumps(LAYOUT["layout"]))
    assert sorted(placed) == sorted(LAYOUT["configById"])
