"""Traffic from SUMO, in this process by libsumo: one simulation at a time, stepped as we ask.

`networks/` holds a dense crossing and a highway; `netconvert -c NAME.netccfg` has made their nets.
A simulation of one's own is the `.sumocfg` of its network and routes.
"""

import gzip
import math
from pathlib import Path
from typing import Self
from xml.etree import ElementTree as ET

import libsumo
import numpy as np
from typing_extensions import override

from onboard.errors import UserError
from sim_rig.roads.cars import Cars, Traffic

NETWORKS = Path(__file__).with_name("networks")
STEP_S = 0.1
_OPTIONS = (
    "--step-length", str(STEP_S),
    "--route-steps", "100000000",  # all routes are read, and checked, in the first step
    "--time-to-teleport", "-1",  # who is stuck stays where he is
    "--collision.action", "none",  # crashes are found from the boxes, as everywhere
    "--no-step-log", "--no-warnings",
)  # fmt: skip


class SumoError(UserError):
    """What SUMO says is wrong with a simulation."""


class SumoTraffic(Traffic):
    """Steps one simulation; SUMO's own random numbers come from `seed`."""

    def __init__(self, config: Path, seed: int) -> None:
        """Load the simulation.

        Raises:
            SumoError: it cannot be loaded, its network does not fit its routes, or this process
                runs one already.
        """
        if libsumo.simulation.isLoaded():
            raise SumoError(f"{config}: this process runs a simulation of SUMO already")
        self._config, self._step = config, 0
        _check_network(config)
        try:
            libsumo.start(["sumo", "-c", str(config), "--seed", str(seed), *_OPTIONS])
            libsumo.simulationStep()  # the first puts on the road who is there at its beginning
        except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
            self.close()
            raise self._wrong(error) from None
        self._cars = self._look()

    @override
    def cars_at(self, at_s: float) -> Cars:
        """Step up to `at_s`; between steps cars go straight on.

        Raises:
            SumoError: a car that is to come has no way through the network.
        """
        try:
            while (self._step + 1) * STEP_S <= at_s + 1e-9:
                libsumo.simulationStep()
                self._step += 1
                self._cars = self._look()
        except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
            self.close()
            raise self._wrong(error) from None
        return self._cars.moved_on(max(at_s - self._step * STEP_S, 0.0))

    def close(self) -> None:
        """End the simulation; another one may begin."""
        if libsumo.simulation.isLoaded():
            libsumo.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _look(self) -> Cars:
        vehicle = libsumo.vehicle
        names = tuple(vehicle.getIDList())
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

    def _wrong(self, error: Exception) -> SumoError:
        return SumoError(f"{self._config}: SUMO says: {' '.join(str(error).split())}")


def _check_network(config: Path) -> None:
    """Whether the network is there and is XML; a process that had SUMO fail on it is lost."""
    try:
        named = ET.parse(config).iter("net-file")  # noqa: S314 (the user's own file)
    except (OSError, ET.ParseError):
        return  # of its configuration SUMO itself says what is wrong
    for option in named:
        network = config.parent / option.get("value", "")
        opened = gzip.open if network.suffix == ".gz" else open
        try:
            with opened(network, "rb") as file:
                for _, element in ET.iterparse(file):  # noqa: S314 (as above)
                    element.clear()
        except (OSError, EOFError) as error:
            said = getattr(error, "strerror", None) or error
            raise SumoError(f"{config}: its network {network} cannot be read: {said}") from error
        except ET.ParseError as error:
            raise SumoError(f"{config}: its network {network} is no XML: {error}") from error
