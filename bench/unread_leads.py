"""Leads without a plate on rendered drives: found, gap and closing speed of their first second.

A camera of 60 degrees, pitching, behind a vehicle 8 to 45 m ahead that closes at -4 to 6 m/s. The
reference is the same drives with a plate. Mean squares of the errors by their sigmas (NEES) are 1
if the sigmas are right; widths of vehicles scatter in these drives as their sigma says, those of
plates not at all.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import cv2
import numpy as np

from bench import Figure
from onboard.observations import Lead
from onboard.vision.networks import load_networks
from onboard.vision.perception import Perception
from onboard.vision.settings import CameraSettings, VisionSettings
from onboard.vision.sized_camera import Networks
from sim_rig.rendering.scene import CameraRenderer, Light, Scene, SceneCar

CAMERA = CameraSettings(source="rendered", focal_x_px=1108.0, focal_y_px=1108.0, pitch_rad=0.02)
FPS, FRAMES, DRIVES = 10.0, 16, 8
"""Drives in each light."""
COUNTED_S, FIRST_S = 0.5, 1.0
"""Time from which a lead counts as missing, and for which errors count after its first gap."""
PITCHES_RAD = (-0.002, -0.001, 0.0, 0.001, 0.002)
_SPEED_M_S, _NEAREST_M, _PLATE = 15.0, 5.0, "GN417KB"


@dataclass(slots=True)
class LeadErrors:
    """Results of some drives."""

    frames: int = 0
    """Frames from `COUNTED_S` on."""
    found: int = 0
    """Of these, frames with a gap."""
    gap_shares: list[float] = field(default_factory=list)
    """Errors of the gap, as shares of it."""
    gap_sigmas: list[float] = field(default_factory=list)
    closing_sigmas: list[float] = field(default_factory=list)


def measure() -> Iterator[Figure]:
    """Shares of frames, median errors and NEES, by light."""
    cv2.setNumThreads(1)
    networks = load_networks(VisionSettings())
    renderers = [
        CameraRenderer(CAMERA.model_copy(update={"pitch_rad": CAMERA.pitch_rad + pitch_rad}))
        for pitch_rad in PITCHES_RAD
    ]
    for light in Light:
        unread, read = (_errors(light, plate, networks, renderers) for plate in (None, _PLATE))
        name, of = f"unread_leads.{light}", "the same with plates"
        for what, ours, theirs in (
            ("found", unread.found / unread.frames, read.found / read.frames),
            ("gap_error", _median(unread.gap_shares), _median(read.gap_shares)),
            ("gap_nees", _mean_square(unread.gap_sigmas), _mean_square(read.gap_sigmas)),
            (
                "closing_speed_nees",
                _mean_square(unread.closing_sigmas),
                _mean_square(read.closing_sigmas),
            ),
        ):
            unit = "1" if what.endswith("nees") else "share"
            n = unread.frames if what == "found" else len(unread.gap_shares)
            yield Figure(f"{name}.{what}", ours, unit, n, of, theirs)


def _errors(
    light: Light, plate: str | None, networks: Networks, renderers: list[CameraRenderer]
) -> LeadErrors:
    errors = LeadErrors()
    for seed in range(DRIVES):
        rng = np.random.default_rng([5, seed])
        gap_m, closing_m_s = float(rng.uniform(8.0, 45.0)), float(rng.uniform(-4.0, 6.0))
        if gap_m - closing_m_s * FRAMES / FPS < _NEAREST_M:
            closing_m_s = 0.0
        blue, green, red = (int(level) for level in rng.integers(20, 220, 3))
        size_m = float(rng.normal(1.8, 0.09)), float(rng.uniform(1.4, 1.8))
        perception = Perception(CAMERA, VisionSettings(), networks)
        first_s: float | None = None
        for index in range(FRAMES):
            stamp_s = index / FPS
            ahead_m = gap_m - closing_m_s * stamp_s
            car = SceneCar(
                ahead_m,
                0.1 * float(np.sin(2 * stamp_s)),
                width_m=size_m[0],
                height_m=size_m[1],
                plate=plate,
                colour_bgr=(blue, green, red),
            )
            scene = Scene((car,), light=light, travelled_m=_SPEED_M_S * stamp_s)
            renderer = renderers[int(rng.integers(len(renderers)))]
            perception.receive_frame(renderer.draw(scene, rng), stamp_s)
            lead = _lead(perception)
            errors.frames += stamp_s >= COUNTED_S
            if lead is None or lead.gap_m is None:
                continue
            errors.found += stamp_s >= COUNTED_S
            first_s = stamp_s if first_s is None else first_s
            if stamp_s - first_s <= FIRST_S:
                _add(errors, lead, ahead_m, closing_m_s)
    return errors


def _lead(perception: Perception) -> Lead | None:
    lead = None
    while (event := perception.next_event()) is not None:
        lead = event if isinstance(event, Lead) else lead
    return lead


def _add(errors: LeadErrors, lead: Lead, ahead_m: float, closing_m_s: float) -> None:
    given = lead.gap_m, lead.gap_sigma_m, lead.closing_speed_m_s, lead.closing_speed_sigma_m_s
    gap_m, gap_sigma_m, speed_m_s, speed_sigma_m_s = (float(each or 0.0) for each in given)
    errors.gap_shares.append(abs(gap_m - ahead_m) / ahead_m)
    errors.gap_sigmas.append((gap_m - ahead_m) / gap_sigma_m)
    errors.closing_sigmas.append((speed_m_s - closing_m_s) / speed_sigma_m_s)


def _median(values: list[float]) -> float:
    return float(np.median(values)) if values else float("nan")


def _mean_square(values: list[float]) -> float:
    return float(np.mean(np.square(values))) if values else float("nan")
