"""What all rooms' tests share."""

import os
from pathlib import Path

import hypothesis
import pytest

hypothesis.settings.register_profile("gate", derandomize=True, deadline=None)
hypothesis.settings.load_profile("gate")
"""The gate gives the same answer every time, however busy the machine; `make fuzz` and
`--hypothesis-profile default` look further."""

DEFAULT_RIG_DATA = Path(__file__).parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def rig_data() -> Path:
    """The folder of real recordings, which are not part of this repository."""
    folder = Path(os.environ.get("RIG_DATA", DEFAULT_RIG_DATA))
    if not folder.is_dir():
        pytest.skip(f"no recordings at {folder} (RIG_DATA names the folder)")
    return folder
