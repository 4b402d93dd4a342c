"""What programs may send to the live interface."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.errors import DecodeError
from onboard.interface.requests import (
    MOST_KINDS,
    BrakeButtonPress,
    ObjectList,
    Subscribe,
    read_request,
)
from onboard.settings import SettingsError, parse_settings
from onboard.vehicle.config import CarConfig

ALL = ("brake_button", "object_list")


def line(**fields: object) -> bytes:
    return json.dumps(fields).encode() + b"\n"


def test_each_kind_is_read() -> None:
    assert read_request(line(kind="subscribe", kinds=["alarm"]), ()) == Subscribe(
        kind="subscribe", kinds=["alarm"]
    )
    assert isinstance(read_request(line(kind="brake_button"), ALL), BrakeButtonPress)
    assert isinstance(read_request(line(kind="object_list", cars=[]), ALL), ObjectList)


@pytest.mark.parametrize("kind", ALL)
def test_what_the_configuration_does_not_permit_is_refused(kind: str) -> None:
    with pytest.raises(DecodeError) as refused:
        read_request(line(kind=kind), [each for each in ALL if each != kind])

    assert refused.value.reason == "not_permitted"
    assert kind in refused.value.detail


@pytest.mark.parametrize(
    "malformed",
    [
        b"",
        b"\xff\n",
        b"[]\n",
        b"{}\n",
        line(kind="brake"),
        line(kind="brake_button", again=True),
        line(kind="subscribe"),
        line(kind="subscribe", kinds="alarm"),
        line(kind="subscribe", kinds=["alarm"] * (MOST_KINDS + 1)),
        b"[" * 10_000,
    ],
)
def test_malformed_lines_are_refused(malformed: bytes) -> None:
    with pytest.raises(DecodeError) as refused:
        read_request(malformed, ALL)

    assert refused.value.reason == "malformed"


@given(st.binary(max_size=200))
def test_whatever_else_comes_is_refused(data: bytes) -> None:
    with pytest.raises(DecodeError, match="malformed"):
        read_request(data, ALL)


def test_lists_of_a_detector_need_its_section() -> None:
    tree: dict[str, object] = {"car": {"plate": "AAA1"}, "interface": {"accepts": ["object_list"]}}
    with pytest.raises(SettingsError, match=r"interface: .*requires the section `detector`"):
        parse_settings(tree, CarConfig, "a test")

    parse_settings(tree | {"detector": {}}, CarConfig, "a test")
