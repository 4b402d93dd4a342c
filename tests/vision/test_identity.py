"""Votes on a text: it is identified by several readings, and kept until others outweigh them."""

import pytest

from onboard.vision.identity import PlateVote
from onboard.vision.syntax import PlateSyntax

SHARE = 0.9


def votes_for(*reads: tuple[str, float], step_s: float = 0.1, start_s: float = 0.0) -> PlateVote:
    votes = PlateVote(SHARE)
    for index, (text, confidence) in enumerate(reads):
        votes.vote(text, confidence, (confidence,) * len(text), start_s + index * step_s)
    return votes


def test_without_votes_no_text_is_identified() -> None:
    assert PlateVote(SHARE).text is None


def test_one_reading_identifies_nothing() -> None:
    assert votes_for(("GN417KB", 1.0)).text is None


def test_three_certain_readings_identify_a_text() -> None:
    assert votes_for(*[("GN417KB", 0.95)] * 3).text == "GN417KB"


def test_uncertain_readings_never_identify_a_text() -> None:
    """A plate too small to be read is misread alike in every frame."""
    assert votes_for(*[("H417KB", 0.7)] * 100).text is None


def test_a_few_certain_readings_after_many_uncertain_ones_identify_a_text() -> None:
    assert votes_for(*[("GN417KB", 0.5)] * 20, *[("GN417KB", 0.95)] * 2).text == "GN417KB"


def test_readings_of_low_confidence_never_count() -> None:
    assert votes_for(*[("GN417KB", 0.2)] * 100).text is None


def test_a_text_too_short_for_a_plate_never_counts() -> None:
    assert votes_for(*[("TDI", 1.0)] * 100).text is None


def test_misreadings_at_different_positions_are_outvoted() -> None:
    reads = ["GN417KB", "GN417K8", "6N417KB", "GN4I7KB", "GN417KB", "GN417HB"]
    votes = votes_for(*[(text, 0.9) for text in reads * 2])

    assert votes.text is None  # five in six votes at a place are fewer than nine in ten

    votes = PlateVote(0.75)
    for index, text in enumerate(reads):
        votes.vote(text, 0.9, (0.9,) * 7, index * 0.1)
    assert votes.text == "GN417KB"


def test_an_uncertain_character_has_a_lower_weight() -> None:
    votes = PlateVote(SHARE)
    for index in range(10):
        votes.vote("GN417KB", 0.9, (0.9,) * 7, 0.2 * index)
        votes.vote("GN417K8", 0.5, (0.9,) * 6 + (0.1,), 0.2 * index + 0.1)

    assert votes.text == "GN417KB"


def test_a_character_read_two_ways_is_not_identified() -> None:
    assert votes_for(*[("GN417KB", 0.95), ("GN417K8", 0.95)] * 20).text is None


def test_characters_drawn_alike_are_spelt_as_read_most_often() -> None:
    votes = votes_for(*[("VAO34RM", 0.95), ("VA034RM", 0.95), ("VAO34RM", 0.95)] * 3)

    assert votes.text == "VAO34RM"


def test_a_mixture_of_two_plates_is_never_identified() -> None:
    votes = PlateVote(0.6)
    for index in range(30):
        # Each position has a majority of two thirds; no frame read that text.
        text = ("AACC", "AADD", "BBAC")[index % 3]
        votes.vote(text, 0.9, (0.9, 0.9, 0.9, 0.9), index * 0.1)

    assert votes.text in {None, "AACC"}
    votes = PlateVote(0.6)
    for index in range(30):
        votes.vote(("XAAAA", "AXAAA", "AAXAA")[index % 3], 0.9, (0.9,) * 5, index * 0.1)
    assert votes.text is None  # "AAAAA" has two thirds at each place


def test_an_identified_text_survives_a_misreading() -> None:
    assert votes_for(*[("GN417KB", 0.95)] * 20, ("ABCDEFG", 0.9)).text == "GN417KB"


def test_another_text_is_identified_after_several_readings() -> None:
    votes = votes_for(*[("GN417KB", 0.95)] * 20)
    texts = []
    for index in range(200):
        votes.vote("RD288HX", 0.95, (0.95,) * 7, 2.0 + 0.1 * index)
        texts.append(votes.text)

    assert texts[0] == "GN417KB"
    assert texts[-1] == "RD288HX"
    assert set(texts) == {"GN417KB", None, "RD288HX"}
    assert texts.index("RD288HX") < 100


@pytest.mark.parametrize(
    ("read", "fits"),
    [("GN417KB", True), ("GN4I7KB", False), ("GN417K", False), ("GN417KBB", False), ("", False)],
)
def test_patterns_must_match_the_whole_text(read: str, fits: bool) -> None:
    assert PlateSyntax((r"[A-Z]{2}[0-9]{3}[A-Z]{2}",)).fits(read) == fits


def test_without_patterns_every_text_is_valid() -> None:
    assert PlateSyntax(()).fits("8B0OI1")
