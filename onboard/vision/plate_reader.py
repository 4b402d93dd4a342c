"""Reading of the characters of a plate whose corners are known.

The plate is rectified, and a small convolutional network gives the probability of each character,
or of none, for each of 40 columns. The text is the most likely sequence without repeats and blanks
(connectionist temporal classification, Graves et al. 2006). The network was trained on rendered
plates only (`training/`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from onboard.observations import PlateCandidate
from onboard.vision.beam_search import BEAM, likeliest_sequences, sequence_probabilities
from onboard.vision.look_alikes import folded, spellings
from onboard.vision.network import Network
from onboard.vision.plate_views import PlateViews
from onboard.vision.syntax import ALL_VALID, PlateSyntax

Image = npt.NDArray[np.uint8]
"""(h, w, 3) BGR or (h, w) grey."""
Corners = npt.NDArray[np.float32]
"""(4, 2): top left, top right, bottom right, bottom left of the plate, in pixels from the outer
corner of the top left one."""
Plates = Sequence[tuple[Corners, PlateViews | None]]
"""Plates of one image, each with its views of earlier frames, if any."""

ALPHABET = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ"
"""Class 0 of the network is the blank, class n the n-th character of this."""
READER_SIZE = (160, 64)
"""Width and height of the network's input."""
MARGIN = (0.06, 0.10)
"""Margin around the plate on each side, as a share of that size, since corners are inexact."""
_PLATE_COLUMNS = (1.0 - 2.0 * MARGIN[0]) * READER_SIZE[0]
"""Columns of a view that show the plate."""
CERTAIN = 0.9
"""Confidence from which a text is certain."""
DEFAULT_MODEL = Path(__file__).parent / "models" / "plate_reader.onnx"
_VIEW_CHANGES = ((0.0, 0.0, 0.0), (0.06, 0.08, 0.04), (-0.02, 0.03, -0.04))
"""Three views of a plate, with changed corners (wider, higher, lean): what only one of them shows
is no evidence."""
_PATTERN_ODDS = 20.0
"""Prior odds of a plate that matches a pattern to one that does not."""
CANDIDATES = 30
"""Texts of one reading. Of photographs, more than 16 add some to the track's posterior."""
_MIN_SPELT = 0.05
"""Probability, as a share of the likeliest text's, from which a text's spellings are told apart."""
_TINY = np.finfo(np.float64).tiny
_LIGHT_SIGMA_PX, _LIGHT_CELL_PX = 24.0, 8
"""Sigma of the Gaussian over which the light around a position is measured, in a view, and the side
of the cells that are averaged before."""
_MIN_DEVIATION = 0.3
"""Least standard deviation around a position, as a share of the whole view's, to divide by."""
_MIN_CONTRAST = 1.0
"""Standard deviation in grey levels below which there is nothing to read."""


@dataclass(frozen=True, slots=True)
class PlateText:
    """A reading of a plate."""

    text: str
    """Empty if no character is recognised."""
    confidence: float
    """Probability that the whole text is right, 0 to 1."""
    identity_confidence: float
    """The same, with 0 and O, and 1 and I, counted as equal: many plate fonts draw them alike."""
    candidates: tuple[PlateCandidate, ...] = ()
    """The likeliest texts by this reading, `text` first; 0 and O, 1 and I are equal in these."""
    views: PlateViews | None = None
    """What was read: the mean of the views so far; `None` without contrast."""


class PlateReader:
    """The reader's network, loaded once; not to be shared between threads."""

    def __init__(self, model: Path = DEFAULT_MODEL, syntax: PlateSyntax = ALL_VALID) -> None:
        """Load the network.

        Args:
            model: ONNX file.
            syntax: patterns of valid plates; without any, all texts are as likely.

        Raises:
            FileNotFoundError: `model` is missing.
        """
        self._network = Network(model)
        self._syntax = syntax

    def read(self, image: Image, corners: Corners) -> PlateText:
        """Read the plate at `corners`; the text is empty where they are outside the image."""
        return self.read_many(image, [(corners, None)])[0]

    def read_many(self, image: Image, plates: Plates) -> list[PlateText]:
        """Read several plates of one image."""
        return [
            self._read(rectified_views(image, corners), seen, _plate_px(corners))
            for corners, seen in plates
        ]

    def _read(
        self, views: npt.NDArray[np.uint8], seen: PlateViews | None, plate_px: float
    ) -> PlateText:
        if views[0].std() < _MIN_CONTRAST:
            return PlateText("", 0.0, 0.0)
        shown = normalised(views)
        mean = PlateViews(shown) if seen is None else seen.with_views(shown)
        scores = self._network.run_one(mean.sharpened(_PLATE_COLUMNS / plate_px))
        return replace(decode(scores[:, :, 0].transpose(0, 2, 1), self._syntax), views=mean)


def _plate_px(corners: Corners) -> float:
    """Length of the plate's upper edge."""
    return max(float(np.hypot(*(corners[1] - corners[0]))), 1.0)


def rectified_views(image: Image, corners: Corners) -> npt.NDArray[np.uint8]:
    """Views of a plate for the network (views, 64, 160), each with slightly other corners."""
    return np.stack([rectify(image, _changed(corners, *nudge)) for nudge in _VIEW_CHANGES])


def _changed(corners: Corners, wider: float, higher: float, lean: float) -> Corners:
    """The corners of a plate wider, higher, and leaning by a share of its height."""
    along, down = corners[1] - corners[0], corners[3] - corners[0]
    outward = np.asarray([(-1, -1), (1, -1), (1, 1), (-1, 1)], np.float32) / 2
    shift = outward[:, :1] * wider * along + outward[:, 1:] * higher * down
    shift += outward[:, :1] * lean * down
    return np.asarray(corners + shift, np.float32)


def rectify(image: Image, corners: Corners) -> npt.NDArray[np.uint8]:
    """Rectify a plate and its margin to a grey view of `READER_SIZE`."""
    width, height = READER_SIZE
    margin_x, margin_y = MARGIN[0] * width, MARGIN[1] * height
    left, right = margin_x, width - margin_x
    top, bottom = margin_y, height - margin_y
    target = np.asarray([(left, top), (right, top), (right, bottom), (left, bottom)], np.float32)
    if cv2.contourArea(corners.astype(np.float32)) < 1.0:
        return np.zeros((height, width), np.uint8)
    # Cuts out the region first, and reduces it if the plate is much larger than the view.
    middle = corners.mean(axis=0)
    around = middle + (corners - middle) * 1.6
    x0, y0 = (int(v) for v in np.maximum(np.floor(around.min(axis=0)), 0))
    x1, y1 = (int(v) for v in np.maximum(np.ceil(around.max(axis=0)) + 1, 0))
    part = image[y0:y1, x0:x1]
    if part.shape[0] < 2 or part.shape[1] < 2:
        return np.zeros((height, width), np.uint8)
    grey = part if part.ndim == 2 else cv2.cvtColor(part, cv2.COLOR_BGR2GRAY)
    source = (corners - np.asarray([x0, y0])).astype(np.float32)
    shrink = (right - left) / _plate_px(corners)
    if shrink < 0.7:
        size = (max(2, round(grey.shape[1] * shrink)), max(2, round(grey.shape[0] * shrink)))
        scale = np.asarray([size[0] / grey.shape[1], size[1] / grey.shape[0]], np.float32)
        grey = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
        source *= scale
    half = np.float32(0.5)  # OpenCV warps between the middles of pixels
    matrix = cv2.getPerspectiveTransform(source - half, target - half)
    view = cv2.warpPerspective(
        grey, matrix, READER_SIZE, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(view, np.uint8)


def normalised(views: npt.NDArray[np.uint8]) -> npt.NDArray[np.float32]:
    """Normalise (n, h, w) views to the network's input (n, 1, h, w).

    Each view gets mean 0 and deviation 1, and then each position of it the mean and deviation of
    its surroundings: a plate in shade or half in the sun then views like one in even light (local
    contrast normalisation; Jarrett et al. 2009, What is the best multi-stage architecture for
    object recognition?). Where there is almost no contrast, noise is not enlarged.
    """
    values = views.astype(np.float32)
    values -= values.mean(axis=(1, 2), keepdims=True)
    values /= values.std(axis=(1, 2), keepdims=True) + np.float32(4.0)
    return np.stack([_evenly_lit(view) for view in values])[:, None]


def _evenly_lit(view: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    mean, square = _around(view), _around(view * view)
    deviation = np.sqrt(np.maximum(square - mean * mean, 0.0))
    return np.asarray((view - mean) / np.maximum(deviation, _MIN_DEVIATION), np.float32)


def _around(values: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Mean around each position of (h, w) values, within about a third of a plate's height."""
    rows, columns = values.shape
    coarse = cv2.resize(
        values, (columns // _LIGHT_CELL_PX, rows // _LIGHT_CELL_PX), interpolation=cv2.INTER_AREA
    )
    soft = cv2.GaussianBlur(
        coarse, (0, 0), _LIGHT_SIGMA_PX / _LIGHT_CELL_PX, borderType=cv2.BORDER_REFLECT
    )
    return np.asarray(cv2.resize(soft, (columns, rows), interpolation=cv2.INTER_LINEAR), np.float32)


def decode(scores: npt.NDArray[np.float32], syntax: PlateSyntax = ALL_VALID) -> PlateText:
    """Decode (views, 40 columns, 37 classes) of logits of one plate to its likeliest texts.

    A text's probability is that of all paths that spell it, in the mean of the views, with the
    prior odds `_PATTERN_ODDS` if it matches the `syntax` (Bayes). The texts that are not found
    match as often as those that are.
    """
    likely = np.exp(scores - scores.max(axis=2, keepdims=True), dtype=np.float64)
    likely /= likely.sum(axis=2, keepdims=True)
    found = likeliest_sequences(_alike_merged(likely), BEAM if syntax else CANDIDATES)
    spelt_from = 0.0 if syntax else _MIN_SPELT * found[0][1]
    texts = [
        spellings(word) if probability >= spelt_from else [word]
        for word, probability in ((_word(labels), probability) for labels, probability in found)
    ]
    alike = [word for words in texts if len(words) > 1 for word in words]
    exact = iter(sequence_probabilities([_labels(word) for word in alike], likely))
    weights = []
    for words, (_, probability) in zip(texts, found, strict=True):
        shares = np.array([next(exact) for _ in words] if len(words) > 1 else [1.0])
        odds = [_PATTERN_ODDS if syntax.fits(word) else 1.0 for word in words]
        weights.append(probability * shares / max(shares.sum(), _TINY) * odds)
    total = sum(probability for _, probability in found)
    evidence = float(np.concatenate(weights).sum()) / max(total, _TINY)
    candidates = [
        PlateCandidate(words[int(weight.argmax())], float(weight.sum()) / evidence)
        for words, weight in zip(texts, weights, strict=True)
    ]
    best = max(range(len(candidates)), key=lambda at: candidates[at].probability)
    return PlateText(
        candidates[best].text,
        float(weights[best].max()) / evidence,
        candidates[best].probability,
        tuple(sorted(candidates, key=lambda candidate: -candidate.probability)[:CANDIDATES]),
    )


def _word(labels: tuple[int, ...]) -> str:
    return "".join(ALPHABET[label - 1] for label in labels)


def _labels(word: str) -> tuple[int, ...]:
    return tuple(ALPHABET.index(character) + 1 for character in word)


def _alike_merged(likely: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """The same probabilities, with those of O and I added to those of 0 and 1."""
    merged = likely.copy()
    for label, character in enumerate(ALPHABET, start=1):
        if (digit := folded(character)) != character:
            merged[..., ALPHABET.index(digit) + 1] += merged[..., label]
            merged[..., label] = 0.0
    return merged
