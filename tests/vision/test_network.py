"""The library that runs the networks."""

import os
import subprocess
import sys
from pathlib import Path


def test_the_library_leaves_no_identifier_of_the_computer(tmp_path: Path) -> None:
    """It would write one into the user's cache, and send it to its maker."""
    home = os.environ | {"HOME": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path / "cache")}
    home.pop("ORT_DISABLE_TELEMETRY", None)
    load = "import onboard.vision.network"
    subprocess.run([sys.executable, "-c", load], env=home, check=True)
    assert list(tmp_path.rglob("*")) == []
