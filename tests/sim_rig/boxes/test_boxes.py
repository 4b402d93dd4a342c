"""The file of a box, and the verdict on a run with one."""

import os
import re
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from onboard.errors import UserError
from onboard.security.key_files import KeyFilesError
from onboard.security.settings import PlateDigestSettings
from onboard.settings import SettingsError, load_settings, parse_settings
from onboard.vehicle.config import CarConfig
from onboard.wave_udp.settings import IwcuSettings
from sim_rig.boxes.settings import BoxSettings, load_boxes
from sim_rig.boxes.trial_keys import run_credentials
from sim_rig.cars.camera_view import calibration
from sim_rig.reporting.verdict import Outcome, verdict
from sim_rig.run_log.clock_offset import ClockOffset
from sim_rig.run_log.lateness import LIMITS_S, Lateness
from sim_rig.run_log.run_log import RunLog
from sim_rig.runs.command import run_scenario
from sim_rig.scenario.car_config import DIGEST
from sim_rig.scenario.schema import Scenario, load_scenario

EXAMPLES = Path(__file__).parents[3] / "examples" / "box"
BUS = 20_000 + os.getpid() % 500 * 20
CAMERA, UNIT = BUS + 1, BUS + 2
"""Ports of the rig: below those that Linux gives away by itself, others in each process."""


@pytest.fixture
def fig4() -> Scenario:
    return load_scenario("fig4")


def box(folder: Path, plate: str, first_port: int = BUS, **changed: object) -> dict[str, object]:
    return {
        "plate": plate,
        "bus": {"port": first_port},
        "camera": {"port": first_port + 1},
        "radio": {"port": first_port + 2, "box_port": first_port + 3},
        "keys": str(folder / "keys"),
        "recording": str(folder / "drive"),
        **changed,
    }


def written(folder: Path, name: str, tree: object) -> str:
    (folder / f"{name}.yaml").write_text(yaml.safe_dump(tree))
    return f"{name}={folder / name}.yaml"


def mistakes(scenario: Scenario, *given: str) -> str:
    with pytest.raises(SettingsError) as found:
        load_boxes(given, scenario)
    return str(found.value)


def test_a_box_listens_on_loopback_unless_its_file_names_another_address(
    fig4: Scenario, tmp_path: Path
) -> None:
    boxes = load_boxes([written(tmp_path, "red", box(tmp_path, "RD288HX"))], fig4)

    red = boxes["red"]
    hosts = [red.bus.host, red.camera.host, red.radio.host, red.radio.box_host]
    assert all(host.is_loopback for host in hosts)


def test_virtual_others_need_a_box(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="--virtual-others: needs --box"):
        run_scenario("fig4", tmp_path, virtual=False, seed=None, watch=False, virtual_others=True)


@pytest.mark.parametrize(
    ("given", "mistake"),
    [
        ("red", "must be CAR=FILE (given 'red')"),
        ("pink=p.yaml", "no such equipped car (given 'pink'); cars: green, red, blue, yellow"),
        ("red=missing.yaml", "missing.yaml: cannot be read: No such file"),
    ],
)
def test_what_is_no_box_is_named(fig4: Scenario, given: str, mistake: str) -> None:
    assert mistake in mistakes(fig4, given)


def test_the_configuration_of_a_car_or_a_scenario_is_no_box(fig4: Scenario) -> None:
    car = EXAMPLES / "car.yaml"
    scenario = EXAMPLES.parents[1] / "sim_rig/scenarios/fig4.yaml"

    assert mistakes(fig4, f"red={car}").startswith(f"{car}: is the configuration of a car; the rig")
    assert mistakes(fig4, f"red={scenario}").endswith(
        f"not the file of a box: sim-rig run {scenario}"
    )


def test_a_wire_named_twice_is_named(fig4: Scenario, tmp_path: Path) -> None:
    (tmp_path / "red.yaml").write_text("bus: {port: 1}\nbus: {port: 2}\n")
    assert "key 'bus' is repeated" in mistakes(fig4, f"red={tmp_path}/red.yaml")


def test_another_plate_than_the_scenario_s_is_named(fig4: Scenario, tmp_path: Path) -> None:
    given = written(tmp_path, "red", box(tmp_path, "XX1"))
    assert "plate: red has RD288HX in the scenario (given XX1)" in mistakes(fig4, given)


def test_two_boxes_with_one_address_are_named(fig4: Scenario, tmp_path: Path) -> None:
    red = written(tmp_path, "red", box(tmp_path, "RD288HX"))
    blue = written(tmp_path, "blue", box(tmp_path, "BL635TN", keys="elsewhere"))
    found = mistakes(fig4, red, blue)
    assert f"blue: bus.port: 127.0.0.1:{BUS} is bus.port of red already" in found
    assert f"blue: radio.port: 127.0.0.1:{UNIT} is radio.port of red already" in found
    assert "all boxes of a run need the same folder" in found
    assert "red is given twice" in mistakes(fig4, red, red)


def test_one_kernel_interface_is_the_bus_of_one_box(fig4: Scenario, tmp_path: Path) -> None:
    vcan = {"interface": "socketcan", "channel": "vcan0"}
    red = written(tmp_path, "red", box(tmp_path, "RD288HX", bus=vcan))
    blue = written(tmp_path, "blue", box(tmp_path, "BL635TN", BUS + 10, bus=vcan))
    assert "blue: bus.channel: vcan0 is of red already" in mistakes(fig4, red, blue)


def test_a_serial_line_is_the_bus_of_one_box_and_is_there(fig4: Scenario, tmp_path: Path) -> None:
    slcan = {"interface": "slcan", "serial": str(tmp_path / "ttyS9")}
    red = written(tmp_path, "red", box(tmp_path, "RD288HX", bus=slcan))
    blue = written(tmp_path, "blue", box(tmp_path, "BL635TN", BUS + 10, bus=slcan))
    found = mistakes(fig4, red, blue)
    assert f"red: bus.serial: there is no {tmp_path}/ttyS9" in found
    assert f"blue: bus.serial: {tmp_path}/ttyS9 is of red already" in found
    red = written(tmp_path, "red", box(tmp_path, "RD288HX", bus={"interface": "slcan"}))
    assert "serial is required with slcan, and with nothing else" in mistakes(fig4, red)


def test_wires_that_the_scenario_needs_are_named(tmp_path: Path) -> None:
    given = written(tmp_path, "ann", box(tmp_path, "RA111AA"))
    assert "satellites: is required" in mistakes(load_scenario("red-light"), given)
    line = {"serial": str(tmp_path / "ttyS9")}
    given = written(tmp_path, "ann", box(tmp_path, "RA111AA", satellites=line))
    assert f"there is no {tmp_path}/ttyS9" in mistakes(load_scenario("red-light"), given)


def test_a_fault_of_a_process_cannot_be_put_on_a_box(tmp_path: Path) -> None:
    scenario = load_scenario("wrong-clocks")
    car = next(fault.car for fault in scenario.faults)
    own = box(tmp_path, scenario.cars[car].identity, satellites={"port": 5000})
    assert "needs a process" in mistakes(scenario, written(tmp_path, car, own))


def test_a_power_cut_of_a_box_needs_its_commands(tmp_path: Path) -> None:
    given = written(tmp_path, "red", box(tmp_path, "RD288HX"))
    found = mistakes(load_scenario("power-cut"), given)
    assert "red: power: is required, since the scenario has a power_cut of red" in found


@pytest.mark.parametrize(
    ("changed", "mistake"),
    [
        ({"stop": ["true"]}, "stop needs start, which it ends"),
        ({"recording": None, "fetch": ["true"]}, "fetch needs recording, which it fills"),
        ({"page": {"url": "ftp://box", "token_file": "t"}}, "page.url: "),
        (
            {"page": {"url": "http://box", "token_file": "t"}, "fetch": ["true"]},
            "at most one of fetch and page",
        ),
        ({"power": {"cut": ["true"]}}, "power.restore: is required and missing"),
        ({"power": {"cut": [], "restore": ["true"]}}, "power.cut: "),
        ({"start": "ssh desk2"}, "start: "),
    ],
)
def test_commands_that_lack_something_are_named(
    fig4: Scenario, tmp_path: Path, changed: dict[str, Any], mistake: str
) -> None:
    given = written(tmp_path, "red", box(tmp_path, "RD288HX", **changed))
    assert mistake in mistakes(fig4, given)


def test_two_wires_of_one_box_with_one_address_are_named(fig4: Scenario, tmp_path: Path) -> None:
    given = written(tmp_path, "red", box(tmp_path, "RD288HX", camera={"port": BUS}))
    assert f"red: camera.port: 127.0.0.1:{BUS} is bus.port of red already" in mistakes(fig4, given)


@pytest.mark.long
def test_a_box_s_certificates_of_another_plate_are_named(fig4: Scenario, tmp_path: Path) -> None:
    """The rig's vehicles would discard what it sends."""
    boxes = load_boxes([written(tmp_path, "red", box(tmp_path, "RD288HX"))], fig4)
    trial = run_credentials(fig4, boxes, 1_750_000_000.0)
    assert trial["red"].commit_to_ids
    run_credentials(fig4, boxes, 1_750_000_000.0)
    red = fig4.cars["red"].model_copy(update={"plate": "XX1"})
    renamed = fig4.model_copy(update={"cars": {**fig4.cars, "red": red}})
    with pytest.raises(KeyFilesError, match=r"keys/red/pseudonyms/0\d\d\.cert: .* than XX1"):
        run_credentials(renamed, boxes, 1_750_000_000.0)


@pytest.mark.long
def test_a_vehicle_beside_a_box_signs_in_all_runs_as_the_same(
    fig4: Scenario, tmp_path: Path
) -> None:
    """The box would distrust an ID that two signers use."""
    boxes = load_boxes([written(tmp_path, "red", box(tmp_path, "RD288HX"))], fig4)
    at_utc_s = 1_750_000_000.0
    first, next_run, next_day = (
        [own.certificate for own in run_credentials(fig4, boxes, utc_s)["green"].pseudonyms]
        for utc_s in (at_utc_s, at_utc_s + 90.0, at_utc_s + 86_400.0)
    )

    assert next_run == first
    assert not {each.hashed_id8 for each in next_run} & {each.hashed_id8 for each in next_day}


def test_a_folder_of_keys_without_an_authority_is_named(fig4: Scenario, tmp_path: Path) -> None:
    (tmp_path / "keys").mkdir()
    red = load_boxes([written(tmp_path, "red", box(tmp_path, "RD288HX"))], fig4)
    with pytest.raises(
        KeyFilesError, match=r"keys/issuing: cannot be read: No such file.*`onboard keys`"
    ):
        run_credentials(fig4, red, 1_750_000_000.0)


def test_an_empty_command_is_named(fig4: Scenario, tmp_path: Path) -> None:
    given = written(tmp_path, "red", box(tmp_path, "RD288HX", fetch=[]))
    assert "red.yaml: fetch: " in mistakes(fig4, given)


@pytest.fixture
def taken_port() -> Iterator[int]:
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


def test_a_port_that_is_taken_is_named(fig4: Scenario, tmp_path: Path, taken_port: int) -> None:
    own = box(tmp_path, "RD288HX", camera={"port": taken_port})
    found = mistakes(fig4, written(tmp_path, "red", own))
    assert f"red: camera.port: 127.0.0.1:{taken_port} cannot be opened: Address already" in found


def joined_at(at_s: float, clock: ClockOffset | None, **other: object) -> RunLog:
    joined = {"kind": "transition", "state": "member", "group_number": 2, "leader_id": "green"}
    return RunLog(
        100.0,
        {"red": [joined | {"stamp_s": 100.0 + at_s}]},
        [],
        {},
        clocks={} if clock is None else {"red": [clock]},
        **other,  # type: ignore[arg-type]
    )


@pytest.fixture
def joins(fig4: Scenario) -> Scenario:
    """It expects that red is a member at 6 s."""
    return fig4.model_copy(update={"expect": fig4.expect[:1]})


@pytest.mark.parametrize(
    ("at_s", "uncertainty_s", "outcome"),
    [
        (5.9, 0.05, Outcome.PASSED),
        (5.9, 0.2, Outcome.INVALID),
        (6.1, 0.2, Outcome.INVALID),
        (6.1, 0.05, Outcome.FAILED),
    ],
)
def test_what_the_clock_does_not_decide_is_not_judged(
    joins: Scenario, at_s: float, uncertainty_s: float, outcome: Outcome
) -> None:
    found = verdict(joins, joined_at(at_s, ClockOffset(7.0, uncertainty_s, 10, 10)))
    assert found.outcome is outcome
    if outcome is Outcome.INVALID:
        assert (
            "the clock is not known well enough to say whether red is still regular"
            in (found.invalid[0])
        )


def test_a_box_without_a_record_fails_nothing(joins: Scenario) -> None:
    log = RunLog(100.0, {"red": []}, [], {}, unjudged={"red": "no recording"})
    found = verdict(joins, log)
    assert (found.outcome, found.failures) == (Outcome.INVALID, ())
    assert found.invalid == ("red: not judged: no recording",)


def test_a_box_without_a_recording_is_judged_by_its_messages_and_deliveries(
    fig4: Scenario,
) -> None:
    joins = {"what": "sent", "message": "join", "cars": ["red"], "from_s": 0, "until_s": 9}
    arrives = {"what": "delivered", "sender": "red", "car": "blue", "from_s": 0, "until_s": 9}
    expect = [
        fig4.expect[0].model_dump(),
        {"what": "warning", "braking": "red", "at_s": [5.0], "within_s": {"blue": 1.0}},
        joins | {"at_least": 1},
        joins | {"at_most": 0},
        arrives | {"at_least": 1},
    ]
    scenario = parse_settings(
        fig4.model_dump(exclude={"expect"}) | {"expect": expect}, Scenario, "fig4"
    )
    join = {"stamp_s": 103.0, "kind": "sent", "message": "join"}
    log = RunLog(
        100.0,
        {"red": [join], "blue": [{"stamp_s": 105.5, "kind": "warning", "origin_id": "aa"}]},
        [],
        {"aa": "red"},
        by_messages=frozenset({"red"}),
    )

    found = verdict(scenario, log)
    assert found.not_judged == ("expect.0 (state): red has no recording",)
    assert found.failures == (
        "sent join: 1 times by red, at most 0",
        "blue receives 0 frames of red, at least 1",
    )
    alone = verdict(scenario.model_copy(update={"expect": scenario.expect[:1]}), log)
    assert alone.outcome is Outcome.INVALID
    both = verdict(scenario.model_copy(update={"expect": scenario.expect[:3]}), log)
    assert (both.outcome, both.invalid) == (Outcome.PASSED, ())


def test_a_late_rig_makes_the_run_of_a_box_invalid(joins: Scenario) -> None:
    lateness = Lateness()
    for late_s in (0.001, 0.001, 2 * LIMITS_S["picture"]):
        lateness.note("picture", late_s)
    lines = tuple(lateness.lines())

    failed = joined_at(6.5, ClockOffset(7.0, 0.001, 10, 10), lateness=lines)
    found = verdict(joins, failed)
    assert found.outcome is Outcome.INVALID
    assert "the rig was late: picture p99" in found.invalid[0]
    assert "1 of 3 missed" in found.invalid[0]
    met = joined_at(5.9, ClockOffset(7.0, 0.001, 10, 10), lateness=lines)
    assert verdict(joins, met).outcome is Outcome.INVALID


def test_the_schema_of_a_box_is_strict(fig4: Scenario, tmp_path: Path) -> None:
    assert "bus" in BoxSettings.model_fields
    given = written(tmp_path, "red", box(tmp_path, "RD288HX", buss={"port": 1}))
    assert "did you mean bus?" in mistakes(fig4, given)


def test_the_examples_are_two_ends_of_the_same_wires(fig4: Scenario) -> None:
    rig = load_settings(EXAMPLES / "red.yaml", BoxSettings)
    car = load_settings(EXAMPLES / "car.yaml", CarConfig)

    assert car.car.plate == rig.plate == fig4.cars["red"].identity
    assert car.can is not None
    assert (car.can.interface, car.can.channel) == (rig.bus.interface, rig.bus.channel)
    assert car.camera is not None
    assert car.camera.source == f"http://{rig.camera.host}:{rig.camera.port}/red"
    lens = calibration(fig4.lens).model_dump()
    assert {name: getattr(car.camera, name) for name in lens} == lens
    radio = car.radio
    assert isinstance(radio, IwcuSettings)
    assert (radio.unit_host, radio.unit_port) == (rig.radio.host, rig.radio.port)
    assert (radio.listen_host, radio.listen_port) == (rig.radio.box_host, rig.radio.box_port)
    assert car.security.plate_digest == PlateDigestSettings.model_validate(DIGEST)
    assert rig.fetch is not None
    assert rig.recording == Path(rig.fetch[-1]) / "drive"


def test_the_example_of_a_second_box_fits_beside_the_first(fig4: Scenario, tmp_path: Path) -> None:
    given = []
    for car in ("red", "blue"):
        text = (EXAMPLES / f"{car}.yaml").read_text()
        text = re.sub(r"192\.168\.7([78])\.", r"127.0.\1.", text)
        (tmp_path / f"{car}.yaml").write_text(text)
        given.append(f"{car}={tmp_path}/{car}.yaml")

    boxes = load_boxes(given, fig4)
    assert boxes["blue"].start is not None
    assert (boxes["red"].power, boxes["blue"].power) == (None, None)
