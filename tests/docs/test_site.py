"""The site has every page, and what they link to; `make site` then refuses broken links."""

import re
from pathlib import Path

from tests.docs.test_pages import PAGES, ROOT, name_of
from tools.site_pages import collect


def test_the_site_has_every_page_in_its_navigation_and_fetches_nothing(tmp_path: Path) -> None:
    collect(tmp_path)
    settings = (ROOT / "mkdocs.yml").read_text("utf-8")
    listed = re.findall(r"(?m)^ +- (?:[\w ]+: )?(\S+(?:\.md|/))$", settings)

    shown = {name_of(page) for page in PAGES}
    assert {name for name in shown if not (tmp_path / name).exists()} == set()
    assert {name for name in shown if not name.startswith(tuple(listed))} == set()
    assert (tmp_path / "api/onboard.risk.md").read_text("utf-8").endswith("::: onboard.risk\n")
    assert (tmp_path / "sim_rig/scenarios/index.md").read_text("utf-8").count("- `") > 20
    assert "font: false" in settings
