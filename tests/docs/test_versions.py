"""The changelog and the citation are of the version that builds have."""

import re

import yaml

from onboard.recorder.build import VERSION
from tests.docs.test_pages import ROOT


def test_the_newest_release_of_the_changelog_is_this_version() -> None:
    newest, *_ = re.findall(r"(?m)^## (\d+\.\d+\.\d+)", (ROOT / "CHANGELOG.md").read_text("utf-8"))
    assert newest == VERSION


def test_the_citation_is_of_this_version_and_names_the_papers_that_the_readme_credits() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    readme = " ".join((ROOT / "README.md").read_text("utf-8").split())

    assert str(citation["version"]) == VERSION
    assert len(citation["references"]) == 4
    first = [each["authors"][0]["family-names"] for each in citation["references"]]
    assert [name for name in first if name not in readme] == []
