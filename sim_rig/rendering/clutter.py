"""Everything around cars that is not a plate: walls, leaves, asphalt, fences, signs.

Drawn roughly and at random, so that a detector learns what a plate is not.
"""

import cv2
import numpy as np
import numpy.typing as npt

from sim_rig.rendering.glyphs import font_names, text_row
from sim_rig.rendering.plate_texts import any_text, word

Image = npt.NDArray[np.uint8]
"""(h, w, 3), BGR."""
Bgr = tuple[int, int, int]


def surroundings(rows: int, columns: int, rng: np.random.Generator) -> Image:
    """Draw a background without cars.

    Args:
        rows: height in pixels.
        columns: width in pixels.
        rng: source of all random numbers.
    """
    image = _texture(rows, columns, rng)
    if rng.random() < 0.6:  # ground below, something else above
        horizon = int(rng.uniform(0.1, 0.9) * rows)
        image[horizon:] = _texture(rows - horizon, columns, rng)
    things = (box, _fence, _bricks, strokes, _sign, _windows, disc, _leaves)
    for _ in range(rng.integers(2, 9)):
        things[rng.integers(len(things))](image, rng)
    return image


def colour(rng: np.random.Generator) -> Bgr:
    """Draw a colour, mostly a grey."""
    grey = rng.integers(5, 245)
    spread = 12 if rng.random() < 0.6 else 90
    blue, green, red = (int(v) for v in np.clip(grey + rng.normal(0, spread, 3), 0, 255))
    return blue, green, red


def add_lettering(image: Image, rng: np.random.Generator, height_px: float) -> None:
    """Draw text on a panel: a negative example that resembles a plate.

    Args:
        image: drawn onto.
        rng: source of all random numbers.
        height_px: height of the letters.
    """
    letters(image, rng, height_px)


def blend(image: Image, patch: Image, alpha: Image, left: int, top: int) -> None:
    """Copy `patch` into `image` where `alpha` is not 0; parts outside are cut off.

    Args:
        image: drawn onto.
        patch: (h, w, 3), BGR.
        alpha: (h, w).
        left: column of `image` at which the patch begins; may be negative.
        top: row at which it begins; may be negative.
    """
    rows, columns = image.shape[:2]
    x0, y0 = max(0, left), max(0, top)
    x1, y1 = min(columns, left + patch.shape[1]), min(rows, top + patch.shape[0])
    if x0 >= x1 or y0 >= y1:
        return
    inner = (slice(y0 - top, y1 - top), slice(x0 - left, x1 - left))
    cv2.copyTo(
        np.ascontiguousarray(patch[inner]), np.ascontiguousarray(alpha[inner]), image[y0:y1, x0:x1]
    )


def _texture(rows: int, columns: int, rng: np.random.Generator) -> Image:
    """Noise of several sizes around one colour."""
    total = np.zeros((rows, columns, 3), np.float32)
    channels = 3 if rng.random() < 0.3 else 1
    roughness = rng.uniform(0.3, 1.1)
    strength = rng.choice([8.0, 25.0, 60.0])
    for octave in range(6):
        size = 2**octave
        shape = (max(2, rows // size), max(2, columns // size), channels)
        grain = rng.standard_normal(shape, np.float32)
        grown = cv2.resize(grain, (columns, rows), interpolation=cv2.INTER_LINEAR)
        total += np.asarray(grown).reshape(rows, columns, channels) * np.float32(
            strength * roughness ** (5 - octave)
        )
    return np.asarray(np.clip(total * 0.6 + np.asarray(colour(rng)), 0, 255), np.uint8)


def place(
    image: Image, rng: np.random.Generator, largest: float = 0.7
) -> tuple[int, int, int, int]:
    """Draw a random rectangle (x0, y0, x1, y1), at least 3 pixels each way.

    Args:
        image: the image whose size bounds it.
        rng: source of all random numbers.
        largest: largest share of the image's width and height.
    """
    rows, columns = image.shape[:2]
    width = max(3, int(columns * rng.uniform(0.03, largest)))
    height = max(3, int(rows * rng.uniform(0.03, largest)))
    x0, y0 = int(rng.integers(-width // 2, columns)), int(rng.integers(-height // 2, rows))
    return x0, y0, x0 + width, y0 + height


def box(image: Image, rng: np.random.Generator) -> None:
    """A leaning rectangle."""
    x0, y0, x1, y1 = place(image, rng)
    lean = rng.normal(0, 0.12, (4, 2)) * (x1 - x0)
    corners = np.asarray([(x0, y0), (x1, y0), (x1, y1), (x0, y1)]) + lean
    cv2.fillConvexPoly(image, np.rint(corners).astype(np.int32), colour(rng), cv2.LINE_AA)


def disc(image: Image, rng: np.random.Generator) -> None:
    """An ellipse or its outline."""
    x0, y0, x1, y1 = place(image, rng, 0.4)
    centre, axes = ((x0 + x1) // 2, (y0 + y1) // 2), ((x1 - x0) // 2, (y1 - y0) // 2)
    thickness = -1 if rng.random() < 0.6 else int(rng.integers(1, 6))
    cv2.ellipse(image, centre, axes, 0, 0, 360, colour(rng), thickness, cv2.LINE_AA)


def strokes(image: Image, rng: np.random.Generator) -> None:
    """A few lines, half of them nearly level."""
    for _ in range(rng.integers(1, 6)):
        x0, y0, x1, y1 = place(image, rng)
        start, end = ((x0, y0), (x1, y1)) if rng.random() < 0.5 else ((x0, y0), (x1, y0 + 3))
        cv2.line(image, start, end, colour(rng), int(rng.integers(1, 5)), cv2.LINE_AA)


def _fence(image: Image, rng: np.random.Generator) -> None:
    """Uprights in a row, near enough to look like strokes of letters."""
    x0, y0, x1, y1 = place(image, rng)
    step, paint, thickness = int(rng.integers(3, 14)), colour(rng), int(rng.integers(1, 5))
    for x in range(x0, x1, step):
        cv2.line(image, (x, y0), (x, y1), paint, thickness)


def _bricks(image: Image, rng: np.random.Generator) -> None:
    x0, y0, x1, y1 = place(image, rng, 1.0)
    height = int(rng.integers(3, 12))
    width = int(height * rng.uniform(1.5, 3.5))
    joint = colour(rng)
    for row, y in enumerate(range(y0, y1, height)):
        cv2.line(image, (x0, y), (x1, y), joint, 1)
        for x in range(x0 + (row % 2) * width // 2, x1, width):
            cv2.line(image, (x, y), (x, min(y1, y + height)), joint, 1)


def _windows(image: Image, rng: np.random.Generator) -> None:
    x0, y0, x1, y1 = place(image, rng, 0.9)
    step_x, step_y = rng.integers(8, 40, 2)
    pane = colour(rng)
    for y in range(y0, y1, int(step_y)):
        for x in range(x0, x1, int(step_x)):
            corner = (x + int(0.7 * step_x), y + int(0.6 * step_y))
            cv2.rectangle(image, (x, y), corner, pane, cv2.FILLED)


def _leaves(image: Image, rng: np.random.Generator) -> None:
    x0, y0, x1, y1 = place(image, rng)
    dark = rng.integers(10, 120, 3)
    for _ in range(rng.integers(20, 90)):
        centre = (int(rng.integers(x0, x1)), int(rng.integers(y0, y1)))
        axes = (int(rng.integers(1, 9)), int(rng.integers(1, 6)))
        paint = np.clip(dark * rng.uniform(0.5, 1.8), 0, 255).tolist()
        cv2.ellipse(image, centre, axes, rng.uniform(0, 180), 0, 360, paint, -1)


def _sign(image: Image, rng: np.random.Generator) -> None:
    letters(image, rng, image.shape[0] * rng.uniform(0.04, 0.2))


def write(image: Image, row: Image, paint: Bgr, left: int, top: int) -> None:
    """Draw a row of letters without soft edges.

    Args:
        image: drawn onto.
        row: mask of the letters, (h, w), 0 to 255.
        paint: colour of the letters.
        left: column of `image` at which the row begins.
        top: row of `image` at which it begins.
    """
    patch = np.full((*row.shape, 3), paint, np.uint8)
    blend(image, patch, np.asarray(row > 110, np.uint8), left, top)


def letters(
    image: Image, rng: np.random.Generator, height_px: float, *, panel: bool = True
) -> None:
    """Draw a word without the borders and the shape of a plate.

    Args:
        image: drawn onto.
        rng: source of all random numbers.
        height_px: height of the letters.
        panel: whether it stands on a panel, then mostly of several rows.
    """
    fonts = font_names()
    height = max(4, round(height_px))
    paint = colour(rng)
    left = int(rng.integers(-20, image.shape[1]))
    top = int(rng.integers(-10, image.shape[0]))
    lines = int(rng.integers(2, 4)) if panel and rng.random() < 0.7 else 1
    longest = 16 if lines > 1 or not panel else 24
    rows: list[Image] = []
    for _ in range(lines):
        text = word(rng, longest) if rng.random() < 0.8 else any_text(rng)
        mask = text_row(text, fonts[rng.integers(len(fonts))], weight_px=int(rng.integers(-1, 5)))
        width = max(3, round(mask.shape[1] / mask.shape[0] * height * rng.uniform(0.7, 1.6)))
        rows.append(
            np.asarray(cv2.resize(mask, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
        )
    if panel:
        reach = round(0.5 * height)
        corner = (
            left + max(row.shape[1] for row in rows) + reach,
            top + round(1.5 * height * lines) + reach,
        )
        cv2.rectangle(image, (left - reach, top - reach), corner, colour(rng), cv2.FILLED)
    for line, row in enumerate(rows):
        write(image, row, paint, left, top + round(1.5 * height * line))
