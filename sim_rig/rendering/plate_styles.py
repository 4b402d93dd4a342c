"""Plates of no country in particular: designs drawn at random around those that exist.

Three families, by shape: two-to-one (North America), long (Europe), and three-to-one (South
America), the last also in two rows for motorcycles. Everything varies: font, its stretch and
weight, colours, what is printed around the number, what a holder covers.
"""

from dataclasses import replace

import numpy as np

from sim_rig.rendering.br_plates import br_plate
from sim_rig.rendering.emblems import colour
from sim_rig.rendering.eu_plates import eu_plate
from sim_rig.rendering.plate_art import Bgr, Patch, PlateFormat
from sim_rig.rendering.plate_parts import VALIDATION_FONTS, small_print
from sim_rig.rendering.us_plates import us_plate


def random_plate(
    rng: np.random.Generator, *, validation_font: bool = False
) -> tuple[str, PlateFormat]:
    """Return a text without separators and its plate, in a training or a validation font."""
    draw = (us_plate, eu_plate, br_plate)[rng.choice(3, p=[0.56, 0.26, 0.18])]
    text, plate = draw(rng)
    if rng.random() < 0.35:
        plate = _in_holder(plate, rng)
    if rng.random() < 0.35:
        plate = replace(plate, emboss=rng.uniform(20, 160))
    if validation_font:
        plate = replace(plate, font=VALIDATION_FONTS[rng.integers(len(VALIDATION_FONTS))])
    return text, plate


def _in_holder(plate: PlateFormat, rng: np.random.Generator) -> PlateFormat:
    """A dealer's frame: bars at top and bottom, often with a name, sometimes over the number."""
    width_mm, height_mm = plate.width_mm, plate.height_mm
    shade: Bgr = (28, 28, 28) if rng.random() < 0.6 else colour(rng)
    ink: Bgr = (235, 235, 235) if sum(shade) < 380 else (20, 20, 20)
    row = plate.rows[-1]
    free_below_mm = height_mm - (row.y_mm + row.h_mm / 2)
    bottom_mm = float(np.clip(free_below_mm + rng.uniform(-14, 8), 5, 36))
    top_mm = rng.uniform(4, 28) if plate.name == "us" else rng.uniform(2, 8)
    side_mm = rng.uniform(2, 8)
    frame = (
        Patch(0, height_mm - bottom_mm, width_mm, bottom_mm, shade),
        Patch(0, 0, width_mm, top_mm, shade),
        Patch(0, 0, side_mm, height_mm, shade),
        Patch(width_mm - side_mm, 0, side_mm, height_mm, shade),
    )
    texts = []
    for y_mm, thickness_mm in ((height_mm - bottom_mm / 2, bottom_mm), (top_mm / 2, top_mm)):
        if thickness_mm > 8 and rng.random() < 0.75:
            texts.append(
                small_print(
                    rng,
                    width_mm / 2,
                    y_mm,
                    thickness_mm * rng.uniform(0.5, 0.9),
                    bgr=ink,
                    w_mm=width_mm,
                )
            )
    return replace(plate, frame=frame, frame_texts=tuple(texts), discs=())
