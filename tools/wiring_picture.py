"""Draws how a box is wired to the rig, with the limits of a run: docs/pictures/bench-wiring.png.

.venv/bin/python -m tools.wiring_picture
"""

from pathlib import Path
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from sim_rig.run_log.lateness import LIMITS_S

PICTURE = Path(__file__).parents[1] / "docs" / "pictures" / "bench-wiring.png"
_RIG, _BOX = (0.0, 2.6), (7.4, 10.0)
"""Left and right end of each computer."""
_BUS, _NETWORK, _SERIAL, _POWER = "tab:orange", "tab:blue", "tab:green", "tab:red"


class _Wire(NamedTuple):
    at_rig: str
    medium: str
    at_box: str
    colour: str
    kinds: tuple[str, ...]
    """What is on it, as `LIMITS_S` names it."""


_WIRES = (
    _Wire(
        "CAN adapter", "CAN 500 kbit/s, 120 Ω at both ends", "CAN adapter", _BUS, ("ECU answer",)
    ),
    _Wire("pictures", "Ethernet: MJPEG over HTTP", "camera process", _NETWORK, ("picture",)),
    _Wire("radio unit", "Ethernet: WSMs (UDP)", "radio port", _NETWORK, ("WSM",)),
    _Wire("detector", "Ethernet: detections (UDP)", "detector port", _NETWORK, ("detection",)),
    _Wire("GNSS receiver", "NMEA: UDP or serial line", "gpsd", _SERIAL, ("fix",)),
    _Wire("chrony (server)", "Ethernet: clock (NTP)", "chrony (iburst)", _NETWORK, ()),
    _Wire("USB relay", "switches 12 V, for power-cut", "power supply", _POWER, ()),
)


def draw() -> Figure:
    """Return the picture."""
    figure = Figure(figsize=(9.0, 4.4), layout="constrained")
    axes = figure.add_subplot()
    axes.set_axis_off()
    axes.set_xlim(-0.1, 10.1)
    axes.set_ylim(-0.5, len(_WIRES) + 0.7)
    for (left, right), name in (
        (_RIG, "rig's computer\n192.168.77.1"),
        (_BOX, "box\n192.168.77.2"),
    ):
        height = len(_WIRES) + 0.9
        axes.add_patch(Rectangle((left, -0.4), right - left, height, fill=False, linewidth=1.5))
        axes.text((left + right) / 2, len(_WIRES) - 0.2, name, ha="center", weight="bold")
    for row, wire in enumerate(reversed(_WIRES)):
        _draw(axes, wire, row)
    return figure


def _draw(axes: Axes, wire: _Wire, y: float) -> None:
    (_, left), (right, _) = _RIG, _BOX
    axes.plot((left, right), (y, y), color=wire.colour, linewidth=2.0, marker="s", markersize=6)
    axes.text(left - 0.15, y, wire.at_rig, ha="right", va="center")
    axes.text(right + 0.15, y, wire.at_box, ha="left", va="center")
    limits = [f"limit {LIMITS_S[kind] * 1e3:.0f} ms" for kind in wire.kinds]
    label = ", ".join((wire.medium, *limits))
    axes.text((left + right) / 2, y + 0.14, label, ha="center", va="bottom", fontsize=9)


if __name__ == "__main__":
    draw().savefig(PICTURE, dpi=110)
