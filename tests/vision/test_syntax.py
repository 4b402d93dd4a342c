"""Texts that are valid plates, by the patterns of the user."""

import pytest

from onboard.vision.syntax import PlateSyntax


@pytest.mark.parametrize(
    ("read", "fits"),
    [("GN417KB", True), ("GN4I7KB", False), ("GN417K", False), ("GN417KBB", False), ("", False)],
)
def test_patterns_must_match_the_whole_text(read: str, fits: bool) -> None:
    assert PlateSyntax((r"[A-Z]{2}[0-9]{3}[A-Z]{2}",)).fits(read) == fits


def test_without_patterns_every_text_is_valid() -> None:
    assert PlateSyntax(()).fits("8B0OI1")
