"""A plate looks as its format says, on every machine alike."""

from dataclasses import replace

import numpy as np
import pytest

from sim_rig.rendering.glyphs import CAP_HEIGHT_PX, font_names, glyph, text_row
from sim_rig.rendering.plate_art import (
    BR,
    EU,
    FORMATS,
    US,
    Outline,
    PlateFormat,
    draw_plate,
    split_groups,
)
from sim_rig.rendering.plate_parts import VALIDATION_FONTS
from sim_rig.rendering.plate_styles import random_plate
from sim_rig.rendering.plate_texts import BR_PATTERNS, EU_PATTERNS, US_PATTERNS, any_text, text_of
from sim_rig.rendering.stamped_glyphs import DIES
from sim_rig.rendering.wear import worn

ALPHABET = "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"


@pytest.mark.parametrize("font", font_names())
def test_every_font_has_every_character_of_a_plate(font: str) -> None:
    masks = {character: glyph(font, character) for character in ALPHABET}
    for character, mask in masks.items():
        assert mask.shape[0] == CAP_HEIGHT_PX
        assert mask.max() == 255, f"{font} draws nothing for {character}"
    if font in DIES:  # which stamp one ring for both, and some one bar
        del masks["O"]
    if font in DIES and not DIES[font].feet and not DIES[font].flag:
        del masks["I"]
    assert len({mask.tobytes() for mask in masks.values()}) == len(masks)


def test_a_font_that_is_not_shipped_is_an_error_that_names_those_that_are() -> None:
    with pytest.raises(ValueError, match=r"no font 'comic'; there are .*barlow"):
        glyph("comic", "A")


@pytest.mark.parametrize("font", font_names())
def test_the_tail_of_a_q_is_not_cut_off(font: str) -> None:
    q, o = (glyph(font, character) for character in "QO")
    width = min(q.shape[1], o.shape[1])
    differ = np.abs(q[:, :width].astype(int) - o[:, :width]) > 128
    assert differ[CAP_HEIGHT_PX // 2 :].sum() > 0.01 * differ.size


def test_cells_give_every_text_of_a_length_the_same_width() -> None:
    widths = {text_row(text, "osp-din", cell=0.6).shape[1] for text in ("IIII", "WWWW", "A1B2")}
    assert len(widths) == 1


def test_weight_adds_and_takes_ink() -> None:
    thin, plain, bold = (
        int(text_row("E8", "osp-din", weight_px=weight).sum(dtype=np.int64))
        for weight in (-2, 0, 2)
    )
    assert thin < plain < bold


@pytest.mark.parametrize("plate_format", FORMATS.values(), ids=FORMATS)
@pytest.mark.parametrize("px_per_mm", [0.05, 0.5, 1.7])
def test_a_plate_has_its_formats_shape(plate_format: PlateFormat, px_per_mm: float) -> None:
    plate = draw_plate("ABC1234", plate_format, px_per_mm)
    height, width, channels = plate.shape
    assert channels == 3
    assert width == max(1, round(plate_format.width_mm * px_per_mm))
    assert height == max(1, round(plate_format.height_mm * px_per_mm))


def test_the_default_plate_of_the_rig_is_as_large_as_europes() -> None:
    assert (EU.width_m, EU.height_m) == (0.520, 0.110)


def test_another_text_is_another_picture_and_the_same_text_the_same() -> None:
    assert np.array_equal(draw_plate("ABC1234", EU), draw_plate("ABC1234", EU))
    assert not np.array_equal(draw_plate("ABC1234", EU), draw_plate("ABC1235", EU))


def test_the_number_stays_inside_its_row() -> None:
    """However long the text, ink beside the row's box is only the border's."""
    bare = replace(US, small_texts=(), discs=(), border_mm=0, font="overpass-600")
    row = bare.rows[0]
    ink = (draw_plate("WWWWWWWW", bare) != np.asarray(bare.ground_bgr)).any(axis=2)
    columns, rows = np.flatnonzero(ink.any(axis=0)), np.flatnonzero(ink.any(axis=1))
    assert columns[0] >= row.x_mm - row.w_mm / 2 - 1
    assert columns[-1] <= row.x_mm + row.w_mm / 2 + 1
    assert rows[0] >= row.y_mm - row.h_mm / 2 - 1
    assert rows[-1] <= row.y_mm + row.h_mm / 2 + 1


def test_stamped_characters_are_lit_from_above() -> None:
    flat = replace(
        US, ink_bgr=(128, 128, 128), ground_bgr=(128, 128, 128), small_texts=(), discs=()
    )
    stamped = draw_plate("EEEEEEE", replace(flat, emboss=100.0)).astype(int) - 128
    letters = slice(50, 115), slice(30, 280)
    assert not draw_plate("EEEEEEE", flat)[letters].std()
    # Above the upper bar it is brighter, below the lower one darker.
    rows = stamped[..., 0].mean(axis=1)
    assert rows.argmax() < rows.argmin()
    assert rows.max() > 10
    assert rows.min() < -10


def test_a_mark_may_have_a_shape_of_its_own() -> None:
    diamond = ((0.0, -0.3), (0.1, 0.0), (0.0, 0.3), (-0.1, 0.0))
    row = replace(US.rows[0], separator="|", mark=(Outline(diamond, (0, 0, 255)),))
    plate = draw_plate("ABC123", replace(US, rows=(row,)))
    red = (plate == (0, 0, 255)).all(axis=2)
    assert red.sum() == pytest.approx(0.5 * 0.6 * 0.2 * row.h_mm**2, rel=0.15)


def test_a_text_in_two_rows_is_all_there() -> None:
    row = BR.rows[0]
    halves = (replace(row, y_mm=45, h_mm=40, groups=(3,)), replace(row, y_mm=100, h_mm=40))
    motorcycle = replace(BR, rows=halves)
    upper_changed = draw_plate("ABC1234", motorcycle) != draw_plate("XBC1234", motorcycle)
    lower_changed = draw_plate("ABC1234", motorcycle) != draw_plate("ABC1239", motorcycle)
    assert np.flatnonzero(upper_changed.any(axis=(1, 2))).max() < 70
    assert np.flatnonzero(lower_changed.any(axis=(1, 2))).min() > 70


@pytest.mark.parametrize(
    ("text", "sizes", "groups"),
    [
        ("ABC1234", (3,), ["ABC", "1234"]),
        ("RK123AB", (2, 3), ["RK", "123", "AB"]),
        ("AB", (3,), ["AB"]),
        ("ABCD", (), ["ABCD"]),
        ("", (3,), []),
    ],
)
def test_texts_are_cut_into_groups(text: str, sizes: tuple[int, ...], groups: list[str]) -> None:
    assert split_groups(text, sizes) == groups


@pytest.mark.parametrize("pattern", sorted({*US_PATTERNS, *EU_PATTERNS, *BR_PATTERNS}))
def test_a_text_follows_its_pattern(pattern: str) -> None:
    text = text_of(pattern, np.random.default_rng(3))
    signs = "".join("L" if c.isalpha() else "#" if c.isdigit() else c for c in text)
    assert signs == pattern
    assert 5 <= len(pattern.replace(" ", "")) <= 8


def test_random_plates_can_be_read_by_the_readers_alphabet_and_drawn() -> None:
    rng = np.random.default_rng(4)
    for _ in range(200):
        text, plate_format = random_plate(rng)
        assert 1 <= len(text) <= 8
        assert set(text) <= set(ALPHABET)
        draw_plate(text, plate_format, 0.3)
    assert 3 <= len(any_text(rng).replace(" ", "")) <= 8


def test_validation_fonts_are_only_used_on_request() -> None:
    rng = np.random.default_rng(5)
    assert set(VALIDATION_FONTS) <= set(font_names())
    for _ in range(100):
        assert random_plate(rng)[1].font not in VALIDATION_FONTS
        assert random_plate(rng, validation_font=True)[1].font in VALIDATION_FONTS


def test_wear_changes_a_plate_and_keeps_its_shape() -> None:
    new = draw_plate("ABC1234", EU)
    worn_ones = [worn(new, np.random.default_rng(seed)) for seed in range(40)]
    assert {plate.shape for plate in worn_ones} == {new.shape}
    assert {plate.dtype for plate in worn_ones} == {new.dtype}
    changed = sum(not np.array_equal(plate, new) for plate in worn_ones)
    assert 10 <= changed <= 25
    assert np.array_equal(worn(new, np.random.default_rng(3)), worn_ones[3])


def test_the_same_seed_gives_the_same_plates() -> None:
    one, other = (random_plate(np.random.default_rng(9)) for _ in range(2))
    assert one == other
