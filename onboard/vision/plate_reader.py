"""Reads the characters of a plate whose corners are known.

The plate is cut out square to the eye (`rectify`), and a small convolutional network gives, for
each of 40 columns, how likely it shows each character or none. The text is the most likely sequence
with repeats and blanks taken out (connectionist temporal classification, Graves et al. 2006). The
network was trained on rendered plates only (`training/`); OpenCV runs it on one core.
"""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

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

    def __init__(self, model: Path = DEFAULT_MODEL) -> None:
        """Load the network.

        Raises:
            FileNotFoundError: there is no file `model`.
        """
        if not model.is_file():
            raise FileNotFoundError(f"no plate reader model at {model}")
        self._network = cv2.dnn.readNetFromONNX(str(model))

    def read(self, image: Image, corners: Corners) -> PlateText:
        """The characters on the plate at `corners`; empty where they lie outside the picture."""
        return self.read_many(image, [corners])[0]

    def read_many(self, image: Image, plates: list[Corners]) -> list[PlateText]:
        """As `read`, for several plates of one picture."""
        texts = []
        for corners in plates:
            views = np.stack([rectify(image, _nudged(corners, *nudge)) for nudge in _LOOKS])
            if views[0].std() < _LEAST_CONTRAST:
                texts.append(PlateText("", 0.0, (), 0.0))
                continue
            self._network.setInput(normalised(views))
            scores = np.asarray(self._network.forward(), np.float32)
            texts.append(decode(scores[:, :, 0].transpose(0, 2, 1)))
        return texts


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
    """(n, h, w) views as the network's input (n, 1, h, w): mean 0 and deviation 1 in each."""
    values = views.astype(np.float32)
    values -= values.mean(axis=(1, 2), keepdims=True)
    values /= values.std(axis=(1, 2), keepdims=True) + np.float32(4.0)
    return values[:, None]


def decode(scores: npt.NDArray[np.float32]) -> PlateText:
    """The text that (looks, 40 columns, 37 classes) of logits, all of one plate, agree on.

    Each look proposes the text of its best path; a text's confidence is its whole probability, over
    all paths that spell it, in the mean of the looks. A character's confidence is the highest
    probability in the run of columns that show it, in the look that proposed the text.
    """
    likely = np.exp(scores - scores.max(axis=2, keepdims=True))
    likely /= likely.sum(axis=2, keepdims=True)
    merged = _alike_merged(likely)
    texts: dict[str, PlateText] = {}
    for look in likely:
        labels, confidences = _best_path(look)
        text = "".join(ALPHABET[label - 1] for label in labels)
        if text in texts:
            continue
        whole = _probability(labels, likely)
        alike = [_MERGED.get(label, label) for label in labels]
        but_for_alike = _probability(alike, merged) if alike != labels else whole
        texts[text] = PlateText(text, whole, tuple(confidences), but_for_alike)
    return max(texts.values(), key=lambda text: text.confidence)


_MERGED = {ALPHABET.index(one) + 1: ALPHABET.index(other) + 1 for one, other in ("O0", "I1")}
"""Classes of characters that are drawn alike."""


def _alike_merged(likely: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """The same probabilities, those of O and I added to those of 0 and 1."""
    merged = likely.copy()
    for one, other in _MERGED.items():
        merged[..., other] += merged[..., one]
        merged[..., one] = 0.0
    return merged


def _best_path(likely: npt.NDArray[np.float32]) -> tuple[list[int], list[float]]:
    """The most likely class of each column, repeats and blanks taken out, and how likely."""
    path, best = likely.argmax(axis=1), likely.max(axis=1)
    labels: list[int] = []
    confidences: list[float] = []
    for column, label in enumerate(path):
        if label == 0:
            continue
        if column and path[column - 1] == label:
            confidences[-1] = max(confidences[-1], float(best[column]))
        else:
            labels.append(int(label))
            confidences.append(float(best[column]))
    return labels, confidences


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
