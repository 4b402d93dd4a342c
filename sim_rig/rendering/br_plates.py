"""South American plates, three to one, and in two rows for motorcycles."""

from dataclasses import replace

import numpy as np

from sim_rig.rendering.emblems import near
from sim_rig.rendering.plate_art import Bgr, NumberRow, Patch, PlateFormat
from sim_rig.rendering.plate_parts import bolts, draw_font, draw_text, groups_of, small_print
from sim_rig.rendering.plate_texts import BR_PATTERNS
from sim_rig.rendering.stamped_glyphs import DIES

_FONTS = (
    *("roadgeek-2014-c", "routed-gothic", "overpass-600", "barlow-semi-condensed-700") * 4,
    *("dies-wide", "dies-bare", "dies-bare-wide") * 5,
    *DIES,
)


def br_plate(rng: np.random.Generator) -> tuple[str, PlateFormat]:
    """A text without separators and the plate that carries it."""
    written = draw_text(rng, BR_PATTERNS, free=0.15, rare=1.0)
    newer = rng.random() < 0.25
    grey = int(rng.integers(150, 225))
    ground = near((235, 235, 235) if newer else (grey, grey, grey), rng, 8)
    ink: Bgr = (30, 28, 28)
    if not newer and rng.random() < 0.1:
        ground, ink = near((40, 40, 170), rng, 20), (235, 235, 235)
    small, patches = [], []
    if newer:
        patches.append(Patch(0, 0, 400, 32, (150, 60, 10)))
        small.append(small_print(rng, 200, 16, 18, bgr=(240, 240, 240)))
    else:
        small.append(
            small_print(
                rng, 200 + rng.normal(0, 4), rng.uniform(22, 30), rng.uniform(12, 18), bgr=ink
            )
        )
    row = NumberRow(
        x_mm=200 + rng.normal(0, 3),
        y_mm=rng.uniform(76, 84),
        h_mm=rng.uniform(58, 68),
        w_mm=rng.uniform(330, 375),
        groups=groups_of(written),
        separator=" " if newer else str(rng.choice([".", "-", " "], p=[0.7, 0.2, 0.1])),
        stretch=rng.uniform(1.0, 1.5),
    )
    plate = PlateFormat(
        name="br",
        width_mm=400,
        height_mm=130,
        font=draw_font(rng, _FONTS),
        rows=(row,),
        ground_bgr=ground,
        ink_bgr=ink,
        spacing=rng.uniform(0.08, 0.2),
        weight_px=int(rng.integers(-1, 5)),
        border_mm=rng.uniform(2, 5) if rng.random() < 0.5 else 0,
        patches=tuple(patches),
        small_texts=tuple(small),
        discs=bolts(rng, 400, 130),
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
        discs=bolts(rng, 200, 170),
    )
