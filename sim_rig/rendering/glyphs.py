"""Masks of characters and texts, from the shipped fonts and from drawn glyphs."""

from functools import cache, lru_cache
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

from sim_rig.rendering.stamped_glyphs import DIES, die

FONT_FOLDER = Path(__file__).parent / "fonts"
CAP_HEIGHT_PX = 96
"""Height of a capital letter in every mask; callers scale the mask."""
SCRIPT = "script"
"""Drawn by OpenCV, for names and slogans only."""

Mask = npt.NDArray[np.uint8]
"""(h, w), 255 where there is ink."""


def font_names() -> list[str]:
    """Names of the shipped fonts, by file stem, and of the drawn glyph sets."""
    return sorted([*DIES, *(path.stem for path in FONT_FOLDER.glob("*.ttf"))])


@cache
def _font(name: str) -> ImageFont.FreeTypeFont:
    """The font at the size that makes a capital letter `CAP_HEIGHT_PX` high."""
    path = FONT_FOLDER / f"{name}.ttf"
    if not path.is_file():
        raise ValueError(f"no font {name!r}; there are {', '.join(font_names())}")
    trial = ImageFont.truetype(path, 200)
    top, bottom = trial.getbbox("H")[1::2]
    return ImageFont.truetype(path, 200 * CAP_HEIGHT_PX / (bottom - top))


@lru_cache(maxsize=8192)
def glyph(font: str, character: str) -> Mask:
    """Mask of one character, `CAP_HEIGHT_PX` high (but for Q cut where it hangs lower), tight in x.

    Raises:
        ValueError: no such font.
    """
    if font in DIES:
        return die(font, character, CAP_HEIGHT_PX)
    if font == SCRIPT:
        return _handwritten(character)
    face = _font(font)
    left, _, right, bottom = face.getbbox(character)
    top = face.getbbox("H")[1]
    # The tail of a Q hangs below the line: plates squeeze the letter rather than cut it off.
    height_px = CAP_HEIGHT_PX if character != "Q" else max(CAP_HEIGHT_PX, int(bottom - top))
    image = Image.new("L", (max(1, int(right - left)), height_px))
    ImageDraw.Draw(image).text((-left, -top), character, font=face, fill=255)
    mask = np.asarray(image, dtype=np.uint8)
    return np.asarray(cv2.resize(mask, (mask.shape[1], CAP_HEIGHT_PX)), np.uint8)


def _handwritten(character: str) -> Mask:
    """One character of OpenCV's script, as the names of some states are printed."""
    face, scale, thickness = cv2.FONT_HERSHEY_SCRIPT_COMPLEX, 3.0, 6
    (width, _), below = cv2.getTextSize(character, face, scale, thickness)
    mask = np.zeros((CAP_HEIGHT_PX, max(1, width)), np.uint8)
    at = (0, CAP_HEIGHT_PX - below // 2)
    cv2.putText(mask, character, at, face, scale, 255, thickness, cv2.LINE_AA)
    return mask


def text_row(
    text: str,
    font: str,
    *,
    spacing: float = 0.12,
    cell: float | None = None,
    weight_px: int = 0,
) -> Mask:
    """Mask of `text` in one row, `CAP_HEIGHT_PX` high.

    Args:
        text: characters of the font; a space takes 0.3 of the cap height.
        font: a name of `font_names()`.
        spacing: between characters, as a share of the cap height.
        cell: if given, every character sits in the middle of a cell of this share of the cap
            height, as dies of equal width stamp it.
        weight_px: strokes grow (or, negative, shrink) by this many pixels on either side.

    Raises:
        ValueError: no such font.
    """
    gap_px = round(spacing * CAP_HEIGHT_PX)
    pieces: list[Mask] = []
    for character in text:
        mask = (
            np.zeros((CAP_HEIGHT_PX, round(0.3 * CAP_HEIGHT_PX)), np.uint8)
            if character == " "
            else glyph(font, character)
        )
        if cell is not None and character.isalnum():
            mask = _centred(mask, round(cell * CAP_HEIGHT_PX))
        pieces += [mask, np.zeros((CAP_HEIGHT_PX, gap_px), np.uint8)]
    row = np.hstack(pieces[:-1]) if pieces else np.zeros((CAP_HEIGHT_PX, 1), np.uint8)
    if weight_px:
        size = 2 * abs(weight_px) + 1
        kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
        grow = cv2.dilate if weight_px > 0 else cv2.erode
        row = np.asarray(grow(row, kernel), np.uint8)
    return row


def _centred(mask: Mask, width_px: int) -> Mask:
    """`mask` in the middle of `width_px` columns, squeezed if it is wider."""
    if mask.shape[1] > width_px:
        return np.asarray(cv2.resize(mask, (width_px, mask.shape[0])), np.uint8)
    left = (width_px - mask.shape[1]) // 2
    return np.pad(mask, ((0, 0), (left, width_px - mask.shape[1] - left)))
