"""Reads the characters of a plate whose corners are known.

The plate is cut out square to the eye (`rectify`), and a small convolutional network gives, for
each of 40 columns, how likely it shows each character or none. The text is the most likely sequence
with repeats and blanks taken out (connectionist temporal classification, Graves et al. 2006). The
network was trained on rendered plates only (`training/`); OpenCV runs it on one core.
"""

import itertools
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from onboard.vision.syntax import PlateSyntax

Image = npt.NDArray[np.uint8]
"""(h, w, 3) BGR or (h, w) grey."""
Corners = npt.NDArray[np.float32]
"""(4, 2): top left, top right, bottom right, bottom left of the plate, in pixels from the outer
corner of the top left one."""

ALPHABET = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ"
"""Class 0 of the network is the blank, class n the n-th character of this."""
READER_SIZE = (160, 64)
"""(w, h) of what the network sees."""
MARGIN = (0.06, 0.10)
"""Share of that size around the plate, on each side, since corners are never exact."""
CERTAIN = 0.9
"""A text at least this confident may be used as what it says; below, it is unknown."""
DEFAULT_MODEL = Path(__file__).parent / "models" / "plate_reader.onnx"
_LOOKS = ((0.0, 0.0, 0.0), (0.06, 0.08, 0.04), (-0.02, 0.03, -0.04))
"""A plate is looked at three times, its corners nudged (wider, higher, lean): what only one cut of
it seems to show is no evidence."""
_LIKELIER = 20.0
"""By so much a plate that fits the syntax is likelier to be met than one that does not."""
_LEAST_DOUBT, _MOST_DOUBTS = 0.02, 8
"""Probability from which another character is considered in a place; how many are, in a text."""
_REACH_PX, _COARSE = 24.0, 8
"""How far around a place its light is measured, as a Gaussian's sigma in a view; and how many of
its pixels are taken together for that."""
_LEAST_DEVIATION = 0.3
"""Of what lies around a place, as a share of the whole view's: with less it is not enlarged."""
_LEAST_CONTRAST = 1.0
"""Standard deviation in grey levels, below which there is nothing to read."""


@dataclass(frozen=True, slots=True)
class PlateText:
    """What stands on a plate."""

    text: str
    """May be empty: nothing that looks like a character."""
    confidence: float
    """0 to 1: that the whole text is right."""
    character_confidences: tuple[float, ...]
    identity_confidence: float
    """0 to 1: that the text is right but for 0 and O, 1 and I, which many plate fonts draw alike
    and which no identity tells apart."""


class PlateReader:
    """One network, loaded once; not to be shared between threads."""

    def __init__(self, model: Path = DEFAULT_MODEL, syntax: PlateSyntax | None = None) -> None:
        """Load the network.

        Args:
            model: ONNX file.
            syntax: the plates that are likelier than others; `None`: all are as likely.

        Raises:
            FileNotFoundError: there is no file `model`.
        """
        if not model.is_file():
            raise FileNotFoundError(f"no plate reader model at {model}")
        self._network = cv2.dnn.readNetFromONNX(str(model))
        self._syntax = syntax

    def read(self, image: Image, corners: Corners) -> PlateText:
        """The characters on the plate at `corners`; empty where they lie outside the picture."""
        return self.read_many(image, [corners])[0]

    def read_many(self, image: Image, plates: list[Corners]) -> list[PlateText]:
        """As `read`, for several plates of one picture."""
        texts = []
        for corners in plates:
            views = looks_at(image, corners)
            if views[0].std() < _LEAST_CONTRAST:
                texts.append(PlateText("", 0.0, (), 0.0))
                continue
            self._network.setInput(normalised(views))
            scores = np.asarray(self._network.forward(), np.float32)
            texts.append(decode(scores[:, :, 0].transpose(0, 2, 1), self._syntax))
        return texts


def looks_at(image: Image, corners: Corners) -> npt.NDArray[np.uint8]:
    """A plate as the network is shown it: (looks, 64, 160), each cut out a little differently."""
    return np.stack([rectify(image, _nudged(corners, *nudge)) for nudge in _LOOKS])


def _nudged(corners: Corners, wider: float, higher: float, lean: float) -> Corners:
    """The corners of a plate that much wider, higher, and leaning by a share of its height."""
    along, down = corners[1] - corners[0], corners[3] - corners[0]
    outward = np.asarray([(-1, -1), (1, -1), (1, 1), (-1, 1)], np.float32) / 2
    shift = outward[:, :1] * wider * along + outward[:, 1:] * higher * down
    shift += outward[:, :1] * lean * down
    return np.asarray(corners + shift, np.float32)


def rectify(image: Image, corners: Corners) -> npt.NDArray[np.uint8]:
    """The plate and a little around it, grey, `READER_SIZE` large: what the network is shown."""
    width, height = READER_SIZE
    margin_x, margin_y = MARGIN[0] * width, MARGIN[1] * height
    left, right = margin_x, width - margin_x
    top, bottom = margin_y, height - margin_y
    target = np.asarray([(left, top), (right, top), (right, bottom), (left, bottom)], np.float32)
    if cv2.contourArea(corners.astype(np.float32)) < 1.0:
        return np.zeros((height, width), np.uint8)
    # Only what is needed, shrunk first where the plate is much larger than the view.
    middle = corners.mean(axis=0)
    around = middle + (corners - middle) * 1.6
    x0, y0 = (int(v) for v in np.maximum(np.floor(around.min(axis=0)), 0))
    x1, y1 = (int(v) for v in np.maximum(np.ceil(around.max(axis=0)) + 1, 0))
    part = image[y0:y1, x0:x1]
    if part.shape[0] < 2 or part.shape[1] < 2:
        return np.zeros((height, width), np.uint8)
    grey = part if part.ndim == 2 else cv2.cvtColor(part, cv2.COLOR_BGR2GRAY)
    source = (corners - np.asarray([x0, y0])).astype(np.float32)
    plate_px = float(np.hypot(*(corners[1] - corners[0])))
    shrink = (right - left) / max(plate_px, 1.0)
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
    """(n, h, w) views as the network's input (n, 1, h, w).

    Each view is brought to mean 0 and deviation 1, and then each place of it to the mean and the
    deviation of what lies around: a plate in the shade of a bright car, or half in the sun, looks
    like one in even light (local contrast normalisation; Jarrett et al. 2009, What is the best
    multi-stage architecture for object recognition?). Where next to nothing is to be seen, noise is
    not enlarged.
    """
    values = views.astype(np.float32)
    values -= values.mean(axis=(1, 2), keepdims=True)
    values /= values.std(axis=(1, 2), keepdims=True) + np.float32(4.0)
    return np.stack([_evenly_lit(view) for view in values])[:, None]


def _evenly_lit(view: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    mean, square = _around(view), _around(view * view)
    deviation = np.sqrt(np.maximum(square - mean * mean, 0.0))
    return np.asarray((view - mean) / np.maximum(deviation, _LEAST_DEVIATION), np.float32)


def _around(values: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """The mean around each place of (h, w) values, a third of a plate's height or so away."""
    rows, columns = values.shape
    coarse = cv2.resize(values, (columns // _COARSE, rows // _COARSE), interpolation=cv2.INTER_AREA)
    soft = cv2.GaussianBlur(coarse, (0, 0), _REACH_PX / _COARSE, borderType=cv2.BORDER_REFLECT)
    return np.asarray(cv2.resize(soft, (columns, rows), interpolation=cv2.INTER_LINEAR), np.float32)


def decode(scores: npt.NDArray[np.float32], syntax: PlateSyntax | None = None) -> PlateText:
    """The text that (looks, 40 columns, 37 classes) of logits, all of one plate, agree on.

    Each look proposes the text of its best path; a text's confidence is its whole probability, over
    all paths that spell it, in the mean of the looks. A character's confidence is the highest
    probability in the run of columns that show it, in the look that proposed the text. Where there
    is a `syntax`, texts that fit it and differ in up to two likely characters, or lack them, are
    proposed too.
    """
    likely = np.exp(scores - scores.max(axis=2, keepdims=True))
    likely /= likely.sum(axis=2, keepdims=True)
    merged = _alike_merged(likely)
    spellings: dict[tuple[int, ...], list[float]] = {}
    for look in likely:
        labels, columns = _best_path(look)
        spellings.setdefault(tuple(labels), [float(look[c].max()) for c in columns])
        if syntax:
            for other in _respelt(look, labels, columns):
                shown = {c: k for c, k in zip(columns, other, strict=True) if k}
                if syntax.fits(_spelt(list(shown.values()))):
                    confidences = [float(look[c, k]) for c, k in shown.items()]
                    spellings.setdefault(tuple(shown.values()), confidences)
    texts = []
    for spelling, confidences in spellings.items():
        whole = _probability(labels := list(spelling), likely)
        alike = [_MERGED.get(label, label) for label in labels]
        but_for_alike = _probability(alike, merged) if set(alike) & _DRAWN_ALIKE else whole
        texts.append(PlateText(_spelt(labels), whole, tuple(confidences), but_for_alike))
    if syntax:
        texts = _weighed(texts, syntax)
    return max(texts, key=lambda text: text.confidence)


def _weighed(texts: list[PlateText], syntax: PlateSyntax) -> list[PlateText]:
    """Their confidences once it is known that a text that fits is `_LIKELIER` to be met (Bayes).

    What none of them says counts among the texts that fit.
    """
    strange = sum(text.confidence for text in texts if not syntax.fits(text.text))
    evidence = _LIKELIER * max(0.0, 1.0 - strange) + strange
    weighed = []
    for text in texts:
        share = (_LIKELIER if syntax.fits(text.text) else 1.0) / evidence
        confidence = min(1.0, share * text.confidence)
        alike = min(1.0, share * text.identity_confidence)
        weighed.append(replace(text, confidence=confidence, identity_confidence=alike))
    return weighed


def _respelt(
    look: npt.NDArray[np.float32], labels: list[int], columns: list[int]
) -> list[list[int]]:
    """The texts that differ from that of the best path in one or two characters; 0 for none."""
    others = [
        (place, int(label))
        for place, column in enumerate(columns)
        for label in np.flatnonzero(look[column] >= _LEAST_DOUBT)
        if label != labels[place]
    ]
    others = sorted(others, key=lambda other: -look[columns[other[0]], other[1]])[:_MOST_DOUBTS]
    changes = [(one,) for one in others] + list(itertools.combinations(others, 2))
    texts = []
    for change in changes:
        text = list(labels)
        for place, label in change:
            text[place] = label
        texts.append(text)
    return texts


def _spelt(labels: list[int]) -> str:
    return "".join(ALPHABET[label - 1] for label in labels)


_MERGED = {ALPHABET.index(one) + 1: ALPHABET.index(other) + 1 for one, other in ("O0", "I1")}
"""Classes of characters that are drawn alike."""
_DRAWN_ALIKE = frozenset(_MERGED.values())


def _alike_merged(likely: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """The same probabilities, those of O and I added to those of 0 and 1."""
    merged = likely.copy()
    for one, other in _MERGED.items():
        merged[..., other] += merged[..., one]
        merged[..., one] = 0.0
    return merged


def _best_path(likely: npt.NDArray[np.float32]) -> tuple[list[int], list[int]]:
    """The likeliest classes, repeats and blanks taken out, and the column that shows each best."""
    path, best = likely.argmax(axis=1), likely.max(axis=1)
    labels: list[int] = []
    columns: list[int] = []
    for column, label in enumerate(path):
        if label == 0:
            continue
        if not column or path[column - 1] != label:
            labels.append(int(label))
            columns.append(column)
        elif best[column] > best[columns[-1]]:
            columns[-1] = column
    return labels, columns


def _probability(labels: list[int], likely: npt.NDArray[np.float32]) -> float:
    """That the columns of a look spell `labels`, in the mean of the looks.

    The forward recursion of Graves et al. 2006, section 4.1.
    """
    states = np.zeros(2 * len(labels) + 1, np.int64)  # a blank before, between and after
    states[1::2] = labels
    # From two states back: only to a character, and only from another one.
    may_skip = np.zeros(len(states), bool)
    may_skip[3::2] = states[3::2] != states[1:-2:2]
    emitted = likely[:, :, states].astype(np.float64)
    reached = np.zeros((len(likely), len(states)))
    reached[:, :2] = emitted[:, 0, :2]
    for column in range(1, likely.shape[1]):
        arriving = reached.copy()
        arriving[:, 1:] += reached[:, :-1]
        arriving[:, 2:] += reached[:, :-2] * may_skip[2:]
        reached = arriving * emitted[:, column]
    return float(np.minimum(1.0, reached[:, -2:].sum(axis=1)).mean())
