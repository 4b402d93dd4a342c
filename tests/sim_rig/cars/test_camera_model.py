"""The camera model of virtual runs, held against pictures that the car's vision looks at.

A car closes in on another from 36 m to 6 m, once on the rendered path (JPEG, `Perception`),
once through the model. Both are cut into stretches of the way and compared.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import takewhile
from statistics import fmean, pstdev

import cv2
import numpy as np
import pytest

from onboard.observations import Lead, LeadIdentity, Plate
from onboard.settings import parse_settings
from onboard.vision.networks import load_perception
from onboard.vision.seen import Event
from onboard.vision.settings import CameraSettings, VisionSettings
from onboard.vision.vehicle_track import MIN_READ_CONFIDENCE
from sim_rig.cars.camera_model import STAMP_S, CameraModel
from sim_rig.cars.camera_server import Camera
from sim_rig.cars.camera_view import FPS, LENS, CameraView
from sim_rig.roads.breakpoints import BreakpointRoad
from sim_rig.scenario.car_config import car_config
from sim_rig.scenario.schema import Scenario

pytestmark = pytest.mark.long

FAR_M, NEAR_M, CLOSING_M_S = 36.0, 6.0, 1.5
DURATION_S = (FAR_M - NEAR_M) / CLOSING_M_S
STRETCHES_M = ((27.0, 36.0), (19.0, 24.0), (14.0, 19.0), (10.0, 14.0), (6.5, 10.0))
CARS = {
    "GN417KB": "grey",
    "RD288HX": "red",
    "YW903MS": "white",
    "BL635TN": "green",
    "KC519LF": "yellow",
}
"""Plates, and the colour of the car: as for the model's tables."""


def approach(plate: str, start_m: float = FAR_M) -> Scenario:
    return parse_settings(
        {
            "title": "A car closes in on another.",
            "seed": 1,
            "duration_s": DURATION_S,
            "radio": {"reach_m": 100},
            "cars": {
                "ann": {
                    "plate": plate,
                    "colour": CARS[plate],
                    "lane": 1,
                    "start_m": start_m + 4.5,
                    "speed_m_s": 15.0,
                },
                "ben": {"plate": "X1", "lane": 1, "start_m": 0, "speed_m_s": 15.0 + CLOSING_M_S},
            },
            "expect": [],
        },
        Scenario,
        "approach",
    )


def vision_settings(scenario: Scenario) -> VisionSettings:
    return parse_settings(car_config(scenario, "ben", 0)["vision"], VisionSettings, "approach")


def rendered(scenario: Scenario) -> Iterable[Event]:
    """What `Perception` says of pictures."""
    perception = load_perception(
        CameraSettings(source="rig", **LENS.model_dump()), vision_settings(scenario)
    )
    camera = Camera(scenario, BreakpointRoad(scenario), "ben", np.random.SeedSequence(1))
    for number in range(int(DURATION_S * FPS)):
        jpeg = np.frombuffer(camera.jpeg(number / FPS), np.uint8)
        image = cv2.imdecode(jpeg, cv2.IMREAD_COLOR)
        assert image is not None
        perception.receive_frame(np.asarray(image, np.uint8), number / FPS)
        while (event := perception.next_event()) is not None:
            yield event


def modelled(scenario: Scenario, seed: int) -> Iterable[Event]:
    """What the model says of the same moments."""
    rng = np.random.default_rng(seed)
    view = CameraView(scenario, BreakpointRoad(scenario), "ben", rng)
    model = CameraModel(view, vision_settings(scenario), -STAMP_S, rng)
    while (at := model.get_timer()) < DURATION_S:
        model.handle_timer(at)
        while (event := model.next_event()) is not None:
            yield event


@dataclass(frozen=True)
class Stretch:
    """Vision on one stretch of the approach."""

    found: float
    """Part of the frames in which a plate is found."""
    read: float
    """Part of the frames in which the plate is read, and rightly."""
    misread: float
    """Part of the frames in which it is read as something else, with enough confidence to count."""
    gap_bias: float
    """Mean error of the gap, as a share of it."""
    gap_sigma: float
    """Of one car's error around its mean: how cars differ is not modelled."""
    closing_sigma_m_s: float
    known: float
    """Part of the frames in which the lead is known by its plate."""


def stretches(runs: Iterable[tuple[str, list[Event]]]) -> list[Stretch]:
    return [_stretch(list(runs), *bounds) for bounds in STRETCHES_M]


def _stretch(runs: list[tuple[str, list[Event]]], near_m: float, far_m: float) -> Stretch:
    errors, around_its_own, closings, known, frames = [], [], [], [], 0
    texts: list[set[bool | None]] = []
    for plate, events in runs:
        in_frame: set[bool | None] = set()
        of_this_run: list[float] = []
        for event in events:
            gap_m = FAR_M - CLOSING_M_S * event.stamp_s
            if not near_m <= gap_m < far_m:
                continue
            if isinstance(event, Plate):
                counts = event.text is not None and event.confidence >= MIN_READ_CONFIDENCE
                in_frame.add(event.text == plate if counts else None)
            if isinstance(event, Lead):
                frames += 1
                texts.append(in_frame)
                in_frame = set()
                known.append(event.identity is LeadIdentity.KNOWN and event.text == plate)
                if event.gap_m is not None and event.closing_speed_m_s is not None:
                    of_this_run.append(event.gap_m / gap_m - 1)
                    closings.append(event.closing_speed_m_s - CLOSING_M_S)
        errors += of_this_run
        around_its_own += [error - fmean(of_this_run) for error in of_this_run]
    return Stretch(
        found=sum(map(bool, texts)) / frames,
        read=sum(True in each for each in texts) / frames,
        misread=sum(False in each for each in texts) / frames,
        gap_bias=fmean(errors) if errors else 0.0,
        gap_sigma=pstdev(around_its_own) if errors else 0.0,
        closing_sigma_m_s=pstdev(closings) if closings else 0.0,
        known=fmean(known),
    )


@pytest.fixture(scope="module")
def both() -> list[tuple[Stretch, Stretch]]:
    """Rendered and modelled, stretch by stretch."""
    scenarios = [(plate, approach(plate)) for plate in CARS]
    seen = stretches([(plate, list(rendered(scenario))) for plate, scenario in scenarios])
    said = stretches(
        [
            (plate, list(modelled(scenario, 5 * index + seed)))
            for index, (plate, scenario) in enumerate(scenarios)
            for seed in range(5)
        ]
    )
    return list(zip(seen, said, strict=True))


def test_far_ahead_neither_finds_a_plate_and_nearer_both_do(
    both: list[tuple[Stretch, Stretch]],
) -> None:
    for stretch_m, (seen, said) in zip(STRETCHES_M, both, strict=True):
        assert said.found == pytest.approx(seen.found, abs=0.15), stretch_m


@pytest.mark.parametrize("seen_by", [rendered, lambda scenario: modelled(scenario, 1)])
def test_a_car_too_far_for_its_plate_is_a_lead_without_a_text(
    seen_by: Callable[[Scenario], Iterable[Event]],
) -> None:
    plate, until_s = "GN417KB", 1.5
    scenario = approach(plate, start_m=70.0)
    events = takewhile(lambda event: event.stamp_s < until_s, seen_by(scenario))

    last = [event for event in events if isinstance(event, Lead)][-1]

    assert (last.identity, last.text) == (LeadIdentity.UNKNOWN, None)
    assert last.gap_m == pytest.approx(70.0 - CLOSING_M_S * last.stamp_s, rel=0.15)


def test_model_and_perception_identify_a_car_at_about_the_same_distance(
    both: list[tuple[Stretch, Stretch]],
) -> None:
    # Farther ahead the model follows photographs, and not how well rendered plates are read.
    for stretch_m, (seen, said) in zip(STRETCHES_M[2:], both[2:], strict=True):
        assert said.known == pytest.approx(seen.known, abs=0.35), stretch_m
    for stretch in both[-1]:
        assert stretch.known > 0.9


def test_both_misread_from_afar_and_hardly_when_near(both: list[tuple[Stretch, Stretch]]) -> None:
    for stretch_m, (seen, said) in zip(STRETCHES_M, both, strict=True):
        assert said.misread == pytest.approx(seen.misread, abs=0.25), stretch_m
    for stretch in (*both[-2], *both[-1]):
        assert stretch.misread < 0.05


def test_gaps_are_off_by_as_much_on_both(both: list[tuple[Stretch, Stretch]]) -> None:
    for stretch_m, (seen, said) in zip(STRETCHES_M[1:], both[1:], strict=True):
        assert said.gap_bias == pytest.approx(seen.gap_bias, abs=0.04), stretch_m
        assert said.gap_sigma == pytest.approx(seen.gap_sigma, abs=0.02), stretch_m


def test_closing_speeds_are_as_uncertain_on_both(both: list[tuple[Stretch, Stretch]]) -> None:
    for stretch_m, (seen, said) in zip(STRETCHES_M[2:], both[2:], strict=True):
        expected = pytest.approx(seen.closing_sigma_m_s, abs=0.2)
        assert said.closing_sigma_m_s == expected, stretch_m
