"""Turns records of older formats into those of the present one, one format at a time.

Inputs and header are converted, and the kinds of outputs; what was decided stays as it was written.
"""

from collections.abc import Callable, Mapping
from typing import Any

Record = dict[str, Any]
Migration = Callable[[str, Record], tuple[str, Record]]
"""Takes topic and fields of a record, and returns those of the next format."""

_KINDS_OF_2 = {
    "button": "brake_button",
    "detected_cars": "detection_list",
    "gap": "recording_gap",
    "round": "step",
    "sensed_car": "vehicle_detection",
    "sensor_back": "sensor_recovered",
}
"""Kinds of format 1 that were renamed in its time, by their old names."""


def _to_2(topic: str, record: Record) -> tuple[str, Record]:
    folder, _, kind = topic.rpartition("/")
    renamed = _KINDS_OF_2.get(kind, kind)
    if kind == "gap":
        folder = "/recorder"
    fields = record | {"kind": renamed} if "kind" in record else dict(record)
    if kind == "discarded" and "room" in fields:
        fields["component"] = fields.pop("room")
    return f"{folder}/{renamed}", fields


def _header_to_2(header: Record) -> Record:
    config = dict(header.get("config", {}))
    if "watch" in config:
        config["sensor_timeouts"] = config.pop("watch")
    return header | {"config": config}


def _to_3(topic: str, record: Record) -> tuple[str, Record]:
    return topic, record  # a drive whose seed never changes, without `entropy_input`


def _to_4(topic: str, record: Record) -> tuple[str, Record]:
    return topic, record  # a camera that nothing impairs, without `sensor_impaired`


def _to_5(topic: str, record: Record) -> tuple[str, Record]:
    return topic, record  # no program has a message sent, without `program_message`


_MIGRATIONS: Mapping[int, tuple[Migration, Callable[[Record], Record]]] = {
    1: (_to_2, _header_to_2),
    2: (_to_3, lambda header: header),
    3: (_to_4, lambda header: header),
    4: (_to_5, lambda header: header),
}
"""By the format that they start from."""
OLDEST = min(_MIGRATIONS)
"""The oldest format that is read."""


def migrated(topic: str, record: Record, written: int, wanted: int) -> tuple[str, Record]:
    """Return topic and fields of a record of format `written` in format `wanted`."""
    for version in range(written, wanted):
        topic, record = _MIGRATIONS[version][0](topic, record)
    return topic, record


def migrated_header(header: Record, written: int, wanted: int) -> Record:
    """Return a header of format `written` in format `wanted`."""
    for version in range(written, wanted):
        header = _MIGRATIONS[version][1](header)
    return header
