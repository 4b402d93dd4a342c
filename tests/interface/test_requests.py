"""What programs may send to the live interface."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.errors import DecodeError
from onboard.interface.requests import (
    MOST_BYTES,
    MOST_KINDS,
    BrakeButtonPress,
    MessageRequest,
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


TIM = 0x83


def test_a_message_of_a_permitted_service_is_read_and_of_another_refused() -> None:
    message = line(kind="message", psid=TIM, data="00ff")
    request = read_request(message, (), [TIM])
    assert isinstance(request, MessageRequest)
    assert (request.user_priority, request.data) == (1, "00ff")
    for sends in ((), (0x84,)):
        with pytest.raises(DecodeError, match=r"not_permitted.*0x83"):
            read_request(message, ("message",), sends)


@pytest.mark.parametrize(
    "wrong",
    [
        {"data": "0"},
        {"data": "xy"},
        {"data": ""},
        {"data": "00" * (MOST_BYTES + 1)},
        {"user_priority": 3},
        {"psid": "0x83"},
    ],
)
def test_a_malformed_message_is_refused(wrong: dict[str, object]) -> None:
    fields: dict[str, object] = {"psid": TIM, "data": "00ff"} | wrong
    with pytest.raises(DecodeError, match="malformed"):
        read_request(line(kind="message", **fields), (), [TIM])


def config_of(profile: str | None, *sends: dict[str, int]) -> CarConfig:
    tree: dict[str, object] = {"car": {"plate": "AAA1"}, "interface": {"sends": list(sends)}}
    if profile is not None:
        tree["radio"] = {"endpoint": "raw", "interface": "air", "profile": profile}
    return parse_settings(tree, CarConfig, "car.yaml")


def test_services_of_programs_are_of_the_profile_and_not_the_vehicles_own() -> None:
    assert TIM in config_of("wave", {"psid": TIM}).psids
    assert config_of("its-g5", {"psid": 0x8B, "btp_port": 2006}).ports_of_programs == {0x8B: 2006}
    for profile, sends, reason in (
        ("wave", {"psid": 0x20}, "own"),
        ("its-g5", {"psid": 0x25, "btp_port": 2006}, "own"),
        ("wave", {"psid": 0x4020}, "lcca_psid"),
        ("wave", {"psid": TIM, "btp_port": 2006}, "btp_port"),
        ("its-g5", {"psid": TIM}, "btp_port"),
        ("its-g5", {"psid": TIM, "btp_port": 2001}, "btp_port"),
        (None, {"psid": TIM}, "radio"),
    ):
        with pytest.raises(SettingsError, match=reason):
            config_of(profile, sends)


def test_a_service_of_programs_that_stands_twice_is_refused() -> None:
    """Else the port of the second one is used, and nobody is told."""
    twice = {"psid": 0x8B, "btp_port": 2006}, {"psid": 0x8B, "btp_port": 2010}
    with pytest.raises(SettingsError, match="0x8B stands twice"):
        config_of("its-g5", *twice)


def test_two_services_of_one_port_are_refused() -> None:
    """Else receivers cannot tell whose message it is."""
    both = {"psid": 0x8B, "btp_port": 2006}, {"psid": 0x8C, "btp_port": 2006}
    with pytest.raises(SettingsError, match="btp_port 2006 stands twice"):
        config_of("its-g5", *both)
