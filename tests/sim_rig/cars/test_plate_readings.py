"""The modelled readings of a plate, held against readings of photographs made smaller."""

import numpy as np
import pytest

from onboard.observations import PlateCandidate
from onboard.vision.plate_posterior import PlatePosterior
from sim_rig.cars.camera_view import FPS
from sim_rig.cars.plate_readings import CHARACTERS, TEXTS, PlateReadings

RANKS = (1, 8, 16, 30)
PHOTOGRAPHS = {
    45.0: (186, 206, 208, 211),
    36.0: (134, 191, 199, 205),
    30.0: (82, 145, 161, 167),
    25.0: (27, 58, 75, 86),
}
"""Of 217 photographs (109 us, 50 eu, 58 br) made smaller until the plate has the width in px: those
whose text is among the K likeliest of a beam search over the three views, for K = 1, 8, 16, 30."""
PLATES = 500


def plate_of(seed: int) -> tuple[str, PlateReadings]:
    rng = np.random.default_rng(seed)
    return "".join(rng.choice(list(CHARACTERS), 7)), PlateReadings(rng)


def probability_of(text: str, candidates: tuple[PlateCandidate, ...]) -> float:
    return sum(each.probability for each in candidates if each.text == text)


@pytest.mark.parametrize("width_px", PHOTOGRAPHS)
def test_as_many_plates_as_on_photographs_are_among_the_likeliest_texts(width_px: float) -> None:
    ranks = []
    for seed in range(PLATES):
        text, readings = plate_of(seed)
        texts = [each.text for each in readings.read(text, width_px)]
        ranks.append(texts.index(text) if text in texts else TEXTS)
    for k, right in zip(RANKS, PHOTOGRAPHS[width_px], strict=True):
        share = np.mean(np.array(ranks) < k)
        assert share == pytest.approx(right / 217, abs=0.06), k


def test_a_probability_is_the_share_of_the_plates_that_bear_the_text() -> None:
    said, right = 0.0, 0
    for seed in range(PLATES):
        text, readings = plate_of(seed)
        likeliest = readings.read(text, 36.0)[0]
        said += likeliest.probability
        right += likeliest.text == text
    assert right / PLATES == pytest.approx(said / PLATES, abs=0.05)


def test_a_misread_character_lasts_for_seconds() -> None:
    lasting = []
    for seed in range(PLATES // 2):
        text, readings = plate_of(seed)
        first = readings.read(text, 36.0)[0].text
        for _ in range(round(2.0 * FPS)):
            readings.advance()
        later = readings.read(text, 36.0)[0].text
        lasting += [
            now == before
            for true, before, now in zip(text, first, later, strict=True)
            if before != true
        ]
    assert 0.06 < np.mean(lasting) < 0.3  # 1 in 34 by chance


@pytest.mark.long
def test_frames_together_tell_more_than_one() -> None:
    alone, together = [], []
    for seed in range(100):
        text, readings = plate_of(seed)
        posterior = PlatePosterior()
        alone.append(probability_of(text, readings.read(text, 30.0)))
        for frame in range(20):
            posterior.update(readings.read(text, 30.0), frame / FPS)
            readings.advance()
        together.append(probability_of(text, posterior.candidates()))
    assert np.mean(together) > np.mean(alone) + 0.1


def test_the_same_seed_gives_the_same_readings() -> None:
    one, other = (plate_of(7)[1] for _ in range(2))
    for _ in range(3):
        assert one.read("RD288HX", 40.0) == other.read("RD288HX", 40.0)
        one.advance()
        other.advance()


def test_o_and_zero_are_one_candidate() -> None:
    texts = [each.text for each in PlateReadings(np.random.default_rng(1)).read("BOI0", 90.0)]
    assert "B010" in texts
    assert len(set(texts)) == len(texts) == TEXTS
    assert not any(set(text) & set("OI") for text in texts)
