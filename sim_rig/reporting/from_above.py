"""A self-contained HTML page with an animated map of a run: the cars from above."""

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path

from onboard.errors import UserError
from sim_rig.roads.crashes import Crash

_PAGE = Path(__file__).with_name("from_above.html")


@dataclass(slots=True)
class MapFrame:
    """All cars at one time."""

    at: float
    cars: dict[str, list[float]]
    """Position of the middle, heading, and speed of each car."""
    disturbed: list[str] = field(default_factory=list)
    """Cars that no longer follow the recorded traffic."""
    equipped: list[str] | None = None
    """Cars with a radio; None after the radios are switched off."""
    sent: list[tuple[str, int]] = field(default_factory=list)
    """Senders, and the number of entries in their footers."""
    warned: list[tuple[str, str, bool, str | None, list[float]]] = field(default_factory=list)
    """Warned car, cause, whether the warning was true when it began, the car that it is about, and
    the estimated position of that car."""
    perceived: dict[str, list[tuple[str, str]]] = field(default_factory=dict)
    """Perceived objects of each car with a radio, with their sources."""


@dataclass(slots=True)
class Animation:
    """Data of the page: a frame for each tenth of a second, the last one at the crash, if any."""

    title: str = ""
    event_s: float = 0.0
    event_car: str = ""
    """The car of the event; empty if the run has none. The map then follows the radios."""
    summary: str = ""
    """The event, and its outcome with radios and without."""
    crash: Crash | None = None
    crash_without_radios: Crash | None = None
    frames_without_radios: list[MapFrame] = field(default_factory=list)
    """The two cars of that crash, as they drive without radios."""
    sizes: dict[str, tuple[float, float]] = field(default_factory=dict)
    paths: list[list[list[float]]] = field(default_factory=list)
    """Path of each car, from the beginning of its trajectory to the end."""
    frames: list[MapFrame] = field(default_factory=list)

    def write(self, page: Path) -> None:
        """Write the page."""
        data = json.dumps(asdict(self), separators=(",", ":")).replace("<", "\\u003c")
        page.write_text(_PAGE.read_text("utf-8").replace("/*ANIMATION*/null", data), "utf-8")


def check_is_file(page: Path) -> None:
    """Raise `UserError` if a page cannot be written because `page` is a folder."""
    if page.is_dir():
        raise UserError(f"{page}: is a folder; name the file to write")
