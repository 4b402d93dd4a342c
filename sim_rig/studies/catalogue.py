"""The studies by name. Each is imported only when it is asked for."""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from onboard.errors import UserError

Study = Callable[[Path], str]
"""Writes its table, figure and settings into a folder; returns what it found, for people."""

_PLACES = {
    "joerer": "joerer:run",
    "rakhshan-figure6": "rakhshan_drivers:figure6",
    "rakhshan-figure7": "rakhshan_drivers:figure7",
    "rakhshan-figure9": "rakhshan:figure9",
    "rakhshan-figure10": "rakhshan:figure10",
    "rakhshan-figure11": "rakhshan:figure11",
    "rakhshan-sensitivity": "rakhshan:sensitivity",
}


def study_names() -> list[str]:
    """Every study there is."""
    return sorted(_PLACES)


def find_study(name: str) -> Study:
    """Import one study.

    Raises:
        UserError: there is none of this name.
    """
    place = _PLACES.get(name)
    if place is None:
        raise UserError(f"no study {name!r}; there are: {', '.join(study_names())}")
    module, function = place.split(":")
    study: Study = getattr(import_module(f"sim_rig.studies.{module}"), function)
    return study
