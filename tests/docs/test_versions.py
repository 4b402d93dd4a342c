"""The changelog and the citation are of the version that builds have."""

import re

import yaml

from onboard.recorder.build import VERSION
from tests.docs.test_pages import ROOT


def test_the_newest_release_of_the_changelog_is_this_version() -> None:
    newest, *_ = re.findall(r"(?m)^## (\d+\.\d+\.\d+)", (ROOT / "CHANGELOG.md").read_text("utf-8"))
    assert newest == VERSION


def test_the_citation_is_of_this_version_and_names_the_four_papers_of_the_readme() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    readme = " ".join((ROOT / "README.md").read_text("utf-8").split())

    assert str(citation["version"]) == VERSION
    assert len(citation["references"]) == 4
    assert [each["title"] for each in citation["references"] if each["title"] not in readme] == []
