"""The folder that the box reads at /share, and the image that it boots."""

import json
import subprocess
from pathlib import Path

from deploy.releases import ABOUT

ROOT = Path(__file__).parents[2]
BUILD = ROOT / "build" / "vm"
SHARE = BUILD / "share"


def make_image() -> None:
    """Make the disk image of a small Debian, or keep that of an earlier run."""
    subprocess.run(["sh", ROOT / "deploy" / "vm" / "image.sh", BUILD], check=True)


def make_box() -> None:
    """Write into the share what is installed, as `make box` does."""
    subprocess.run(["sh", ROOT / "deploy" / "box.sh", SHARE / "box"], check=True)


def box_build() -> str:
    """Name of the build in the share."""
    return str(json.loads((SHARE / "box" / ABOUT).read_bytes())["name"])
