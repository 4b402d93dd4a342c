"""Whoever opens the folder of decisions finds each of them, by room."""

import re
from collections import Counter
from pathlib import Path

DECISIONS = Path(__file__).parents[2] / "docs" / "decisions"


def test_every_decision_stands_in_the_index_once() -> None:
    linked = re.findall(r"\]\((\d{4}-[\w-]+\.md)\)", (DECISIONS / "README.md").read_text("utf-8"))

    assert Counter(linked) == Counter(each.name for each in DECISIONS.glob("[0-9]*.md"))
