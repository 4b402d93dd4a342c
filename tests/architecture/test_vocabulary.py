"""The terms of the glossary (`docs/glossary.md`): words that they replaced do not come back."""

import ast
import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

from tests.architecture.imports import ROOT

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
        f"{path}: {function.name}"
        for path, function in _functions("sim_rig", "onboard")
        if re.match(r"_?(is|has|can)_", function.name) and any(map(_changes, ast.walk(function)))
    ]
    assert changing == []


def test_a_function_that_receives_says_what() -> None:
    silent = [f"{path}" for path, each in _functions("onboard") if each.name == "receive"]
    assert silent == []


def _functions(*trees: str) -> Iterator[tuple[Path, ast.FunctionDef]]:
    for tree in trees:
        for path in sorted((ROOT / tree).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text("utf-8"))):
                if isinstance(node, ast.FunctionDef):
                    yield path.relative_to(ROOT), node


def _changes(node: ast.AST) -> bool:
    """Whether it assigns to an attribute or an element."""
    if isinstance(node, ast.Attribute | ast.Subscript):
        return isinstance(node.ctx, ast.Store | ast.Del)
    return False


def _retired(trees: tuple[str, ...], retired: frozenset[str]) -> list[str]:
    return [
        f"{path.relative_to(ROOT)}: {name}"
        for tree in trees
        for path in sorted((ROOT / tree).rglob("*.py"))
        for name in sorted({path.stem, *_identifiers(path)})
        if _is_retired(name, retired)
    ]


def _is_retired(name: str, retired: frozenset[str]) -> bool:
    words = [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)]
    return bool(retired & set(words) or RETIRED_NAMES & set(pairwise(words)))


def _identifiers(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        match node:
            case ast.Name(id=name) | ast.Attribute(attr=name) | ast.arg(arg=name):
                yield name
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name):
                yield name
            case ast.ClassDef(name=name) | ast.keyword(arg=str(name)):
                yield name
