"""Debian's chromium for playwright, which is installed without a browser."""

import shutil

ARGUMENTS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--renderer-process-limit=1",
)
HOW = "no chromium: `sh tools/system-packages.sh chromium` installs it"


def find() -> str | None:
    """Path of chromium; None if it is not installed, which `HOW` explains."""
    return shutil.which("chromium")
