"""What all rooms' tests share."""

import gc
import os
from collections.abc import Iterator
from pathlib import Path

import hypothesis
import pytest

hypothesis.settings.register_profile(
    "gate",
    derandomize=True,
    deadline=None,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
hypothesis.settings.load_profile("gate")
"""The gate gives the same answer every time, however busy the machine; `make fuzz` and
`--hypothesis-profile default` look further."""


def pytest_sessionstart() -> None:
    """What the tests are made of lives to the end: no search for garbage while it is built."""
    gc.disable()


def pytest_collection_finish() -> None:
    gc.freeze()  # nor does any later search look through it: a third of the time to collect tests
    gc.enable()


@pytest.fixture(scope="session", autouse=True)
def _frozen_tests() -> Iterator[None]:
    """Daemons and campaigns in this process would look through all that the tests are made of."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gc, "unfreeze", lambda: None)
        yield


DEFAULT_RIG_DATA = Path(__file__).parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def rig_data() -> Path:
    """The folder of real recordings, which are not part of this repository."""
    folder = Path(os.environ.get("RIG_DATA", DEFAULT_RIG_DATA))
    if not folder.is_dir():
        pytest.skip(f"no recordings at {folder} (RIG_DATA names the folder)")
    return folder
