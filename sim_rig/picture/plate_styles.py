"""Plates of no country in particular: designs drawn at random around those that exist.

Three families, by shape: two-to-one (North America), long (Europe), and three-to-one (South
America), the last also in two rows for motorcycles. Everything varies: font, its stretch and
weight, colours, what is printed around the number, what a holder covers.
"""

from dataclasses import dataclass, replace

import numpy as np

from sim_rig.picture.dies import DIES
from sim_rig.picture.emblems import colour, crest, emblem, landscape, mark, near
from sim_rig.picture.glyphs import SCRIPT, font_names
from sim_rig.picture.plate_art import (
    Bgr,
    Disc,
    NumberRow,
    Outline,
    Patch,
    PlateFormat,
    SmallText,
)
from sim_rig.picture.plate_texts import (
    BR_PATTERNS,
    EU_PATTERNS,
    US_PATTERNS,
    any_text,
    text_of,
    word,
)

_PRINT_FONTS = ("overpass-600", "barlow-semi-condensed-700", "roboto-condensed-700", SCRIPT)
_US_FONTS = (
    *DIES,
    *("dies-round", "dies-square", "dies-plain", "dies-narrow", "dies-slanted") * 4,
    *("routed-gothic-narrow", "routed-gothic", "barlow-condensed-500", "dies-wide") * 2,
    *("roadgeek-2014-b", "roadgeek-2014-c", "osp-din", "barlow-semi-condensed-500") * 2,
)
_EU_FONTS = (
    *("barlow-semi-condensed-500", "barlow-condensed-500", "osp-din") * 3,
    *("roadgeek-2014-c", "overpass-600", "roboto-condensed-500", "routed-gothic-narrow") * 2,
)
_BR_FONTS = (
    *("roadgeek-2014-c", "routed-gothic", "overpass-600", "barlow-semi-condensed-700") * 4,
    *("dies-wide", "dies-bare", "dies-bare-wide") * 5,
    *DIES,
)
HELD_BACK = (
    *("archivo-narrow-600", "rajdhani-600", "roboto-condensed-700"),
    *("dies-36", "dies-37", "dies-38", "dies-39"),
)
"""Fonts that number no plate unless asked for: to measure on what nobody has learnt."""


@dataclass(frozen=True, slots=True)
class _Beside:
    """What stands beside the number and is not part of it."""

    left_mm: float = 0.0
    """The room that it takes at the left end of the plate."""
    right_mm: float = 0.0
    texts: tuple[SmallText, ...] = ()
    patches: tuple[Patch, ...] = ()
    discs: tuple[Disc, ...] = ()
    outlines: tuple[Outline, ...] = ()


def random_plate(rng: np.random.Generator, *, held_back: bool = False) -> tuple[str, PlateFormat]:
    """A text without separators and the plate that carries it, in a font held back or another."""
    draw = (_us_plate, _eu_plate, _br_plate)[rng.choice(3, p=[0.56, 0.26, 0.18])]
    text, plate = draw(rng)
    if rng.random() < 0.35:
        plate = _in_holder(plate, rng)
    if rng.random() < 0.35:
        plate = replace(plate, emboss=rng.uniform(20, 160))
    if held_back:
        plate = replace(plate, font=HELD_BACK[rng.integers(len(HELD_BACK))])
    return text, plate


def _us_plate(rng: np.random.Generator) -> tuple[str, PlateFormat]:
    written = _text(rng, US_PATTERNS, free=0.22, rare=0.4)
    ground, ink = _us_colours(rng)
    prints = _us_prints(rng)
    stickers = _us_stickers(rng)
    spots = _us_spots(rng, ground)
    height_mm = rng.uniform(58, 78)
    separator = str(rng.choice(["|", " ", "-", ".", ""], p=[0.4, 0.28, 0.14, 0.08, 0.1]))
    picture = landscape(rng, ground) if rng.random() < 0.25 else ()
    beside = _us_beside(rng, ink) if rng.random() < 0.3 else _Beside()
    row = NumberRow(
        x_mm=152 + (beside.left_mm - beside.right_mm) / 2 + rng.normal(0, 3),
        y_mm=rng.uniform(72, 86),
        h_mm=height_mm,
        w_mm=min(rng.uniform(225, 296), 293 - beside.left_mm - beside.right_mm),
        groups=_groups(written),
        separator=separator,
        mark_bgr=colour(rng),
        mark=mark(rng, ink) if rng.random() < 0.65 else (),
        stretch=rng.uniform(0.62, 1.0),
    )
    plate = PlateFormat(
        name="us",
        width_mm=305,
        height_mm=152,
        font=_font(rng, _US_FONTS),
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
        discs=_bolts(rng, 305, 152),
    )
    return written.replace(" ", ""), plate


def _us_prints(rng: np.random.Generator) -> tuple[SmallText, ...]:
    """A state over the number, and often something under it."""
    prints = []
    if rng.random() < 0.85:
        prints.append(_print(rng, 152 + rng.normal(0, 6), rng.uniform(15, 26), rng.uniform(14, 26)))
    if rng.random() < 0.5:
        prints.append(_print(rng, 152, rng.uniform(130, 142), rng.uniform(7, 15)))
    return tuple(prints)


def _us_stickers(rng: np.random.Generator) -> tuple[Patch, ...]:
    """In the corners: the month and the year."""
    stickers = []
    for _ in range(rng.integers(0, 4)):
        corner = ((4, 8), (262, 8), (4, 118), (262, 118))[rng.integers(4)]
        size = rng.uniform(20, 38), rng.uniform(14, 26)
        stickers.append(Patch(*corner, *size, colour(rng)))
    return tuple(stickers)


def _us_spots(rng: np.random.Generator, ground: Bgr) -> tuple[Disc, ...]:
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


def _us_beside(rng: np.random.Generator, ink: Bgr) -> _Beside:
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
    return _Beside(
        left_mm=room_mm if is_left else 0.0,
        right_mm=0.0 if is_left else room_mm,
        texts=texts,
        outlines=outlines,
    )


def _eu_plate(rng: np.random.Generator) -> tuple[str, PlateFormat]:
    written = _text(rng, EU_PATTERNS, free=0.25, rare=0.6)
    ground: Bgr = (235, 238, 240)
    ink: Bgr = (25, 22, 20)
    if rng.random() < 0.12:
        ground = (40, 200, 240)
    elif rng.random() < 0.06:
        ground, ink = (25, 22, 20), (235, 238, 240)
    ground = near(ground, rng, 12)
    width_mm = float(rng.choice([520.0, 480.0, 440.0], p=[0.8, 0.1, 0.1]))
    beside = _eu_country(rng, ink) if rng.random() < 0.75 else _Beside(left_mm=10.0)
    height_mm = rng.uniform(68, 82)
    has_seals = rng.random() < 0.45
    separator = str(rng.choice([":", "|"] if has_seals else [" ", "-", "-"]))
    room_mm = width_mm - beside.left_mm - rng.uniform(12, 40)
    row = NumberRow(
        x_mm=beside.left_mm + room_mm / 2 + (width_mm - beside.left_mm - room_mm) / 2,
        y_mm=55 + rng.normal(0, 1.5),
        h_mm=height_mm,
        w_mm=room_mm,
        groups=_groups(written),
        separator=separator,
        mark_bgr=colour(rng),
        mark=mark(rng, ink) if rng.random() < 0.75 else (),
        stretch=rng.uniform(0.85, 1.3),
    )
    plate = PlateFormat(
        name="eu",
        width_mm=width_mm,
        height_mm=110,
        font=_font(rng, _EU_FONTS),
        rows=(row,),
        ground_bgr=ground,
        ink_bgr=ink,
        spacing=rng.uniform(0.1, 0.24),
        cell=rng.uniform(0.55, 0.65) if rng.random() < 0.3 else None,
        weight_px=int(rng.integers(-2, 4)),
        border_mm=rng.uniform(2, 5) if rng.random() < 0.7 else 0,
        patches=beside.patches,
        small_texts=beside.texts,
        discs_below=beside.discs,
        outlines=beside.outlines,
        discs=_bolts(rng, width_mm, 110) if rng.random() < 0.3 else (),
    )
    return written.replace(" ", ""), plate


def _eu_country(rng: np.random.Generator, ink: Bgr) -> _Beside:
    """A code on a blue band, or on the plate's own ground under a coat of arms."""
    code = text_of("LL"[: rng.integers(1, 3)], rng)
    if rng.random() < 0.65:
        return _Beside(
            left_mm=48.0,
            patches=(Patch(0, 0, 44, 110, (int(rng.integers(90, 190)), 60, 15)),),
            texts=(SmallText(code, 22, 85, 22, 32, "osp-din", (240, 240, 240)),),
            discs=(Disc(22, 38, rng.uniform(8, 15), (int(rng.integers(0, 220)), 170, 200)),),
        )
    return _Beside(
        left_mm=48.0,
        texts=(SmallText(code, 24, 84, rng.uniform(20, 30), 34, "osp-din", ink),),
        outlines=crest(rng, (24, 34), (rng.uniform(18, 30), rng.uniform(24, 44)), ink),
    )


def _br_plate(rng: np.random.Generator) -> tuple[str, PlateFormat]:
    written = _text(rng, BR_PATTERNS, free=0.15, rare=1.0)
    newer = rng.random() < 0.25
    grey = int(rng.integers(150, 225))
    ground = near((235, 235, 235) if newer else (grey, grey, grey), rng, 8)
    ink: Bgr = (30, 28, 28)
    if not newer and rng.random() < 0.1:
        ground, ink = near((40, 40, 170), rng, 20), (235, 235, 235)
    small, patches = [], []
    if newer:
        patches.append(Patch(0, 0, 400, 32, (150, 60, 10)))
        small.append(_print(rng, 200, 16, 18, bgr=(240, 240, 240)))
    else:
        small.append(
            _print(rng, 200 + rng.normal(0, 4), rng.uniform(22, 30), rng.uniform(12, 18), bgr=ink)
        )
    row = NumberRow(
        x_mm=200 + rng.normal(0, 3),
        y_mm=rng.uniform(76, 84),
        h_mm=rng.uniform(58, 68),
        w_mm=rng.uniform(330, 375),
        groups=_groups(written),
        separator=" " if newer else str(rng.choice([".", "-", " "], p=[0.7, 0.2, 0.1])),
        stretch=rng.uniform(1.0, 1.5),
    )
    plate = PlateFormat(
        name="br",
        width_mm=400,
        height_mm=130,
        font=_font(rng, _BR_FONTS),
        rows=(row,),
        ground_bgr=ground,
        ink_bgr=ink,
        spacing=rng.uniform(0.08, 0.2),
        weight_px=int(rng.integers(-1, 5)),
        border_mm=rng.uniform(2, 5) if rng.random() < 0.5 else 0,
        patches=tuple(patches),
        small_texts=tuple(small),
        discs=_bolts(rng, 400, 130),
    )
    if rng.random() < 0.08:
        plate = _in_two_rows(plate, written, rng)
    return written.replace(" ", ""), plate


def _in_two_rows(plate: PlateFormat, written: str, rng: np.random.Generator) -> PlateFormat:
    """The motorcycle's plate: the first group over the rest."""
    first = len(written.split(maxsplit=1)[0]) if " " in written else min(3, len(written) - 1)
    row = replace(plate.rows[0], groups=(first,), separator=" ", h_mm=42, x_mm=100, w_mm=150)
    rows = (replace(row, y_mm=72), replace(row, y_mm=128, w_mm=170, groups=(len(written),)))
    small = tuple(replace(text, x_mm=100, w_mm=130) for text in plate.small_texts)
    return replace(
        plate,
        name="br motorcycle",
        width_mm=200,
        height_mm=170,
        rows=rows,
        small_texts=small,
        patches=(),
        discs=_bolts(rng, 200, 170),
    )


def _in_holder(plate: PlateFormat, rng: np.random.Generator) -> PlateFormat:
    """A dealer's frame: bars at top and bottom, often with a name, sometimes over the number."""
    width, height = plate.width_mm, plate.height_mm
    shade: Bgr = (28, 28, 28) if rng.random() < 0.6 else colour(rng)
    ink: Bgr = (235, 235, 235) if sum(shade) < 380 else (20, 20, 20)
    row = plate.rows[-1]
    free_below = height - (row.y_mm + row.h_mm / 2)
    bottom = float(np.clip(free_below + rng.uniform(-14, 8), 5, 36))
    top = rng.uniform(4, 28) if plate.name == "us" else rng.uniform(2, 8)
    side = rng.uniform(2, 8)
    frame = (
        Patch(0, height - bottom, width, bottom, shade),
        Patch(0, 0, width, top, shade),
        Patch(0, 0, side, height, shade),
        Patch(width - side, 0, side, height, shade),
    )
    texts = []
    for y, thickness in ((height - bottom / 2, bottom), (top / 2, top)):
        if thickness > 8 and rng.random() < 0.75:
            texts.append(
                _print(rng, width / 2, y, thickness * rng.uniform(0.5, 0.9), bgr=ink, w_mm=width)
            )
    return replace(plate, frame=frame, frame_texts=tuple(texts), discs=())


def _stacked(rng: np.random.Generator, x_mm: float, w_mm: float, ink: Bgr) -> list[SmallText]:
    """One to three small characters over each other, or two side by side: a class of vehicle."""
    font = str(_US_FONTS[rng.integers(len(_US_FONTS))])
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


def _text(rng: np.random.Generator, patterns: tuple[str, ...], *, free: float, rare: float) -> str:
    if rng.random() < free:
        return any_text(rng)
    return text_of(patterns[rng.integers(len(patterns))], rng, rare=rare)


def _groups(written: str) -> tuple[int, ...]:
    return tuple(len(group) for group in written.split()[:-1])


def _font(rng: np.random.Generator, preferred: tuple[str, ...]) -> str:
    fonts = preferred if rng.random() < 0.75 else font_names()
    known = [font for font in fonts if font not in HELD_BACK]
    return known[rng.integers(len(known))]


def _print(
    rng: np.random.Generator,
    x_mm: float,
    y_mm: float,
    h_mm: float,
    *,
    bgr: Bgr | None = None,
    w_mm: float = 190,
) -> SmallText:
    font = _PRINT_FONTS[rng.integers(len(_PRINT_FONTS))]
    return SmallText(word(rng), x_mm, y_mm, h_mm, 0.85 * w_mm, font, bgr or colour(rng))


def _us_colours(rng: np.random.Generator) -> tuple[Bgr, Bgr]:
    """Ground and ink: mostly dark on pale, sometimes white on dark."""
    inks: tuple[Bgr, ...] = ((20, 20, 20), (95, 45, 30), (60, 20, 20), (40, 90, 20), (40, 30, 150))
    ink = near(inks[rng.choice(5, p=[0.35, 0.35, 0.15, 0.08, 0.07])], rng, 15)
    pale = int(rng.integers(190, 250))
    ground = near((pale, pale, pale), rng, 22)
    if rng.random() < 0.08:
        return near((120, 60, 30), rng, 40), (240, 240, 240)
    return ground, ink


def _bolts(rng: np.random.Generator, width: float, height: float) -> tuple[Disc, ...]:
    grey = int(rng.integers(30, 200))
    inset_x, inset_y = rng.uniform(0.18, 0.3) * width, rng.uniform(0.07, 0.12) * height
    places = [(x, y) for y in (inset_y, height - inset_y) for x in (inset_x, width - inset_x)]
    return tuple(
        Disc(x, y, rng.uniform(2.5, 6), (grey, grey, grey)) for x, y in places if rng.random() < 0.6
    )
