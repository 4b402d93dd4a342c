"""Random parts that all families of plates share."""

from dataclasses import dataclass

import numpy as np

from sim_rig.rendering.emblems import colour
from sim_rig.rendering.glyphs import SCRIPT, font_names
from sim_rig.rendering.plate_art import Bgr, Disc, Outline, Patch, SmallText
from sim_rig.rendering.plate_texts import any_text, text_of, word

_PRINT_FONTS = ("overpass-600", "barlow-semi-condensed-700", "roboto-condensed-700", SCRIPT)
VALIDATION_FONTS = (
    *("archivo-narrow-600", "rajdhani-600", "roboto-condensed-700"),
    *("dies-36", "dies-37", "dies-38", "dies-39"),
)
"""Fonts reserved for validation: training plates do not use them."""


@dataclass(frozen=True, slots=True)
class Beside:
    """Parts of a plate beside its number."""

    left_mm: float = 0.0
    """Width at the left end of the plate."""
    right_mm: float = 0.0
    texts: tuple[SmallText, ...] = ()
    patches: tuple[Patch, ...] = ()
    discs: tuple[Disc, ...] = ()
    outlines: tuple[Outline, ...] = ()


def draw_text(
    rng: np.random.Generator, patterns: tuple[str, ...], *, free: float, rare: float
) -> str:
    """Draw a number; spaces separate its groups.

    Args:
        rng: source of all random numbers.
        patterns: the patterns to choose from; see `text_of`.
        free: probability of a number without a pattern.
        rare: share of the others that may have I, O and Q.
    """
    if rng.random() < free:
        return any_text(rng)
    return text_of(patterns[rng.integers(len(patterns))], rng, rare=rare)


def groups_of(written: str) -> tuple[int, ...]:
    """How many characters its groups have, but for the last."""
    return tuple(len(group) for group in written.split()[:-1])


def draw_font(rng: np.random.Generator, preferred: tuple[str, ...]) -> str:
    """Draw a font, mostly a preferred one, and never a validation font."""
    fonts = preferred if rng.random() < 0.75 else font_names()
    known = [font for font in fonts if font not in VALIDATION_FONTS]
    return known[rng.integers(len(known))]


def small_print(
    rng: np.random.Generator,
    x_mm: float,
    y_mm: float,
    h_mm: float,
    *,
    bgr: Bgr | None = None,
    w_mm: float = 190,
) -> SmallText:
    """Draw a word in a print font.

    Args:
        rng: source of all random numbers.
        x_mm: its centre, from the left of the plate.
        y_mm: its centre, from the top.
        h_mm: height of the letters.
        bgr: colour; random if not given.
        w_mm: width available.
    """
    font = _PRINT_FONTS[rng.integers(len(_PRINT_FONTS))]
    return SmallText(word(rng), x_mm, y_mm, h_mm, 0.85 * w_mm, font, bgr or colour(rng))


def bolts(rng: np.random.Generator, width_mm: float, height_mm: float) -> tuple[Disc, ...]:
    """Draw up to four bolts, near the corners of a plate.

    Args:
        rng: source of all random numbers.
        width_mm: width of the plate.
        height_mm: height of the plate.
    """
    grey = int(rng.integers(30, 200))
    inset_x, inset_y = rng.uniform(0.18, 0.3) * width_mm, rng.uniform(0.07, 0.12) * height_mm
    places = [(x, y) for y in (inset_y, height_mm - inset_y) for x in (inset_x, width_mm - inset_x)]
    return tuple(
        Disc(x, y, rng.uniform(2.5, 6), (grey, grey, grey)) for x, y in places if rng.random() < 0.6
    )
