"""Traffic from SUMO, run in this process by libsumo, one simulation at a time: other threads wait.

`networks/` has a dense crossing, a grid and a highway; `netconvert -c NAME.netccfg` makes their
nets. Other simulations are given by the `.sumocfg` of their network and routes.
"""

import gzip
import math
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Self
from xml.etree import ElementTree as ET

import numpy as np
from typing_extensions import override

from onboard.errors import UserError
from sim_rig.roads.cars import Cars, Guests, Traffic, no_guests
from sim_rig.roads.road import CarState

try:
    import libsumo
except ModuleNotFoundError:
    raise
except ImportError as error:  # its wheel leaves these to the system, and small ones lack them
    packages = "libgl1 libxext6 libxrender1 libatomic1"
    raise UserError(f"SUMO cannot be loaded: {error} (Debian: {packages})") from error

NETWORKS = Path(__file__).with_name("networks")
STEP_S = 0.1
_OPTIONS = (
    "--step-length", str(STEP_S),
    "--route-steps", "100000000",  # read and check all routes in the first step
    "--time-to-teleport", "-1",  # stuck cars are not moved
    "--collision.action", "none",  # crashes are detected by `crashes.py`
    "--no-step-log", "--no-warnings",
)  # fmt: skip


MAKE_ROOM_M = 30.0
"""Within this distance of where a guest comes, SUMO's cars are taken off the road."""
_GUEST_ROUTE, _FREELY = "", 2  # without a route; `keepRoute` of `moveToXY`: to any place


_SIMULATION = threading.RLock()
"""Held from the start of a simulation to its end: libsumo has one for all threads of a process."""


class SumoError(UserError):
    """SUMO cannot run a simulation."""


class SumoTraffic(Traffic):
    """Steps one simulation, whose drivers react to its guests."""

    def __init__(self, config: Path, seed: int, guests: Guests = no_guests) -> None:
        """Load the simulation, when those of other threads have ended.

        Args:
            config: the `.sumocfg`.
            seed: of SUMO's random numbers.
            guests: cars that SUMO does not drive; none by default.

        Raises:
            SumoError: it cannot be loaded, its routes do not match its network, or this thread
                already runs a simulation.
        """
        self._config, self._step = config, 0
        self._guests, self._present = guests, set[str]()
        _check_network(config)
        _SIMULATION.acquire()
        if libsumo.simulation.isLoaded():
            _SIMULATION.release()
            raise SumoError(f"{config}: this thread already runs a simulation of SUMO")
        self._is_running = True
        try:
            libsumo.start(["sumo", "-c", str(config), "--seed", str(seed), *_OPTIONS])
            libsumo.simulationStep()  # the first step inserts the cars that depart at 0 s
        except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
            self.close()
            raise self._wrong(error) from None
        self._cars = self._look()

    @override
    def cars_at(self, at_s: float) -> Cars:
        """Step up to `at_s`; between steps cars go straight on.

        Raises:
            SumoError: a departing car has no route through the network.
        """
        try:
            while (self._step + 1) * STEP_S <= at_s + 1e-9:
                self._step += 1
                self._place_guests(self._guests(self._step * STEP_S))
                libsumo.simulationStep()
                self._cars = self._look()
        except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
            self.close()
            raise self._wrong(error) from None
        return self._cars.moved_on(max(at_s - self._step * STEP_S, 0.0))

    @override
    def close(self) -> None:
        """End the simulation, so that another one can start; by the thread that started it."""
        if self._is_running:
            self._is_running = False
            if libsumo.simulation.isLoaded():
                libsumo.close()
            _SIMULATION.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _look(self) -> Cars:
        vehicle = libsumo.vehicle
        names = tuple(name for name in vehicle.getIDList() if name not in self._present)
        rows = [
            (*vehicle.getPosition(name), vehicle.getAngle(name), vehicle.getSpeed(name),
             vehicle.getAcceleration(name), vehicle.getLength(name), vehicle.getWidth(name))
            for name in names
        ]  # fmt: skip
        x, y, angle_deg, speed, acceleration, length, width = np.array(rows).reshape(-1, 7).T
        heading = math.pi / 2.0 - np.radians(angle_deg)
        ahead = np.stack([np.cos(heading), np.sin(heading)], axis=1)
        middle = np.stack([x, y], axis=1) - length[:, None] / 2.0 * ahead
        at_s = self._step * STEP_S
        return Cars(at_s, names, middle, heading, speed, acceleration, length, width)

    def _place_guests(self, guests: Mapping[str, CarState]) -> None:
        """Say where the guests are at the end of the next step."""
        vehicle = libsumo.vehicle
        for name, state in guests.items():
            if name not in self._present:
                self._make_room(state)
                self._present.add(name)
                vehicle.add(name, _GUEST_ROUTE)
                vehicle.setLength(name, state.length_m)
                vehicle.setWidth(name, state.width_m)
            front = state.point(state.length_m / 2.0, 0.0)
            heading_deg = math.degrees(state.heading_rad) % 360.0
            vehicle.moveToXY(name, "", -1, *front, heading_deg, _FREELY)
            vehicle.setSpeed(name, state.speed_m_s)

    def _make_room(self, state: CarState) -> None:
        cars = self._look()
        off_m = np.hypot(*(cars.middle_m - (state.x_m, state.y_m)).T)
        for index in np.flatnonzero(off_m < MAKE_ROOM_M):
            libsumo.vehicle.remove(cars.names[index])

    def _wrong(self, error: Exception) -> SumoError:
        return SumoError(f"{self._config}: SUMO says: {' '.join(str(error).split())}")


def _check_network(config: Path) -> None:
    """Check that the network exists and is XML: SUMO is unusable after failing to load it."""
    try:
        named = ET.parse(config).iter("net-file")  # noqa: S314 (the user's own file)
    except (OSError, ET.ParseError):
        return  # SUMO reports errors of its configuration itself
    for option in named:
        network = config.parent / option.get("value", "")
        opened = gzip.open if network.suffix == ".gz" else open
        try:
            with opened(network, "rb") as file:
                for _, element in ET.iterparse(file):  # noqa: S314 (as above)
                    element.clear()
        except (OSError, EOFError) as error:
            reason = getattr(error, "strerror", None) or error
            raise SumoError(f"{config}: its network {network} cannot be read: {reason}") from error
        except ET.ParseError as error:
            raise SumoError(f"{config}: its network {network} is not XML: {error}") from error
