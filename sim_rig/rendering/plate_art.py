"""The texture of a plate, viewed perpendicularly in even light.

A `PlateFormat` is one country's (or one imagined) design in millimetres; `draw_plate` paints a text
on it. Perspective, light and lens are added by other modules.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from sim_rig.rendering.glyphs import Mask, text_row

Art = npt.NDArray[np.uint8]
"""(h, w, 3), BGR."""
Bgr = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Patch:
    """A coloured rectangle: a country band, a sticker, a frame's bar."""

    x_mm: float
    y_mm: float
    w_mm: float
    h_mm: float
    bgr: Bgr


@dataclass(frozen=True, slots=True)
class SmallText:
    """Print that is not part of the number: a state, a dealer, a date."""

    text: str
    x_mm: float
    """Centre."""
    y_mm: float
    """Centre."""
    h_mm: float
    w_mm: float
    """Largest width."""
    font: str
    bgr: Bgr


@dataclass(frozen=True, slots=True)
class Disc:
    """A bolt, a seal, a spot of a printed picture."""

    x_mm: float
    y_mm: float
    r_mm: float
    bgr: Bgr


@dataclass(frozen=True, slots=True)
class Outline:
    """A filled shape: a mountain, a tree, a state on the map."""

    points_mm: tuple[tuple[float, float], ...]
    bgr: Bgr


@dataclass(frozen=True, slots=True)
class NumberRow:
    """Position and format of one row of the number."""

    x_mm: float
    """Centre."""
    y_mm: float
    """Centre."""
    h_mm: float
    """Height of a character."""
    w_mm: float
    """Largest width of the row; a longer text is squeezed."""
    groups: tuple[int, ...]
    """Characters a group; what is left over belongs to the last."""
    separator: str = " "
    """Between groups: a character of the font, `|` for a coloured mark, `:` for two seals, `.` for
    a dot in the ink's colour at half height."""
    mark_bgr: Bgr = (60, 60, 200)
    mark: tuple["Outline", ...] = ()
    """Shapes of the coloured mark, if given, in row heights from its middle."""
    stretch: float = 1.0
    """Width of a character over the font's own."""


@dataclass(frozen=True, slots=True)
class PlateFormat:
    """One design of plate."""

    name: str
    width_mm: float
    height_mm: float
    font: str
    rows: tuple[NumberRow, ...]
    ground_bgr: Bgr = (235, 238, 240)
    ground_bottom_bgr: Bgr | None = None
    """Colour at the bottom of a ground that fades from top to bottom."""
    ink_bgr: Bgr = (25, 22, 20)
    spacing: float = 0.12
    cell: float | None = None
    weight_px: int = 0
    emboss: float = 0.0
    """Difference of the edges of stamped characters, in grey levels brighter and darker."""
    border_mm: float = 0.0
    corner_mm: float = 8.0
    patches: tuple[Patch, ...] = ()
    small_texts: tuple[SmallText, ...] = ()
    discs_below: tuple[Disc, ...] = ()
    """Drawn under the number, as printed pictures."""
    outlines: tuple[Outline, ...] = ()
    """Drawn under the number."""
    discs: tuple[Disc, ...] = ()
    """Drawn over the number, as bolts."""
    frame: tuple[Patch, ...] = ()
    """Parts of a plate holder, drawn over everything except its own text."""
    frame_texts: tuple[SmallText, ...] = ()

    @property
    def width_m(self) -> float:
        """Outer width."""
        return self.width_mm / 1000

    @property
    def height_m(self) -> float:
        """Outer height."""
        return self.height_mm / 1000


_DRAWN_SEPARATORS = ("|", ":", ".")
_DIN = "osp-din"
EU = PlateFormat(
    name="eu",
    width_mm=520,
    height_mm=110,
    font="barlow-semi-condensed-500",
    rows=(NumberRow(x_mm=283, y_mm=55, h_mm=75, w_mm=440, groups=(3,), stretch=1.05),),
    border_mm=4,
    patches=(Patch(0, 0, 45, 110, (150, 60, 10)),),
    small_texts=(SmallText("EU", 22, 85, 20, 32, _DIN, (240, 240, 240)),),
)
US = PlateFormat(
    name="us",
    width_mm=305,
    height_mm=152,
    font="dies-round",
    rows=(NumberRow(x_mm=152, y_mm=82, h_mm=68, w_mm=275, groups=(3,)),),
    ink_bgr=(90, 40, 30),
    small_texts=(SmallText("LIBERTY", 152, 22, 20, 140, "overpass-600", (60, 40, 190)),),
    discs=tuple(Disc(x, y, 4, (120, 120, 120)) for x in (62, 243) for y in (14, 138)),
)
BR = PlateFormat(
    name="br",
    width_mm=400,
    height_mm=130,
    font="roadgeek-2014-c",
    rows=(NumberRow(200, 80, 63, 360, groups=(3,), separator=".", stretch=1.3),),
    ground_bgr=(190, 192, 190),
    weight_px=2,
    border_mm=3,
    small_texts=(SmallText("BR CIDADE", 200, 27, 16, 190, "overpass-600", (30, 30, 30)),),
)
FORMATS = {plate_format.name: plate_format for plate_format in (EU, US, BR)}


def draw_plate(text: str, plate_format: PlateFormat, px_per_mm: float = 1.0) -> Art:
    """Draw a plate.

    Args:
        text: A-Z and 0-9, without separators.
        plate_format: size, font, colours and parts of the plate.
        px_per_mm: resolution.

    Raises:
        ValueError: the format's font is not shipped.
    """
    width_px = max(1, round(plate_format.width_mm * px_per_mm))
    height_px = max(1, round(plate_format.height_mm * px_per_mm))
    plate = np.empty((height_px, width_px, 3), np.uint8)
    top = np.asarray(plate_format.ground_bgr, np.float32)
    bottom = np.asarray(plate_format.ground_bottom_bgr or plate_format.ground_bgr, np.float32)
    share = np.linspace(0, 1, height_px, dtype=np.float32)[:, None]
    plate[:] = (top * (1 - share) + bottom * share + 0.5)[:, None, :].astype(np.uint8)
    if plate_format.border_mm:
        line_px = max(1, round(plate_format.border_mm * px_per_mm))
        corner = (width_px - line_px // 2 - 1, height_px - line_px // 2 - 1)
        cv2.rectangle(plate, (line_px // 2,) * 2, corner, plate_format.ink_bgr, line_px)
    _paint_patches(plate, plate_format.patches, px_per_mm)
    _paint_discs(plate, plate_format.discs_below, px_per_mm)
    for outline in plate_format.outlines:
        _fill(plate, np.asarray(outline.points_mm) * px_per_mm, outline.bgr)
    _paint_small_texts(plate, plate_format.small_texts, px_per_mm)
    rest = text
    for row in plate_format.rows:
        is_last = row is plate_format.rows[-1]
        written = rest if is_last else rest[: sum(row.groups)]
        rest = rest[len(written) :]
        _paint_number(plate, written, row, plate_format, px_per_mm)
    _paint_discs(plate, plate_format.discs, px_per_mm)
    _paint_patches(plate, plate_format.frame, px_per_mm)
    _paint_small_texts(plate, plate_format.frame_texts, px_per_mm)
    return plate


def split_groups(text: str, sizes: tuple[int, ...]) -> list[str]:
    """`text` cut into groups of `sizes`, and one more with what is left over.

    >>> split_groups("ABC1234", (3,))
    ['ABC', '1234']
    """
    groups = []
    for size in sizes:
        groups.append(text[:size])
        text = text[size:]
    return [group for group in [*groups, text] if group]


def _paint_patches(plate: Art, patches: tuple[Patch, ...], px_per_mm: float) -> None:
    for patch in patches:
        top_left = (round(patch.x_mm * px_per_mm), round(patch.y_mm * px_per_mm))
        bottom_right = (
            round((patch.x_mm + patch.w_mm) * px_per_mm) - 1,
            round((patch.y_mm + patch.h_mm) * px_per_mm) - 1,
        )
        cv2.rectangle(plate, top_left, bottom_right, patch.bgr, cv2.FILLED)


def _paint_discs(plate: Art, discs: tuple[Disc, ...], px_per_mm: float) -> None:
    for disc in discs:
        centre = (round(disc.x_mm * px_per_mm), round(disc.y_mm * px_per_mm))
        cv2.circle(plate, centre, round(disc.r_mm * px_per_mm), disc.bgr, cv2.FILLED, cv2.LINE_AA)


def _paint_small_texts(plate: Art, texts: tuple[SmallText, ...], px_per_mm: float) -> None:
    for small in texts:
        centre = (small.x_mm * px_per_mm, small.y_mm * px_per_mm)
        size = (small.w_mm * px_per_mm, small.h_mm * px_per_mm)
        _paint(plate, text_row(small.text, small.font), centre, size, small.bgr)


def _paint_number(
    plate: Art, text: str, row: NumberRow, plate_format: PlateFormat, px_per_mm: float
) -> None:
    groups = split_groups(text, row.groups)
    drawn = row.separator in _DRAWN_SEPARATORS
    separator = "  " if drawn else row.separator
    mask = text_row(
        separator.join(groups),
        plate_format.font,
        spacing=plate_format.spacing,
        cell=plate_format.cell,
        weight_px=plate_format.weight_px,
    )
    height_px = row.h_mm * px_per_mm
    stretched_px = mask.shape[1] / mask.shape[0] * height_px * row.stretch
    width_px = min(stretched_px, row.w_mm * px_per_mm)
    centre = (row.x_mm * px_per_mm, row.y_mm * px_per_mm)
    if plate_format.emboss:
        _emboss(plate, mask, centre, (width_px, height_px), plate_format.emboss)
    left, _ = _paint(
        plate, mask, centre, (width_px, height_px), plate_format.ink_bgr, keep_aspect=False
    )
    for column in _gaps(mask, len(groups) - 1) if drawn else ():
        x_px, y_px = round(left + column / mask.shape[1] * width_px), round(centre[1])
        _paint_separator(plate, row, (x_px, y_px), height_px, plate_format.ink_bgr)


def _paint_separator(
    plate: Art, row: NumberRow, at_px: tuple[int, int], height_px: float, ink_bgr: Bgr
) -> None:
    (x_px, y_px), unit = at_px, max(1, round(0.07 * height_px))
    if row.separator == ".":
        cv2.circle(plate, at_px, unit, ink_bgr, cv2.FILLED, cv2.LINE_AA)
    elif row.separator == "|" and row.mark:
        for outline in row.mark:
            _fill(plate, np.asarray(outline.points_mm) * height_px + at_px, outline.bgr)
    elif row.separator == "|":
        top_left, bottom_right = (x_px - unit, y_px - 3 * unit), (x_px + unit, y_px + 3 * unit)
        cv2.rectangle(plate, top_left, bottom_right, row.mark_bgr, cv2.FILLED)
    else:
        for middle in ((x_px, y_px - 3 * unit), (x_px, y_px + 3 * unit)):
            cv2.circle(plate, middle, 2 * unit, row.mark_bgr, cv2.FILLED, cv2.LINE_AA)


def _fill(plate: Art, points_px: npt.NDArray[np.float64], bgr: Bgr) -> None:
    shape = [np.rint(points_px * 16).astype(np.int32)]
    cv2.fillPoly(plate, shape, bgr, cv2.LINE_AA, 4)


def _emboss(
    plate: Art,
    mask: Mask,
    centre_px: tuple[float, float],
    size_px: tuple[float, float],
    strength: float,
) -> None:
    """Light from above on raised characters: their upper edges brighter, their lower darker."""
    away = max(0.5, 0.025 * size_px[1])
    x, y = centre_px
    for shift, level in ((-away, 255), (away, 0)):
        base = plate.copy()
        _paint(base, mask, (x + shift, y + shift), size_px, (level,) * 3, keep_aspect=False)
        plate[:] = cv2.addWeighted(plate, 1 - strength / 255, base, strength / 255, 0)


def _gaps(mask: Mask, count: int) -> list[float]:
    """Middles of the `count` widest runs of empty columns, in columns."""
    inked = np.flatnonzero(mask.any(axis=0))
    widths = np.diff(inked)
    widest = np.argsort(widths)[::-1][:count]
    return [float(inked[index] + widths[index] / 2) for index in widest]


def _paint(
    plate: Art,
    mask: Mask,
    centre_px: tuple[float, float],
    size_px: tuple[float, float],
    bgr: Bgr,
    *,
    keep_aspect: bool = True,
) -> tuple[int, int]:
    """Blend `bgr` onto `plate` under `mask`, scaled to `size_px` (w, h); gives its top left."""
    height_px = max(1, round(size_px[1]))
    wanted = mask.shape[1] / mask.shape[0] * height_px if keep_aspect else size_px[0]
    width_px = max(1, round(min(wanted, size_px[0])))
    scaled = cv2.resize(mask, (width_px, height_px), interpolation=cv2.INTER_AREA)
    x_px = round(centre_px[0] - width_px / 2)
    y_px = round(centre_px[1] - height_px / 2)
    left, top = max(0, x_px), max(0, y_px)
    region = plate[top : max(top, y_px + height_px), left : max(left, x_px + width_px)]
    share = scaled[top - y_px :, left - x_px :][: region.shape[0], : region.shape[1], None] / 255.0
    region[:] = (region * (1 - share) + np.asarray(bgr) * share + 0.5).astype(np.uint8)
    return x_px, y_px
