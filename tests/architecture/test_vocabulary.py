"""The terms of the glossary (`docs/glossary.md`): words that they replaced do not come back."""

import re
from itertools import pairwise

from tests.architecture.syntax import ROOT, files_below, syntax_of

PROGRAMS = ("onboard", "sim_rig", "bench", "deploy", "training", "tools", "fuzz")

RETIRED_WORDS = frozenset({
    "doorkeeper", "lookout", "mending", "onlooker", "onlookers", "plausibility", "preceding",
    "shelf", "shelves", "strangers", "told",
})  # fmt: skip
"""Words of no identifier and file name at all."""

RETIRED_IN_PROGRAMS = RETIRED_WORDS | {
    "ballot", "ballots", "believe", "believed", "believes", "crowd", "crowded", "desk",
    "disbelieved", "doubt", "doubted", "doubts", "fate", "fates", "gossip", "hear", "heard",
    "hears", "lapse", "liar", "liars", "lie", "lies", "neighbour", "says", "schooling", "story",
    "stranger", "tells", "who", "whoever",
}  # fmt: skip
"""Words of no identifier and file name of a program."""

RETIRED_NAMES = frozenset({
    ("car", "ahead"), ("held", "warnings"), ("own", "car"), ("plate", "ahead"),
    ("warning", "list"),
})  # fmt: skip
"""Words that no identifier and file name has in a row."""

RETIRED_IN_PAGES = re.compile(
    r"\b(doorkeeper|lookout|mending|onlookers?|own car|own_car|preceding|schooling|shelf|told"
    r"|the (car|vehicle) ahead)\b",
    re.IGNORECASE,
)


def test_retired_words_name_nothing_in_programs() -> None:
    assert _retired(PROGRAMS, RETIRED_IN_PROGRAMS) == []


def test_retired_words_name_nothing_in_tests() -> None:
    assert _retired(("tests",), RETIRED_WORDS) == []


def test_pages_do_not_use_retired_words() -> None:
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    found = [
        (str(page.relative_to(ROOT)), match.group())
        for page in pages
        for match in RETIRED_IN_PAGES.finditer(page.read_text("utf-8"))
    ]
    assert found == []


def test_a_question_changes_nothing() -> None:
    changing = [
        f"{path.relative_to(ROOT)}: {name}"
        for path in files_below("sim_rig", "onboard")
        for name in syntax_of(path).changing_questions
    ]
    assert changing == []


def test_a_function_that_receives_says_what() -> None:
    silent = [
        str(path.relative_to(ROOT))
        for path in files_below("onboard")
        if "receive" in syntax_of(path).functions
    ]
    assert silent == []


def _retired(trees: tuple[str, ...], retired: frozenset[str]) -> list[str]:
    """Of files in which such a word stands anywhere: the others need not be parsed."""
    in_a_row = {f"{one}[^a-z]*{other}" for one, other in RETIRED_NAMES}
    anywhere = re.compile("|".join(retired | in_a_row), re.IGNORECASE)
    return [
        f"{path.relative_to(ROOT)}: {name}"
        for path in files_below(*trees)
        if anywhere.search(path.stem + path.read_text("utf-8"))
        for name in sorted({path.stem, *syntax_of(path).names})
        if _is_retired(name, retired)
    ]


def _is_retired(name: str, retired: frozenset[str]) -> bool:
    words = [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)]
    return bool(retired & set(words) or RETIRED_NAMES & set(pairwise(words)))
