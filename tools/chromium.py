"""Debian's chromium, for looking at our pages with playwright, which brings none of its own."""

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
    """Where it is; `None` where it is not, and `HOW` says what to do."""
    return shutil.which("chromium")
