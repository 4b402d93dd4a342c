"""What the box tests expect of `onboard doctor`, beside what it reports."""

import asyncio

from deploy.vm.__main__ import CAR, DOCTOR, DOCTOR_IN_QEMU
from deploy.vm.rig import CAMERA_FPS
from onboard.settings import parse_settings
from onboard.tools.doctor.camera import LEAST_RATE_HZ
from onboard.tools.doctor.cli import examine
from onboard.vehicle.config import CarConfig


def test_the_box_tests_expect_a_level_of_every_subject_that_the_doctor_reports() -> None:
    """Here everything is missing; which subjects there are does not depend on that."""
    found = asyncio.run(examine(parse_settings(CAR, CarConfig, "car"), 0.2))

    assert {each.subject for each in found} == DOCTOR.keys()
    assert DOCTOR_IN_QEMU.keys() < DOCTOR.keys()
    assert DOCTOR["detector"] == "not configured"


def test_the_camera_of_the_box_tests_is_slow_in_namespaces_too() -> None:
    assert CAMERA_FPS < LEAST_RATE_HZ
    assert DOCTOR["camera"] == "doubtful"
