"""European plates, long and plain, with or without a band for the country."""

import numpy as np

from sim_rig.rendering.emblems import colour, crest, mark, near
from sim_rig.rendering.plate_art import Bgr, Disc, NumberRow, Patch, PlateFormat, SmallText
from sim_rig.rendering.plate_parts import Beside, bolts, draw_font, draw_text, groups_of
from sim_rig.rendering.plate_texts import EU_PATTERNS, text_of

_FONTS = (
    *("barlow-semi-condensed-500", "barlow-condensed-500", "osp-din") * 3,
    *("roadgeek-2014-c", "overpass-600", "roboto-condensed-500", "routed-gothic-narrow") * 2,
)


def eu_plate(rng: np.random.Generator) -> tuple[str, PlateFormat]:
    """A text without separators and the plate that carries it."""
    written = draw_text(rng, EU_PATTERNS, free=0.25, rare=0.6)
    ground: Bgr = (235, 238, 240)
    ink: Bgr = (25, 22, 20)
    if rng.random() < 0.12:
        ground = (40, 200, 240)
    elif rng.random() < 0.06:
        ground, ink = (25, 22, 20), (235, 238, 240)
    ground = near(ground, rng, 12)
    width_mm = float(rng.choice([520.0, 480.0, 440.0], p=[0.8, 0.1, 0.1]))
    beside = _country(rng, ink) if rng.random() < 0.75 else Beside(left_mm=10.0)
    height_mm = rng.uniform(68, 82)
    has_seals = rng.random() < 0.45
    separator = str(rng.choice([":", "|"] if has_seals else [" ", "-", "-"]))
    room_mm = width_mm - beside.left_mm - rng.uniform(12, 40)
    row = NumberRow(
        x_mm=beside.left_mm + room_mm / 2 + (width_mm - beside.left_mm - room_mm) / 2,
        y_mm=55 + rng.normal(0, 1.5),
        h_mm=height_mm,
        w_mm=room_mm,
        groups=groups_of(written),
        separator=separator,
        mark_bgr=colour(rng),
        mark=mark(rng, ink) if rng.random() < 0.75 else (),
        stretch=rng.uniform(0.85, 1.3),
    )
    plate = PlateFormat(
        name="eu",
        width_mm=width_mm,
        height_mm=110,
        font=draw_font(rng, _FONTS),
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
        discs=bolts(rng, width_mm, 110) if rng.random() < 0.3 else (),
    )
    return written.replace(" ", ""), plate


def _country(rng: np.random.Generator, ink: Bgr) -> Beside:
    """A code on a blue band, or on the plate's own ground under a coat of arms."""
    code = text_of("LL"[: rng.integers(1, 3)], rng)
    if rng.random() < 0.65:
        return Beside(
            left_mm=48.0,
            patches=(Patch(0, 0, 44, 110, (int(rng.integers(90, 190)), 60, 15)),),
            texts=(SmallText(code, 22, 85, 22, 32, "osp-din", (240, 240, 240)),),
            discs=(Disc(22, 38, rng.uniform(8, 15), (int(rng.integers(0, 220)), 170, 200)),),
        )
    return Beside(
        left_mm=48.0,
        texts=(SmallText(code, 24, 84, rng.uniform(20, 30), 34, "osp-din", ink),),
        outlines=crest(rng, (24, 34), (rng.uniform(18, 30), rng.uniform(24, 44)), ink),
    )
