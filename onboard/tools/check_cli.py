"""`onboard check`: the mistakes in a configuration."""

from pathlib import Path
from typing import Annotated

import typer

from onboard.obd.dbc_file import read_signals
from onboard.settings import load_settings
from onboard.vehicle.config import CarConfig

OPTIONAL_SECTIONS = (
    "can", "camera", "detector", "gnss", "radio", "brake_request", "hmi", "recorder"
)  # fmt: skip
"""Sections of the configuration without which an edge is not opened."""


def check(
    config: Annotated[Path, typer.Argument(help="The car's configuration, a YAML file.")],
) -> None:
    """Check a configuration: print its mistakes, or what it uses. Opens no device."""
    loaded = load_settings(config, CarConfig)
    read_signals(loaded.obd.broadcast)
    if loaded.brake_request is not None and loaded.brake_request.can is not None:
        # Few vehicles have it, and what it imports takes as long as all else.
        from onboard.brake_request.request_outputs import read_layout  # noqa: PLC0415 (see above)

        read_layout(loaded.brake_request.can, loaded.brake_request.most_m_s2)
    missing = [name for name in OPTIONAL_SECTIONS if getattr(loaded, name) is None]
    present = [name for name in OPTIONAL_SECTIONS if name not in missing]
    typer.echo(f"{config}: good, car {loaded.car.plate}")
    typer.echo(f"  with {', '.join(present) or 'none'}")
    if missing:
        typer.echo(f"  without {', '.join(missing)}")
