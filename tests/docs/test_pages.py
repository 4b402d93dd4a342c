"""The pages: links lead somewhere, names exist in the code, and no page grows without end."""

import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [
    *(ROOT / f"{name}.md" for name in ("README", "CHANGELOG", "CONTRIBUTING", "SECURITY")),
    *sorted((ROOT / "docs").rglob("*.md")),
]
CODE = ("onboard", "sim_rig", "bench", "training", "tools", "deploy", "tests", "fuzz", "examples")
MOST_WORDS = 42_000
"""Of README and docs together, counted as by `wc -w`."""
MOST_WORDS_OF_A_DESIGN_PAGE = 1_800


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


@cache
def anchors(page: Path) -> frozenset[str]:
    """The anchors of a page's headings, as code hosts make them."""
    text = re.sub(r"(?ms)^```.*?^```", "", page.read_text(encoding="utf-8"))
    headings = re.findall(r"(?m)^#+ (.*)$", text)
    plain = (re.sub(r"[^\w\- ]", "", heading.lower()).strip() for heading in headings)
    return frozenset(heading.replace(" ", "-") for heading in plain)


@cache
def words_of_the_code() -> frozenset[str]:
    """Every identifier, key and file name of the repository's code and data."""
    found: set[str] = set()
    for folder in CODE:
        for path in (ROOT / folder).rglob("*"):
            if path.suffix in {".py", ".yaml", ".js", ".html", ".sh", ".service", ".json"}:
                found.add(path.name)
                found.update(re.findall(r"\w+", path.read_text(encoding="utf-8")))
    found.update(re.findall(r"[\w-]+", (ROOT / "Makefile").read_text(encoding="utf-8")))
    return frozenset(found)


@cache
def paths() -> frozenset[str]:
    """Every file of the repository's code and data, from its root."""
    return frozenset(name_of(path) for folder in CODE for path in (ROOT / folder).rglob("*.*"))


@cache
def folders() -> frozenset[str]:
    """Every folder with code, from the repository's root."""
    return frozenset(f"{parent}/" for path in paths() for parent in Path(path).parents)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_link_leads_to_a_file_and_a_heading(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"https?://", target):
            continue
        path, _, anchor = target.partition("#")
        there = (page.parent / path).resolve() if path else page
        assert there.exists(), target
        if anchor:
            assert anchor in anchors(there), target


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_constant_and_file_that_a_page_names_exists(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    constants = re.findall(r"`(_?[A-Z][A-Z0-9]*(?:_[A-Z0-9]+)+|[A-Z]{4,})`", text)
    files = re.findall(r"`(\w[\w./-]*\.(?:py|yaml))`", text)
    settings = re.findall(r"`(?:[a-z_]+\.)*([a-z]+(?:_[a-z0-9]+)+)`", text)

    assert not {*constants, *settings} - words_of_the_code()
    assert not [each for each in files if not any(f"/{p}".endswith(f"/{each}") for p in paths())]


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_folder_that_a_page_names_exists(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    named = re.findall(rf"`((?:{'|'.join(CODE)})/[\w/]*|(?:[a-z_]\w*/)+)`", text)

    assert not [
        each
        for each in named
        if not any(f"/{f}".endswith(f"/{each.strip('/')}/") for f in folders())
    ]


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_pattern_of_files_that_a_page_names_has_files(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    patterns = re.findall(rf"`((?:{'|'.join(CODE)})/[\w./]*\*[\w./*]*)`", text)

    assert not [each for each in patterns if not any(ROOT.glob(each))]


def test_the_pages_stay_short() -> None:
    pages = [ROOT / "README.md", *(each for each in PAGES if each.parent != ROOT)]
    words = {page: len(page.read_text("utf-8").split()) for page in pages}
    design = {name_of(page): n for page, n in words.items() if page.parent.name == "design"}

    assert sum(words.values()) < MOST_WORDS, "cut as many words as you add"
    assert {name: n for name, n in design.items() if n > MOST_WORDS_OF_A_DESIGN_PAGE} == {}
