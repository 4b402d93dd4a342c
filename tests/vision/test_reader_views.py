"""Training views of the reader: rendered plates, cut out as by the detector."""

import numpy as np

from onboard.vision.plate_reader import ALPHABET, READER_SIZE, rectified_views
from training.reader_views import render_validation_plates, render_views


def test_the_same_seed_gives_the_same_views_and_texts() -> None:
    views, texts = render_views(12, np.random.default_rng(4))
    again, texts_again = render_views(12, np.random.default_rng(4))

    assert views.shape == (12, *READER_SIZE[::-1])
    assert np.array_equal(views, again)
    assert texts == texts_again
    assert all(set(text) <= set(ALPHABET) for text in texts)


def test_validation_plates_have_the_readers_views() -> None:
    views, texts = render_validation_plates(4, np.random.default_rng(4))
    nothing = rectified_views(np.zeros((20, 40), np.uint8), np.zeros((4, 2), np.float32))

    assert views.shape == (4, *nothing.shape)
    assert len(set(texts)) == 1, "one plate is photographed four times"
