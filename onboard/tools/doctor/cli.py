"""`onboard doctor`: one line a test, and what to do."""

import asyncio
import json
import time
from collections.abc import Coroutine
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from onboard.errors import UserError
from onboard.settings import load_settings
from onboard.tools.doctor.camera import examine_camera
from onboard.tools.doctor.can_bus import examine_bus
from onboard.tools.doctor.computer import (
    examine_clock,
    examine_disk,
    examine_keys,
    examine_program,
    written_folders,
)
from onboard.tools.doctor.detector import examine_detector
from onboard.tools.doctor.finding import SUBJECTS, Finding, FindingLevel
from onboard.tools.doctor.gnss_receiver import examine_gnss_receiver
from onboard.tools.doctor.radio import examine_radio
from onboard.vehicle.config import CarConfig

INSTALLED_CONFIG = Path("/etc/onboard/car.yaml")

CORRECT = "correct the configuration; `onboard check` names every mistake"

_COLOURS = {
    FindingLevel.GOOD: typer.colors.GREEN,
    FindingLevel.DOUBTFUL: typer.colors.YELLOW,
    FindingLevel.MISSING: typer.colors.RED,
}


def doctor(
    config: Annotated[
        Path, typer.Argument(help="The car's configuration, a YAML file.")
    ] = INSTALLED_CONFIG,
    *,
    patience_s: Annotated[
        float,
        typer.Option("--patience", min=0.1, max=60.0, help="Seconds to wait for each answer."),
    ] = 3.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, for programs.")] = False,
) -> None:
    """Test every connection; print what is missing and what to do. Exit with 1 if anything is.

    Stop the service first: only one program at a time can use a camera or a UDP port.
    """
    findings = asyncio.run(examine(load_settings(config, CarConfig), patience_s))
    if as_json:
        typer.echo(json.dumps([asdict(finding) for finding in findings], indent=1))
    else:
        for finding in findings:
            print_finding(finding)
    is_complete = all(finding.level is not FindingLevel.MISSING for finding in findings)
    raise typer.Exit(0 if is_complete else 1)


async def examine(config: CarConfig, patience_s: float) -> list[Finding]:
    """Test everything that `config` names, all connections concurrently, `patience_s` each."""
    connections: dict[str, Coroutine[None, None, list[Finding]] | None] = dict.fromkeys(SUBJECTS)
    if config.can is not None:
        connections["can"] = examine_bus(config.can, config.obd, patience_s)
    if config.camera is not None:
        connections["camera"] = asyncio.to_thread(examine_camera, config.camera, patience_s)
    if config.detector is not None:
        connections["detector"] = examine_detector(config.detector, patience_s)
    if config.gnss is not None:
        connections["gnss"] = examine_gnss_receiver(config.gnss, patience_s)
    if config.radio is not None:
        connections["radio"] = examine_radio(config.radio, patience_s)
    examined = [
        _examined(SUBJECTS[section][0], examination) for section, examination in connections.items()
    ]
    findings = [finding for found in await asyncio.gather(*examined) for finding in found]
    now_utc_s = time.time()
    return [
        *findings,
        examine_program(),
        examine_clock(now_utc_s),
        *examine_disk(written_folders(config)),
        *examine_keys(config.security, config.car.plate, now_utc_s),
    ]


async def _examined(
    subject: str, examination: Coroutine[None, None, list[Finding]] | None
) -> list[Finding]:
    if examination is None:
        return [Finding(subject, FindingLevel.NOT_CONFIGURED, "not in the configuration")]
    try:
        return await examination
    except UserError as error:
        return [Finding(subject, FindingLevel.MISSING, str(error), CORRECT)]


def print_finding(finding: Finding) -> None:
    """Print a line, and what to do."""
    level = typer.style(f"{finding.level:14}", fg=_COLOURS.get(finding.level))
    typer.echo(f"{finding.subject:12}{level}  {finding.detail}")
    if finding.advice:
        typer.echo(f"{'':28}-> {finding.advice}")
