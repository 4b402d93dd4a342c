"""Characters in the style of stamped North American plates, drawn as strokes of even width.

No font with a free licence has these shapes: narrow, round-ended, the one and often the I standing
on a foot. Each character is a few lines in a box of 1 by 1, y pointing down.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

Mask = npt.NDArray[np.uint8]
Point = tuple[float, float]
Line = list[Point]


@dataclass(frozen=True, slots=True)
class StampStyle:
    """Style of one set of stamped glyphs."""

    width: float
    """Width of a character, as a share of the cap height."""
    corner: tuple[float, float]
    """Radii of round corners in x and y, as shares of the box: (0.5, ...) is a half ellipse."""
    feet: bool
    """Whether 1 and I stand on a foot."""
    upright: bool
    """Whether the sides of W are upright, as those of M are."""
    valley: float
    """How deep the middle of M reaches, and how high that of W."""
    slanted: bool = False
    """Whether the stems of 6 and 9 lean instead of curving back."""
    stroke: float = 0.12
    """Width of a stroke, as a share of the cap height."""
    bar: float = 0.48
    """How far down the middle bars of A, E, F and H are, and the waists of B, P and R."""
    flat_three: bool = False
    """Whether 3 has a flat top."""
    curved_seven: bool = True
    """Whether the stem of 7 bends."""
    serifs: bool = False
    """Whether J has a bar on top."""
    closed_four: bool = True
    """Whether the slope of 4 reaches the top of its stem."""
    flag: float = 0.22
    """How far down the flag of 1 reaches; 0: it is a bare upright."""
    four: tuple[float, float] = (0.72, 0.7)
    """Position of the stem of 4 from the left, and of its bar from the top."""
    top_of_four: tuple[float, float] = (0.45, 0.3)
    """Start of the slope of an open 4 from the left, and of its stem from the top."""
    blunt: float = 0.0
    """Width of the foot of V and of the head of A, as a share of the character's."""
    boxed_eight: bool = False
    """Whether 8 has corners as 0 has them, which makes it look like a B."""
    slope_of_s: float = 0.1
    """How far the middle of S falls to either side of the waist."""


_NAMED = {
    "dies-round": StampStyle(0.44, (0.5, 0.24), feet=True, upright=True, valley=0.55),
    "dies-plain": StampStyle(0.44, (0.5, 0.24), feet=False, upright=False, valley=0.65),
    "dies-square": StampStyle(0.46, (0.34, 0.17), feet=True, upright=False, valley=0.5),
    "dies-narrow": StampStyle(0.38, (0.5, 0.2), feet=False, upright=True, valley=0.8),
    "dies-slanted": StampStyle(
        0.45, (0.5, 0.26), feet=True, upright=False, valley=0.95, slanted=True
    ),
    "dies-wide": StampStyle(0.54, (0.5, 0.32), feet=True, upright=False, valley=0.6),
    "dies-bare": StampStyle(0.5, (0.5, 0.3), feet=False, upright=False, valley=0.95, flag=0.0),
    "dies-bare-wide": StampStyle(
        0.56, (0.45, 0.28), feet=False, upright=False, valley=0.65, flag=0.1, stroke=0.15
    ),
}


_PLAIN = 40
"""The first so many of those drawn at random have the usual 4, 8 and S."""
_POINTED = 80
"""The first so many have pointed A and V, and an open 4 with a long stem."""


def _drawn_at_random(count: int) -> dict[str, StampStyle]:
    """Draw random styles similar to real ones; the same on every machine."""
    rng = np.random.default_rng(1906)  # the year in which a plate was first stamped for a car
    flags = np.random.default_rng(1901).choice([0.0, 0.1, 0.22, 0.3], count, p=[0.3, 0.1, 0.4, 0.2])
    shapes, ends = np.random.default_rng(1903), np.random.default_rng(1907)
    styles = {}
    for number in range(count):
        width = float(rng.uniform(0.36, 0.6))
        varied: dict[str, Any] = {}
        if number >= _PLAIN:
            varied["four"] = (float(shapes.uniform(0.6, 0.85)), float(shapes.uniform(0.6, 0.82)))
            varied["boxed_eight"] = bool(shapes.random() < 0.5)
            varied["slope_of_s"] = float(shapes.uniform(0.0, 0.2))
        if number >= _POINTED:
            varied["top_of_four"] = float(ends.uniform(0.2, 0.6)), float(ends.uniform(0.25, 0.6))
            varied["blunt"] = float(ends.choice([0.0, ends.uniform(0.1, 0.4)]))
        styles[f"dies-{number:02}"] = StampStyle(
            width=width,
            corner=(float(rng.uniform(0.3, 0.5)), float(rng.uniform(0.16, 0.36))),
            feet=bool(rng.random() < 0.5),
            upright=bool(rng.random() < 0.4),
            valley=float(rng.uniform(0.4, 1.0)),
            slanted=bool(rng.random() < 0.3),
            stroke=float(rng.uniform(0.095, 0.165)),
            bar=float(rng.uniform(0.42, 0.58)),
            flat_three=bool(rng.random() < 0.15),
            curved_seven=bool(rng.random() < 0.5),
            serifs=bool(rng.random() < 0.3),
            closed_four=bool(rng.random() < (0.7 if number < _POINTED else 0.3)),
            flag=float(flags[number]),
            **varied,
        )
    return styles


DIES = {**_NAMED, **_drawn_at_random(120)}


def die(name: str, character: str, cap_height_px: int) -> Mask:
    """Return the mask of a character, 255 where there is ink; blank if the font lacks it.

    Args:
        name: key of `DIES`.
        character: the character.
        cap_height_px: height of the mask.
    """
    style = DIES[name]
    share = {"M": 1.2, "W": 1.25 if style.upright else 1.3, "-": 0.6}.get(character, 1.0)
    if character in "1I":
        is_bare = not style.feet and (character == "I" or style.flag == 0)
        share = 0.75 if style.feet else 0.05 if is_bare else 0.35
    stroke_px = max(1, round(style.stroke * cap_height_px))
    width_px = max(stroke_px, round(style.width * share * cap_height_px))
    mask = np.zeros((cap_height_px, width_px + stroke_px), np.uint8)
    inner = np.asarray([width_px - 1, cap_height_px - stroke_px - 1])
    for line in _lines(character, style):
        points = np.asarray(line) * inner + stroke_px / 2
        shape = [np.rint(points * 16).astype(np.int32)]
        cv2.polylines(mask, shape, False, 255, stroke_px, cv2.LINE_AA, 4)
    return mask


def _arc(centre: Point, radii: Point, start_deg: float, end_deg: float) -> Line:
    angles = np.radians(np.linspace(start_deg, end_deg, 16))
    return [
        (centre[0] + radii[0] * float(np.cos(a)), centre[1] + radii[1] * float(np.sin(a)))
        for a in angles
    ]


def _box(least: Point, most: Point, radii: Point) -> Line:
    """A ring with round corners."""
    (left, top), (right, bottom), (rx, ry) = least, most, radii
    ring = [
        *_arc((left + rx, top + ry), radii, 180, 270),
        *_arc((right - rx, top + ry), radii, 270, 360),
        *_arc((right - rx, bottom - ry), radii, 0, 90),
        *_arc((left + rx, bottom - ry), radii, 90, 180),
    ]
    return [*ring, ring[0]]


@dataclass(frozen=True, slots=True)
class _Corners:
    """The round corners of a style, each drawn clockwise."""

    over_left: Line
    over_right: Line
    under_right: Line
    under_left: Line

    @classmethod
    def of(cls, style: StampStyle) -> "_Corners":
        rx, ry = style.corner
        return cls(
            _arc((rx, ry), (rx, ry), 180, 270),
            _arc((1 - rx, ry), (rx, ry), 270, 360),
            _arc((1 - rx, 1 - ry), (rx, ry), 0, 90),
            _arc((rx, 1 - ry), (rx, ry), 90, 180),
        )

    @property
    def ring(self) -> Line:
        """All around."""
        ring = [*self.over_left, *self.over_right, *self.under_right, *self.under_left]
        return [*ring, ring[0]]

    @property
    def over(self) -> Line:
        """Line from the right over the top to the left."""
        return self.over_right[::-1] + self.over_left[::-1]

    @property
    def under(self) -> Line:
        """Line from the left below the bottom to the right."""
        return self.under_left[::-1] + self.under_right[::-1]


def _lines(character: str, style: StampStyle) -> list[Line]:
    """Strokes of a character; empty if the style does not have it."""
    if character == "9":  # a 6 upside down
        return [[(1 - x, 1 - y) for x, y in line] for line in _lines("6", style)]
    corners = _Corners.of(style)
    return (_digits(style, corners) | _letters(style, corners)).get(character, [])


def _digits(style: StampStyle, corners: _Corners) -> dict[str, list[Line]]:
    """All but 9."""
    over_left, over_right = corners.over_left, corners.over_right
    stem = [(0.75, 0), (0.3, 0.3), (0, 0.68)] if style.slanted else [*corners.over, (0, 0.7)]
    low_ring = _arc((0.5, 0.7), (0.5, 0.3), 0, 360)
    return {
        "0": [corners.ring],
        "1": [[*([(0.05, style.flag)] if style.flag else []), (0.5, 0), (0.5, 1)], *_foot(style)],
        "2": [[*over_left, *over_right, (0.93, 0.42), (0.75, 0.55), (0, 1), (1, 1)]],
        "3": _three(style, corners),
        "4": _four(style),
        "5": [[(0.93, 0), (0.1, 0), (0.05, 0.5), *_arc((0.5, 0.69), (0.5, 0.31), 225, 515)]],
        "6": [stem, low_ring],
        "7": [[(0, 0), (1, 0), *([(0.55, 0.45)] if style.curved_seven else []), (0.38, 1)]],
        "8": _eight(style),
    }


def _three(style: StampStyle, corners: _Corners) -> list[Line]:
    rx, _ = style.corner
    top: Line = (
        [(0, 0), (0.95, 0), (0.5, 0.45)]
        if style.flat_three
        else [*corners.over_left, *_arc((1 - rx, 0.25), (rx, 0.25), 270, 430), (0.5, 0.48)]
    )
    bow = _arc((0.55, 0.74), (0.45, 0.26), 280, 360)
    return [top, [top[-1], *bow, *corners.under_right, *corners.under_left]]


def _four(style: StampStyle) -> list[Line]:
    stem_x, bar_y = style.four
    if style.closed_four:
        return [[(stem_x, 1), (stem_x, 0), (0, bar_y), (1, bar_y)]]
    slope_x, stem_y = style.top_of_four
    return [
        [(stem_x, 1), (stem_x, stem_y)],
        [(slope_x, 0), (0, bar_y + 0.02), (1, bar_y + 0.02)],
    ]


def _eight(style: StampStyle) -> list[Line]:
    if style.boxed_eight:
        radii = style.corner[0], 0.7 * style.corner[1]
        return [_box((0.05, 0), (0.95, 0.5), radii), _box((0, 0.5), (1, 1), radii)]
    return [_arc((0.5, 0.25), (0.45, 0.25), 0, 360), _arc((0.5, 0.75), (0.5, 0.25), 0, 360)]


def _foot(style: StampStyle) -> list[Line]:
    return [[(0, 1), (1, 1)]] if style.feet else []


def _letters(style: StampStyle, corners: _Corners) -> dict[str, list[Line]]:
    """And the hyphen."""
    over, under = corners.over, corners.under
    left: Line = [(0, 0), (0, 1)]
    head: list[Line] = [[(0, 0), (1, 0)]] if style.feet else []
    serif: list[Line] = [[(0.4, 0), (1, 0)]] if style.serifs else []
    bar = style.bar
    bar_of_a = 0.35 + 0.7 * bar
    upper, lower = bar / 2, 1 - (1 - bar) / 2
    upper_bow = [(0, 0), (0.6, 0), *_arc((0.6, upper), (0.4, upper), 270, 450), (0, bar)]
    lower_bow = [(0.6, bar), *_arc((0.6, lower), (0.4, 1 - lower), 270, 450), (0, 1)]
    one_end, other_end = (1 - style.blunt) / 2, (1 + style.blunt) / 2
    lean = 0.0 if style.upright else 0.2
    return {
        "A": [
            [(0, 1), (one_end, 0), (other_end, 0), (1, 1)],
            [(0.35 - 0.35 * bar, bar_of_a), (0.65 + 0.35 * bar, bar_of_a)],
        ],
        "B": [left, upper_bow, lower_bow],
        "C": [[(1, 0.3), *over, *under, (1, 0.7)]],
        "D": [[(0, 0), (0, 1), *corners.under_right[::-1], *corners.over_right[::-1], (0, 0)]],
        "E": [[(1, 0), (0, 0), (0, 1), (1, 1)], [(0, bar), (0.85, bar)]],
        "F": [[(1, 0), (0, 0), (0, 1)], [(0, bar), (0.85, bar)]],
        "G": [[(1, 0.3), *over, *under], [(1, 1 - style.corner[1]), (1, 0.55), (0.55, 0.55)]],
        "H": [left, [(1, 0), (1, 1)], [(0, bar), (1, bar)]],
        "I": [[(0.5, 0), (0.5, 1)], *_foot(style), *head],
        "J": [[(1, 0), *corners.under_right, *corners.under_left], *serif],
        "K": [left, [(1, 0), (0, 0.6)], [(0.3, 0.42), (1, 1)]],
        "L": [[(0, 0), (0, 1), (1, 1)]],
        "M": [[(0, 1), (0, 0), (0.5, style.valley), (1, 0), (1, 1)]],
        "N": [[(0, 1), (0, 0), (1, 1), (1, 0)]],
        "O": [corners.ring],
        "P": [left, upper_bow],
        "Q": [corners.ring, [(0.55, 0.72), (1, 1)]],
        "R": [left, upper_bow, [(0.5, bar), (1, 1)]],
        "S": [
            [*over, (0.12, 0.5 - style.slope_of_s), (0.88, 0.5 + style.slope_of_s), *under[::-1]]
        ],
        "T": [[(0, 0), (1, 0)], [(0.5, 0), (0.5, 1)]],
        "U": [[(0, 0), *under, (1, 0)]],
        "V": [[(0, 0), (one_end, 1), (other_end, 1), (1, 0)]],
        "W": [[(0, 0), (lean, 1), (0.5, 1 - style.valley), (1 - lean, 1), (1, 0)]],
        "X": [[(0, 0), (1, 1)], [(1, 0), (0, 1)]],
        "Y": [[(0, 0), (0.5, 0.5), (1, 0)], [(0.5, 0.5), (0.5, 1)]],
        "Z": [[(0, 0), (1, 0), (0, 1), (1, 1)]],
        "-": [[(0, 0.5), (1, 0.5)]],
    }
