"""The locks: whoever installs them needs no compiler."""

import subprocess
import sys
from itertools import product
from pathlib import Path

import pytest

LOCKS = (
    "requirements.lock",
    "requirements-rig.lock",
    "deploy/requirements.lock",
    "deploy/installer.lock",
    "tools/mutation.lock",
    "tools/site.lock",
)
NOT_REACHED = ("Failed to fetch", "error sending request", "network was disabled")


@pytest.mark.parametrize(
    ("python", "processor"),
    [
        ("3.14", "aarch64"),
        *(
            pytest.param(*each, marks=pytest.mark.long)
            for each in product(("3.11", "3.12", "3.13", "3.14"), ("aarch64", "x86_64"))
            if each != ("3.14", "aarch64")
        ),
    ],
)
def test_every_pinned_package_has_a_wheel(tmp_path: Path, python: str, processor: str) -> None:
    """On x86-64 the fuzzer too, which has no wheel for other processors."""
    locks = [*LOCKS, *(["fuzz/requirements.lock"] if processor == "x86_64" else [])]
    platform = ["--python-platform", f"{processor}-manylinux_2_28", "--python-version", python]
    given = [word for lock in locks for word in ("-r", lock)]

    run = subprocess.run(
        [
            *(sys.executable, "-m", "uv", "pip", "install", "--dry-run", "--no-build"),
            *("--require-hashes", "--target", str(tmp_path), *platform, *given),
        ],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )

    if any(words in run.stderr for words in NOT_REACHED):
        pytest.skip("the package index is not reachable")
    assert run.returncode == 0, run.stderr
