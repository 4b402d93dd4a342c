"""Writes the identity of the build into a package that is built; all else is in pyproject.toml."""

import sys
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

ROOT = Path(__file__).parent
sys.path.insert(0, str(ROOT))

from onboard.recorder.build import build_of_checkout, write_build  # noqa: E402 (from this folder)


class BuildWithIdentity(build_py):
    """Adds `build.json`; an editable installation asks git instead."""

    def run(self) -> None:
        """Copy the modules, then write the identity beside them."""
        super().run()
        if not self.editable_mode:
            write_build(build_of_checkout(ROOT), Path(self.build_lib) / "onboard")


setup(cmdclass={"build_py": BuildWithIdentity})
