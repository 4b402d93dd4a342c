"""The posterior of a track's plate: what each reading adds to it, and what changes nothing."""

import pytest

from onboard.observations import PlateCandidate
from onboard.vision.plate_posterior import (
    CERTAIN_TEXT,
    MAX_CANDIDATES,
    POOL,
    WIDE_PX,
    PlatePosterior,
)


def reading(**probabilities: float) -> list[PlateCandidate]:
    return [PlateCandidate(text, share) for text, share in probabilities.items()]


def after(*readings: list[PlateCandidate], step_s: float = 0.1) -> PlatePosterior:
    posterior = PlatePosterior()
    for index, each in enumerate(readings):
        posterior.update(each, index * step_s)
    return posterior


def shares(posterior: PlatePosterior) -> dict[str, float]:
    return {each.text: each.probability for each in posterior.candidates()}


def test_without_readings_there_are_no_candidates() -> None:
    assert PlatePosterior().candidates() == ()


def test_one_reading_is_its_own_posterior() -> None:
    once = reading(GN417KB=0.5, GN417K8=0.25, GM417KB=0.05)

    assert shares(after(once)) == pytest.approx({"GN417KB": 0.5, "GN417K8": 0.25, "GM417KB": 0.05})


def test_the_likeliest_text_is_first_and_probabilities_sum_to_less_than_one() -> None:
    candidates = after(*[reading(GN417K8=0.3, GN417KB=0.4)] * 5).candidates()

    assert [each.text for each in candidates] == ["GN417KB", "GN417K8"]
    assert sum(each.probability for each in candidates) < 1.0


def test_readings_that_agree_add_up_to_less_than_independent_ones() -> None:
    once, often = (
        shares(after(*[reading(GN417KB=0.6, GN417K8=0.3)] * count))["GN417KB"] for count in (1, 50)
    )

    assert once < often < 0.9


def test_the_text_that_all_readings_name_wins_over_the_likeliest_of_each() -> None:
    readings = [reading(GN417KB=0.3, **{f"GN{n}17KB": 0.4}) for n in range(4)]

    assert after(*readings).candidates()[0].text == "GN417KB"


def test_one_certain_misreading_does_not_change_the_likeliest_text() -> None:
    posterior = after(*[reading(GN417KB=0.95)] * 10, reading(RD288HX=0.99))

    assert posterior.candidates()[0].text == "GN417KB"


def test_another_plate_takes_over_in_time() -> None:
    posterior = after(*[reading(GN417KB=0.95)] * 20)
    for index in range(300):
        posterior.update(reading(RD288HX=0.95), 2.0 + 0.1 * index)

    assert posterior.candidates()[0].text == "RD288HX"


@pytest.mark.parametrize("nothing", [[], reading(KB=0.9), reading(N4=0.6, GN417KB=0.3)])
def test_a_reading_that_is_absent_or_of_a_fragment_changes_nothing(
    nothing: list[PlateCandidate],
) -> None:
    posterior = after(reading(GN417KB=0.5, GN417K8=0.3))
    before = posterior.candidates()

    posterior.update(nothing, 5.0)

    assert posterior.candidates() == before


def test_characters_drawn_alike_are_one_text_in_the_likeliest_spelling() -> None:
    posterior = after(reading(VAO34RM=0.5, VA034RM=0.3), reading(VA034RM=0.4, VAO34RM=0.2))

    assert [each.text for each in posterior.candidates()] == ["VAO34RM"]


def test_no_more_texts_are_kept_and_given_than_stated() -> None:
    posterior = PlatePosterior()
    for index in range(40):
        texts = {f"AB{index:02}{n:02}": 0.03 for n in range(30)}
        posterior.update(reading(GN417KB=0.05, **texts), 0.1 * index)

    assert len(posterior.candidates()) == MAX_CANDIDATES
    assert len(posterior.candidates(1000)) == POOL
    assert posterior.candidates()[0].text == "GN417KB"


def test_readings_out_of_order_and_impossible_probabilities_raise_nothing() -> None:
    posterior = after(reading(GN417KB=0.5))
    posterior.update(reading(GN417KB=0.0), -5.0)
    posterior.update(reading(GN417KB=1.0, GN417K8=1.0), -5.0)

    assert posterior.candidates()[0].probability < 1.0


def test_one_reading_makes_no_text_certain() -> None:
    assert after(reading(GN417KB=1.0)).certain_text is None


@pytest.mark.parametrize(("share", "text"), [(0.99, "GN417KB"), (0.7, None)])
def test_several_readings_make_a_text_certain_that_is_read_clearly(
    share: float, text: str | None
) -> None:
    readings = [reading(GN417KB=share, GN417K8=0.99 - share)] * 5

    assert after(*readings).certain_text == text


def test_a_plate_that_is_misread_alike_in_every_frame_is_never_certain() -> None:
    assert after(*[reading(H417KB=0.7)] * 100).certain_text is None


def test_a_text_read_two_ways_is_not_certain() -> None:
    both = [reading(GN417KB=0.95, GN417K8=0.04), reading(GN417K8=0.95, GN417KB=0.04)]

    assert after(*both * 20).certain_text is None


def test_a_mixture_of_two_plates_is_never_certain() -> None:
    parts = [reading(XAAAA=0.9), reading(AXAAA=0.9), reading(AAXAA=0.9)]

    assert after(*parts * 10).certain_text is None


def test_the_probability_of_a_text_counts_characters_drawn_alike_as_equal() -> None:
    posterior = after(reading(VAO34RM=0.6))

    assert posterior.probability("VA034RM") == pytest.approx(0.6)
    assert posterior.probability("GN417KB") == 0.0
    assert PlatePosterior().probability("GN417KB") == 1.0


def test_a_small_plate_that_is_misread_alike_in_every_frame_is_not_certain() -> None:
    posterior = PlatePosterior()
    for frame in range(15):
        posterior.update([PlateCandidate("SE652S0", 0.97)], frame / 10, WIDE_PX - 1.0)

    assert posterior.candidates(1)[0].probability >= CERTAIN_TEXT
    assert posterior.certain_text is None


def test_a_wide_plate_that_is_read_alike_in_two_frames_is_certain() -> None:
    """As plates of 100 px are, which were not certain: read right, with 0.88 to 0.95."""
    posterior = PlatePosterior()
    posterior.update([PlateCandidate("GN417KB", 0.94)], 0.0, 100.0)

    assert posterior.certain_text is None
    posterior.update([PlateCandidate("GN417KB", 0.88)], 0.1, 100.0)
    assert posterior.certain_text == "GN417KB"


def test_a_text_longer_than_a_plate_is_certain_by_surer_readings_only() -> None:
    """A photographed `5VCF203` with what is beside it."""
    posterior = PlatePosterior()
    for frame in range(15):
        posterior.update([PlateCandidate("M5VCF20377", 0.97)], frame / 10, 100.0)

    assert posterior.candidates(1)[0].probability >= CERTAIN_TEXT
    assert posterior.certain_text is None


def test_a_wide_plate_that_is_read_with_doubt_is_not_certain() -> None:
    posterior = PlatePosterior()
    for frame in range(15):
        posterior.update([PlateCandidate("AUP2403", 0.86)], frame / 10, 100.0)

    assert posterior.certain_text is None
