"""The folder that the box reads at /share, and the image that it boots."""

import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[2]
BUILD = ROOT / "build" / "vm"
SHARE = BUILD / "share"


def make_image() -> None:
    """Make the disk image of a small Debian, or keep that of an earlier run."""
    subprocess.run(["sh", ROOT / "deploy" / "vm" / "image.sh", BUILD], check=True)


def make_box() -> None:
    """Write into the share what is installed, as `make box` does."""
    subprocess.run(["sh", ROOT / "deploy" / "box.sh", SHARE / "box"], check=True)
