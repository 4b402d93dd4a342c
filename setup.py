"""What a package has and a checkout does not; all else is in pyproject.toml.

The identity of the build is written into it (a checkout asks git); examples and pages are copied.
"""

import shutil
import sys
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.command.sdist import sdist

ROOT = Path(__file__).parent
sys.path.insert(0, str(ROOT))

from onboard.recorder.build import present_build, write_build  # noqa: E402 (from this folder)
from tools.site_pages import collect  # noqa: E402


class WholePackage(build_py):
    """Adds `build.json`, examples and pages; an editable installation has the checkout's."""

    def run(self) -> None:
        """Copy the modules, then what stands beside them."""
        super().run()
        if self.editable_mode:
            return
        package = Path(self.build_lib) / "onboard"
        write_build(present_build(), package)
        shutil.copytree(ROOT / "examples", package / "examples", dirs_exist_ok=True)
        collect(package / "pages", programs=())


class SourceWithIdentity(sdist):
    """Adds `build.json`, since there is no git where it is unpacked."""

    def make_release_tree(self, base_dir: str, files: list[str]) -> None:
        """Copy the files, then write the identity beside them."""
        super().make_release_tree(base_dir, files)
        write_build(present_build(), Path(base_dir) / "onboard")


setup(cmdclass={"build_py": WholePackage, "sdist": SourceWithIdentity})
