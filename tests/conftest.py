"""What all rooms' tests share."""

import os
from pathlib import Path

import pytest

DEFAULT_RIG_DATA = Path(__file__).parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def rig_data() -> Path:
    """The folder of real recordings, which are not part of this repository."""
    folder = Path(os.environ.get("RIG_DATA", DEFAULT_RIG_DATA))
    if not folder.is_dir():
        pytest.skip(f"no recordings at {folder} (RIG_DATA names the folder)")
    return folder
