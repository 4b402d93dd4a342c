"""Rendered plates are read; illegible ones have a low confidence."""

from pathlib import Path

import numpy as np
import pytest

from onboard.vision.detection import SearchPlan
from onboard.vision.perspective import Perspective
from onboard.vision.plate_detector import PlateDetector
from onboard.vision.plate_formats import PlateFormats
from onboard.vision.plate_reader import (
    ALPHABET,
    CERTAIN,
    READER_SIZE,
    PlateReader,
    decode,
    normalised,
    rectify,
)
from onboard.vision.plates import PlateRecognizer
from onboard.vision.settings import Calibration
from onboard.vision.syntax import PlateSyntax
from sim_rig.rendering.lens import photograph
from sim_rig.rendering.plate_art import FORMATS, PlateFormat, draw_plate
from sim_rig.rendering.scene import opaque, warp_onto


@pytest.fixture(scope="module")
def reader() -> PlateReader:
    return PlateReader()


def shown(
    text: str, plate_format: PlateFormat, width_px: float, angle_deg: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """An image with the plate in the middle, and the plate's corners."""
    half = np.asarray([1.0, plate_format.height_mm / plate_format.width_mm]) * width_px / 2
    corners = np.asarray([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half
    angle = np.deg2rad(angle_deg)
    turn = np.asarray([(np.cos(angle), np.sin(angle)), (-np.sin(angle), np.cos(angle))])
    size = int(width_px * 1.6)
    quad = (corners @ turn + size / 2).astype(np.float32)
    image = np.full((size, size, 3), 70, np.uint8)
    art = draw_plate(text, plate_format, px_per_mm=min(1.0, 1.5 * width_px / plate_format.width_mm))
    warp_onto(image, opaque(art), quad)
    return image, quad


@pytest.mark.parametrize("plate_format", FORMATS.values(), ids=FORMATS)
@pytest.mark.parametrize("text", ["ABC1234", "KLM7890", "XYZ5566", "RST3847"])
def test_a_clean_plate_is_read_and_certain(
    reader: PlateReader, text: str, plate_format: PlateFormat
) -> None:
    read = reader.read(*shown(text, plate_format, width_px=150))
    assert read.text == text
    assert read.confidence >= CERTAIN
    assert read.candidates[0].text == text


@pytest.mark.parametrize("light", [np.linspace(0.2, 1.0, 160), np.linspace(1.0, 0.3, 64)[:, None]])
def test_normalisation_removes_uneven_light(light: np.ndarray) -> None:
    view = rectify(*shown("ABC1234", FORMATS["us"], width_px=150))
    shaded = (view * light).astype(np.uint8)

    observed, observed_in_shade = normalised(np.stack([view, shaded]))[:, 0]

    assert np.corrcoef(observed.ravel(), observed_in_shade.ravel())[0, 1] > 0.93


def test_normalisation_does_not_enlarge_noise() -> None:
    noise = np.random.default_rng(5).normal(0, 0.6, (1, 64, 160))
    empty = np.rint(128 + noise).astype(np.uint8)
    half = np.where(np.arange(160) < 80, 30.0, 220.0) + noise

    assert normalised(empty).std() < 1.5
    assert normalised(half.astype(np.uint8))[0, 0, :, 120:].std() < 0.3


@pytest.mark.parametrize("width_px", [90, 160, 400, 1500])
@pytest.mark.parametrize("angle_deg", [-10.0, 7.0])
def test_size_and_angle_do_not_matter(
    reader: PlateReader, width_px: float, angle_deg: float
) -> None:
    assert reader.read(*shown("HKV4826", FORMATS["eu"], width_px, angle_deg)).text == "HKV4826"


def test_most_photographs_are_read(reader: PlateReader) -> None:
    rng = np.random.default_rng(8)
    right = 0
    for number in range(40):
        text = f"{''.join('ABCDEFGHJKLMNPRSTUVWXYZ'[i] for i in rng.integers(0, 23, 3))}{number:04}"
        image, corners = shown(text, FORMATS["us"], width_px=120, angle_deg=rng.normal(0, 4))
        right += reader.read(photograph(image, rng, fine_px=2.0), corners).text == text
    assert right >= 32


def test_grey_images_are_read_like_coloured_ones(reader: PlateReader) -> None:
    image, corners = shown("ABC1234", FORMATS["eu"], width_px=150)
    grey = image[..., 0].copy()
    assert reader.read(grey, corners).text == "ABC1234"


def test_several_plates_at_once_read_as_one_by_one(reader: PlateReader) -> None:
    image, corners = shown("ABC1234", FORMATS["eu"], width_px=150)
    shifted = corners + np.float32(2.0)
    together = reader.read_many(image, [(corners, None), (shifted, None)])
    assert [read.text for read in together] == [
        reader.read(image, corners).text,
        reader.read(image, shifted).text,
    ]
    assert reader.read_many(image, []) == []


def test_an_illegible_plate_is_never_certain(reader: PlateReader) -> None:
    """Seven characters on sixteen pixels."""
    certain = 0
    for text in ("ABC1234", "KLM7890", "XYZ5566", "RST3847", "BDO8B80"):
        read = reader.read(*shown(text, FORMATS["eu"], width_px=16))
        certain += read.confidence >= CERTAIN and read.text != text and bool(read.text)
    assert certain == 0


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((1, 1, 3), np.uint8),
        np.zeros((0, 0, 3), np.uint8),
        np.zeros((200, 300, 3), np.uint8),
        np.full((200, 300), 255, np.uint8),
    ],
    ids=["one pixel", "empty", "black", "white and grey"],
)
def test_a_uniform_image_has_an_empty_text(reader: PlateReader, image: np.ndarray) -> None:
    corners = np.asarray([(10, 10), (110, 10), (110, 40), (10, 40)], np.float32)
    read = reader.read(image, corners)
    assert (read.text, read.confidence) == ("", 0.0)


@pytest.mark.parametrize(
    "corners",
    [
        [(5, 5)] * 4,
        [(1000, 1000), (1100, 1000), (1100, 1040), (1000, 1040)],
        [(-300, -300), (-200, -300), (-200, -260), (-300, -260)],
    ],
    ids=["a point", "below the picture", "above the picture"],
)
def test_corners_without_a_plate_have_an_empty_text(
    reader: PlateReader, corners: list[tuple[int, int]]
) -> None:
    image, _ = shown("ABC1234", FORMATS["eu"], width_px=150)
    assert reader.read(image, np.asarray(corners, np.float32)).text == ""


def test_a_plate_cut_by_the_border_raises_nothing(reader: PlateReader) -> None:
    image, corners = shown("ABC1234", FORMATS["eu"], width_px=150)
    reader.read(image[:, : image.shape[1] // 2].copy(), corners)


def test_rectifying_puts_the_plate_in_the_view_at_any_scale() -> None:
    views = [
        rectify(*shown("ABC1234", FORMATS["eu"], width_px)).astype(float) for width_px in (300, 900)
    ]
    assert views[0].shape == READER_SIZE[::-1]
    assert np.abs(views[0] - views[1]).mean() < 12.0


def scores_of(labels: list[int], sure: float = 12.0) -> np.ndarray:
    scores = np.zeros((len(labels), len(ALPHABET) + 1), np.float32)
    scores[np.arange(len(labels)), labels] = sure
    return scores[None]


@pytest.mark.parametrize(
    ("labels", "text"),
    [
        ([0, 0, 0], ""),
        ([11, 11, 0, 12], "AB"),
        ([11, 0, 11], "AA"),
        ([11, 11, 11], "A"),
        ([1, 2, 36], "01Z"),
    ],
)
def test_repeats_and_blanks_are_taken_out(labels: list[int], text: str) -> None:
    read = decode(scores_of(labels))
    assert read.text == text
    assert read.confidence == pytest.approx(1.0, abs=0.01)


def test_confidence_counts_every_path_that_spells_the_text() -> None:
    """PyTorch's rule on a case small enough to list: two columns, A or blank, evenly likely.

    Of the four paths (--, -A, A-, AA) three spell A.
    """
    scores = np.full((1, 2, len(ALPHABET) + 1), -50.0, np.float32)
    scores[..., [0, 11]] = 0.0
    scores[0, 0, 11] = 1e-4
    assert decode(scores).text == "A"
    assert decode(scores).confidence == pytest.approx(0.75, abs=1e-3)


def test_views_that_disagree_lower_the_confidence() -> None:
    views = np.concatenate([scores_of([11, 0, 12]), scores_of([11, 0, 13]), scores_of([11, 0, 12])])
    read = decode(views)
    assert read.text == "AB"
    assert read.confidence == pytest.approx(2 / 3, abs=0.01)


def test_one_uncertain_column_lowers_the_confidence() -> None:
    scores = scores_of([11, 0, 12])
    scores[0, 2, 13] = 12.0
    read = decode(scores)
    assert read.confidence < 0.51
    assert {each.text for each in read.candidates[:2]} == {"AB", "AC"}


def test_a_missing_model_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"no network at .*none\.onnx"):
        PlateReader(tmp_path / "none.onnx")


def view_of(columns: list[dict[str, float]]) -> np.ndarray:
    """One view: likely characters of some columns, a blank after each."""
    view = np.full((2 * len(columns), len(ALPHABET) + 1), -20.0, np.float32)
    view[1::2, 0] = 0.0
    for position, chances in enumerate(columns):
        for character, chance in chances.items():
            view[2 * position, ALPHABET.index(character) + 1] = np.log(chance)
    return view[None]


SERIES = PlateSyntax(("[A-Z]{3}[0-9]{4}",))
DOUBTED = [{c: 1.0} for c in "MYX3"] + [{"I": 0.6, "1": 0.4}, {"5": 1.0}, {"2": 1.0}]


def test_patterns_decide_between_spellings_by_their_probability() -> None:
    assert decode(view_of(DOUBTED)).text == "MYX3I52"
    assert decode(view_of(DOUBTED)).confidence == pytest.approx(0.6, abs=0.01)

    read = decode(view_of(DOUBTED), SERIES)

    assert read.text == "MYX3152"
    assert read.confidence == pytest.approx(20 * 0.4 / (20 * 0.4 + 0.6), abs=0.01)


def test_patterns_drop_a_false_character_beside_the_text() -> None:
    chrome = view_of([{"I": 0.6}, *({c: 1.0} for c in "ABC1234")])
    chrome[0, 0, 0] = np.log(0.4)
    assert decode(chrome).text == "IABC1234"

    read = decode(chrome, SERIES)

    assert read.text == "ABC1234"
    assert read.confidence == pytest.approx(20 * 0.4 / (20 * 0.4 + 0.6), abs=0.01)
    assert {each.text: each.probability for each in read.candidates}["IABC1234"] == pytest.approx(
        1.0 - read.confidence, abs=0.01
    )


def test_a_plate_of_another_country_is_not_forced_to_match() -> None:
    strange = [{c: 1.0} for c in "MYX"] + [{"I": 0.995, "1": 0.005}] + [{c: 1.0} for c in "152"]

    assert decode(view_of(strange), SERIES).text == "MYXI152"
    assert decode(view_of(strange), SERIES).confidence == pytest.approx(0.909, abs=0.01)


def test_a_certain_text_that_matches_stays() -> None:
    plain = view_of([{c: 1.0} for c in "ABC1234"])

    assert decode(plain, SERIES).text == decode(plain).text == "ABC1234"
    assert decode(plain, SERIES).confidence >= decode(plain).confidence > 0.99


def test_both_spellings_drawn_alike_have_the_same_identity_confidence() -> None:
    for zero in (0.7, 0.4):
        columns = [{c: 1.0} for c in "CL22"] + [{"0": zero, "O": 1.0 - zero}, {"S": 1.0}]
        read = decode(view_of(columns))

        assert read.confidence == pytest.approx(max(zero, 1.0 - zero), abs=0.01)
        assert read.identity_confidence == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("text", ["RNE4S39", "ABC1234"])
def test_a_text_that_matches_no_pattern_is_not_reported(text: str) -> None:
    """RNE4539 would be the only similar text that matches, and is another vehicle."""
    image, _ = shown(text, FORMATS["eu"], 160, 0.0)
    reader = PlateReader(syntax=SERIES)
    plates = PlateRecognizer(
        PlateDetector(), reader, SERIES, Perspective(Calibration()), PlateFormats()
    )

    (detection,) = plates.find(image, SearchPlan())

    assert detection.was_read
    assert detection.text == (text if SERIES.fits(text) else None)
