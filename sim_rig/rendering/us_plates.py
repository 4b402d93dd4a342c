"""North American plates, two to one: many designs, with pictures, slogans and stickers."""

import numpy as np

from sim_rig.rendering.emblems import colour, emblem, landscape, mark, near
from sim_rig.rendering.plate_art import Bgr, Disc, NumberRow, Outline, Patch, PlateFormat, SmallText
from sim_rig.rendering.plate_parts import (
    Beside,
    bolts,
    draw_font,
    draw_text,
    groups_of,
    small_print,
)
from sim_rig.rendering.plate_texts import US_PATTERNS, text_of
from sim_rig.rendering.stamped_glyphs import DIES

_FONTS = (
    *DIES,
    *("dies-round", "dies-square", "dies-plain", "dies-narrow", "dies-slanted") * 4,
    *("routed-gothic-narrow", "routed-gothic", "barlow-condensed-500", "dies-wide") * 2,
    *("roadgeek-2014-b", "roadgeek-2014-c", "osp-din", "barlow-semi-condensed-500") * 2,
)


def us_plate(rng: np.random.Generator) -> tuple[str, PlateFormat]:
    """A text without separators and the plate that carries it."""
    written = draw_text(rng, US_PATTERNS, free=0.22, rare=0.4)
    ground, ink = _colours(rng)
    prints = _prints(rng)
    stickers = _stickers(rng)
    spots = _spots(rng, ground)
    height_mm = rng.uniform(58, 78)
    separator = str(rng.choice(["|", " ", "-", ".", ""], p=[0.4, 0.28, 0.14, 0.08, 0.1]))
    picture = landscape(rng, ground) if rng.random() < 0.25 else ()
    beside = _beside(rng, ink) if rng.random() < 0.3 else Beside()
    row = NumberRow(
        x_mm=152 + (beside.left_mm - beside.right_mm) / 2 + rng.normal(0, 3),
        y_mm=rng.uniform(72, 86),
        h_mm=height_mm,
        w_mm=min(rng.uniform(225, 296), 293 - beside.left_mm - beside.right_mm),
        groups=groups_of(written),
        separator=separator,
        mark_bgr=colour(rng),
        mark=mark(rng, ink) if rng.random() < 0.65 else (),
        stretch=rng.uniform(0.62, 1.0),
    )
    plate = PlateFormat(
        name="us",
        width_mm=305,
        height_mm=152,
        font=draw_font(rng, _FONTS),
        rows=(row,),
        ground_bgr=ground,
        ground_bottom_bgr=near(ground, rng, 60) if rng.random() < 0.35 else None,
        ink_bgr=ink,
        spacing=rng.uniform(0.06, 0.2),
        cell=rng.uniform(0.5, 0.62) if rng.random() < 0.5 else None,
        weight_px=int(rng.integers(-2, 5)),
        border_mm=rng.uniform(2, 4) if rng.random() < 0.3 else 0,
        patches=stickers,
        small_texts=prints + beside.texts,
        discs_below=spots,
        outlines=picture + beside.outlines,
        discs=bolts(rng, 305, 152),
    )
    return written.replace(" ", ""), plate


def _prints(rng: np.random.Generator) -> tuple[SmallText, ...]:
    """A state over the number, and often something under it."""
    prints = []
    if rng.random() < 0.85:
        prints.append(
            small_print(rng, 152 + rng.normal(0, 6), rng.uniform(15, 26), rng.uniform(14, 26))
        )
    if rng.random() < 0.5:
        prints.append(small_print(rng, 152, rng.uniform(130, 142), rng.uniform(7, 15)))
    return tuple(prints)


def _stickers(rng: np.random.Generator) -> tuple[Patch, ...]:
    """Draw the stickers in the corners: the month and the year."""
    stickers = []
    for _ in range(rng.integers(0, 4)):
        corner = ((4, 8), (262, 8), (4, 118), (262, 118))[rng.integers(4)]
        size = rng.uniform(20, 38), rng.uniform(14, 26)
        stickers.append(Patch(*corner, *size, colour(rng)))
    return tuple(stickers)


def _spots(rng: np.random.Generator, ground: Bgr) -> tuple[Disc, ...]:
    """Pale ones, of a picture that is printed under the number."""
    return tuple(
        Disc(
            rng.uniform(20, 285),
            rng.uniform(20, 132),
            rng.uniform(8, 40),
            near(ground, rng, 35),
        )
        for _ in range(rng.integers(0, 5) if rng.random() < 0.4 else 0)
    )


def _beside(rng: np.random.Generator, ink: Bgr) -> Beside:
    """Letters of a class of vehicle, an emblem, or both."""
    room_mm = float(rng.uniform(22, 62))
    is_left = rng.random() < 0.6
    middle_mm = 8 + room_mm / 2 if is_left else 297 - room_mm / 2
    has_letters, has_emblem = ((True, False), (False, True), (True, True))[
        rng.choice(3, p=[0.4, 0.4, 0.2])
    ]
    texts: tuple[SmallText, ...] = ()
    outlines: tuple[Outline, ...] = ()
    if has_letters:
        inner_mm = middle_mm + (8 if is_left else -8) * has_emblem
        texts = tuple(_stacked(rng, inner_mm, min(room_mm, 34), ink))
    if has_emblem:
        tall_mm = min(80.0, room_mm * rng.uniform(0.8, 2.0))
        size_mm = room_mm * rng.uniform(0.6, 0.95), tall_mm
        outlines = emblem(rng, (middle_mm, rng.uniform(72, 95)), size_mm, ink)
    return Beside(
        left_mm=room_mm if is_left else 0.0,
        right_mm=0.0 if is_left else room_mm,
        texts=texts,
        outlines=outlines,
    )


def _stacked(rng: np.random.Generator, x_mm: float, w_mm: float, ink: Bgr) -> list[SmallText]:
    """One to three small characters over each other, or two side by side: a class of vehicle."""
    font = str(_FONTS[rng.integers(len(_FONTS))])
    sign = "LL" if rng.random() < 0.7 else "##"
    if rng.random() < 0.3:
        return [SmallText(text_of(sign, rng), x_mm, rng.uniform(60, 110), 26, w_mm, font, ink)]
    count = int(rng.integers(1, 4))
    letters = text_of((sign * 2)[:count], rng)
    height = min(32.0, 76 / count) * rng.uniform(0.75, 1.0)
    places = 82 + (np.arange(count) - (count - 1) / 2) * height * 1.15
    return [
        SmallText(letter, x_mm, float(y_mm), height, w_mm, font, ink)
        for letter, y_mm in zip(letters, places, strict=True)
    ]


def _colours(rng: np.random.Generator) -> tuple[Bgr, Bgr]:
    """Ground and ink: mostly dark on pale, sometimes white on dark."""
    inks: tuple[Bgr, ...] = ((20, 20, 20), (95, 45, 30), (60, 20, 20), (40, 90, 20), (40, 30, 150))
    ink = near(inks[rng.choice(5, p=[0.35, 0.35, 0.15, 0.08, 0.07])], rng, 15)
    pale = int(rng.integers(190, 250))
    ground = near((pale, pale, pale), rng, 22)
    if rng.random() < 0.08:
        return near((120, 60, 30), rng, 40), (240, 240, 240)
    return ground, ink
