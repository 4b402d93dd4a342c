"""Collects the pages of the documentation site: `python3 tools/site_pages.py FOLDER`.

They are the repository's pages, in the same folders, so that their links hold; with them go the
files that they link to, and a page of docstrings for each package. `mkdocs.yml` builds the site,
with the hook `on_config` below.
"""

import re
import shutil
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
PAGES = ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md", "docs/**/*.md")
PROGRAMS = ("onboard", "sim_rig")
_LINK = re.compile(r"\]\((?!\w+:)([^)\s#]+)")
"""A link to a file, without its anchor."""


def collect(folder: Path, programs: Iterable[str] = PROGRAMS) -> None:
    """Write all pages into a new folder, with the docstrings of these programs."""
    shutil.rmtree(folder, ignore_errors=True)
    for page in (page for pattern in PAGES for page in sorted(ROOT.glob(pattern))):
        text = page.read_text("utf-8")
        for target in _LINK.findall(text):
            linked = (page.parent / target).resolve()
            if linked.is_dir():
                text = text.replace(f"]({target})", f"]({target}/index.md)")
                _write(folder / linked.relative_to(ROOT) / "index.md", _listing(linked))
            elif linked.suffix != ".md":
                _write(folder / linked.relative_to(ROOT), linked.read_bytes())
        _write(folder / page.relative_to(ROOT), text)
    for program in programs:
        for package in sorted((ROOT / program).glob("*/__init__.py")):
            name = f"{program}.{package.parent.name}"
            _write(folder / "api" / f"{name}.md", f"# {name}\n\n::: {name}\n")


def on_config(config: Any) -> Any:
    """Let an entry of the navigation that ends in / stand for the pages of that folder."""
    pages = Path(config["docs_dir"])
    config["nav"] = [
        {
            title: sorted(str(page.relative_to(pages)) for page in (pages / under).glob("*.md"))
            if isinstance(under, str) and under.endswith("/")
            else under
            for title, under in entry.items()
        }
        for entry in config["nav"]
    ]
    return config


def _listing(path: Path) -> str:
    """A page of what a folder has: each scenario with its title."""
    rows = [
        f"- `{file.stem}`: {title}"
        for file in sorted(path.glob("*.yaml"))
        for title in re.findall(r"(?m)^title: *[\"']?(.*?)[\"']?$", file.read_text("utf-8"))
    ]
    return "\n".join((f"# {path.name}", "", *rows, ""))


def _write(path: Path, content: str | bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content if isinstance(content, bytes) else content.encode())


if __name__ == "__main__":
    collect(Path(sys.argv[1]))
