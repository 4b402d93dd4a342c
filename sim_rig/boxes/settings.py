"""The file that makes a box one of the rig's cars: `sim-rig run SCENARIO --box CAR=FILE`."""

import socket
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Annotated, ClassVar, NamedTuple, Self

from pydantic import Field, StringConstraints, model_validator

from onboard.settings import Settings, SettingsError, load_settings
from sim_rig.scenario.faults import SlowCpu, WrongClock
from sim_rig.scenario.field_types import PlateText
from sim_rig.scenario.schema import Scenario
from sim_rig.scenario.wire_settings import WireSettings

Command = Annotated[tuple[str, ...], Field(min_length=1)]
"""Program and arguments, run without a shell."""


class PowerSettings(Settings):
    """Commands that switch the power of the box, as of a relay. Each is done when it returns."""

    cut: Command
    """Takes the power from the box's computer: `[usbrelay, R_1=1]`."""
    restore: Command
    """Gives it back. The box starts its daemon by itself, as by systemd."""


class PageSettings(Settings):
    """The page of a box, which serves its recording: `hmi.recordings` there."""

    url: Annotated[str, StringConstraints(pattern=r"^https?://[^/?#\s]+/?$")]
    """`http://HOST:PORT`."""
    token_file: Path
    """File with the `hmi.token` of the box."""


class BoxSettings(WireSettings):
    """One box: its wires, its plate, its keys and its recording."""

    elsewhere: ClassVar[Mapping[str, str]] = {
        "car": "is the configuration of a car; the rig needs a file of the box's wires, such as"
        " `onboard example red` writes, and not",
        "cars": "is a scenario, not the file of a box: sim-rig run",
    }

    plate: PlateText
    """Plate in the box's own configuration (or `TAG<n>`); the scenario's car must have it."""
    keys: Path
    """Folder of the trial's keys (docs/in-the-car.md). The rig's cars get certificates of
    `issuing` in it. A folder that does not exist is made, with the keys of the box in `CAR`."""
    recording: Path | None = None
    """Folder of the box's black box as this computer sees it after the run. Without one, as for a
    box of another vendor, only its messages are judged."""
    fetch: Command | None = None
    """Copies the black box to `recording`, in a folder that exists then, when the scenario has
    ended: `[scp, -pr, "root@BOX:/var/lib/onboard/drive", out/red]`."""
    page: PageSettings | None = None
    """Instead of `fetch`: copies what the box has recorded since the rig was started."""
    start: Command | None = None
    """Starts the daemon when the rig's ends of the wires are open, and may run as long as it:
    `[ssh, -tt, BOX, onboard, run, car.yaml]`. If it still runs at the end, it gets SIGTERM."""
    stop: Command | None = None
    """Ends what `start` has left behind, before `fetch`."""
    set_clock: Command | None = None
    """Sets the UTC of the box to that of a drive that is played (`sim-rig play`), of which `{utc}`
    is in s since 1970: `[ssh, "root@BOX", date, -us, "@{utc}"]`."""
    power: PowerSettings | None = None
    """Required in a scenario with `power_cut` of this car."""
    ready_within_s: float = Field(60.0, gt=0.0, le=600.0)
    """Time for the box to use all wires; without `recording`, to send BSMs."""

    @model_validator(mode="after")
    def _has_what_commands_need(self) -> Self:
        if self.fetch is not None and self.page is not None:
            raise ValueError("at most one of fetch and page")
        for filled_by in ("fetch", "page"):
            if getattr(self, filled_by) is not None and self.recording is None:
                raise ValueError(f"{filled_by} needs recording, which it fills")
        if self.stop is not None and self.start is None:
            raise ValueError("stop needs start, which it ends")
        return self


class Address(NamedTuple):
    """One end of a wire."""

    field: str
    kind: socket.SocketKind
    host: str
    port: int
    is_of_rig: bool


def load_boxes(given: Sequence[str], scenario: Scenario) -> dict[str, BoxSettings]:
    """Read the files of the boxes.

    Args:
        given: `CAR=FILE` for each box.
        scenario: the scenario whose cars they are.

    Returns:
        the settings by car.

    Raises:
        SettingsError: a file is missing or does not fit; one line per mistake.
    """
    boxes: dict[str, BoxSettings] = {}
    for each in given:
        car, separator, file = each.partition("=")
        if not separator or not file:
            raise SettingsError(f"--box: must be CAR=FILE (given {each!r})")
        if car not in scenario.equipped:
            allowed = ", ".join(scenario.equipped)
            raise SettingsError(f"--box: no such equipped car (given {car!r}); cars: {allowed}")
        if car in boxes:
            raise SettingsError(f"--box: {car} is given twice")
        boxes[car] = load_settings(Path(file), BoxSettings)
    if mistakes := list(_mistakes(boxes, scenario)):
        raise SettingsError("\n".join(mistakes))
    return boxes


def addresses(box: WireSettings) -> Iterator[Address]:
    """Yield every IP address of a car's wires."""
    stream, datagram = socket.SOCK_STREAM, socket.SOCK_DGRAM
    if box.bus.interface == "socketcand":
        yield Address("bus.port", stream, str(box.bus.host), box.bus.port, is_of_rig=True)
    yield Address("camera.port", stream, str(box.camera.host), box.camera.port, is_of_rig=True)
    radio = box.radio
    yield Address("radio.port", datagram, str(radio.host), radio.port, is_of_rig=True)
    yield Address("radio.box_port", datagram, str(radio.box_host), radio.box_port, is_of_rig=False)
    if box.controller is not None:
        host, port = str(box.controller.host), box.controller.port
        yield Address("controller.port", datagram, host, port, is_of_rig=True)
    for field, wire in (("satellites.port", box.satellites), ("detector.port", box.detector)):
        if wire is not None and wire.port is not None:
            yield Address(field, datagram, str(wire.host), wire.port, is_of_rig=False)


def _mistakes(boxes: Mapping[str, BoxSettings], scenario: Scenario) -> Iterator[str]:
    for car, box in boxes.items():
        identity = scenario.cars[car].identity
        if box.plate != identity:
            yield f"{car}: plate: {car} has {identity} in the scenario (given {box.plate})"
        if scenario.gnss is not None and box.satellites is None:
            yield f"{car}: satellites: is required, since the scenario has gnss"
        if scenario.detector is not None and box.detector is None:
            yield f"{car}: detector: is required, since the scenario has one"
        if scenario.cars[car].obeys_request and box.controller is None:
            yield f"{car}: controller: is required, since {car} obeys_request"
        if any(fault.car == car for fault in scenario.power_cuts()) and box.power is None:
            yield f"{car}: power: is required, since the scenario has a power_cut of {car}"
        for field in ("bus", "satellites"):
            serial = getattr(getattr(box, field), "serial", None)
            if serial is not None and not serial.exists():
                yield f"{car}: {field}.serial: there is no {serial}"
        for fault in scenario.faults:
            if fault.car == car and isinstance(fault, SlowCpu | WrongClock):
                yield f"{car}: the fault {fault.what} needs a process, and {car} is a box"
    yield from _repeated(boxes)
    if len({box.keys.resolve() for box in boxes.values()}) > 1:
        folders = ", ".join(str(box.keys) for box in boxes.values())
        yield f"keys: all boxes of a run need the same folder (given {folders})"
    yield from _taken(boxes)


def _repeated(boxes: Mapping[str, BoxSettings]) -> Iterator[str]:
    """Yield addresses that two wires share, and buses of the kernel that two boxes share."""
    all_of_them = [(car, each) for car, box in boxes.items() for each in addresses(box)]
    for (car, one), (other_car, other) in combinations(all_of_them, 2):
        same_host = one.host == other.host or "0.0.0.0" in (one.host, other.host)  # noqa: S104 (compared, not bound)
        if one.kind == other.kind and one.port == other.port and same_host:
            place = f"{one.host}:{one.port}"
            yield f"{other_car}: {other.field}: {place} is {one.field} of {car} already"
    cars: dict[str, str] = {}
    for car, box in boxes.items():
        if box.bus.interface == "socketcand":
            continue
        field = "channel" if box.bus.serial is None else "serial"
        bus = str(getattr(box.bus, field))
        if cars.setdefault(bus, car) != car:
            yield f"{car}: bus.{field}: {bus} is of {cars[bus]} already"


def _taken(boxes: Mapping[str, BoxSettings]) -> Iterator[str]:
    for car, box in boxes.items():
        for each in addresses(box):
            if each.is_of_rig and (why := _why_not_bound(each)) is not None:
                yield f"{car}: {each.field}: {each.host}:{each.port} cannot be opened: {why}"


def _why_not_bound(address: Address) -> str | None:
    with socket.socket(socket.AF_INET, address.kind) as probe:
        if address.kind == socket.SOCK_STREAM:  # as servers of asyncio do
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((address.host, address.port))
        except OSError as error:
            return error.strerror or str(error)
    return None
