"""What lies between the road and the picture: bonnet, pillars, reflections, dirt, burnt-in text."""

import cv2
import numpy as np
import numpy.typing as npt

from sim_rig.rendering.street.canvas import Image, Points
from sim_rig.rendering.street.lettering import word_mask
from sim_rig.rendering.street.paint import body_colour
from sim_rig.rendering.street.textures import tile


def look_through(
    image: Image, brightness: float, bottom: float, rng: np.random.Generator
) -> npt.NDArray[np.bool_]:
    """Draw the own vehicle's parts and the windscreen over a picture, in place.

    Args:
        image: (h, w, 3) BGR.
        brightness: of what is lit by day, 0 to 1.
        bottom: share of the height down to which the road may be visible.
        rng: source of all random numbers.

    Returns:
        hidden: (h, w), whether a part of the own vehicle hides the road.
    """
    rows, columns = image.shape[:2]
    hidden = np.zeros((rows, columns), np.uint8)
    if rng.random() < 0.45:
        _reflection(image, brightness, rng)
    if rng.random() < 0.25:
        _dirt(image, brightness, rng)
    if bottom < 1.0:
        _bonnet(image, hidden, bottom, brightness, rng)
    for _ in range(int(rng.choice([0, 1, 2], p=[0.75, 0.2, 0.05]))):
        _pillar(image, hidden, brightness, rng)
    return hidden > 0


def _reflection(image: Image, brightness: float, rng: np.random.Generator) -> None:
    """The dashboard mirrored in the windscreen: soft, bright shapes with some edges."""
    rows, columns = image.shape[:2]
    layer = np.zeros((rows, columns), np.float32)
    for _ in range(int(rng.integers(1, 6))):
        middle = np.asarray([rng.uniform(0, columns), rng.uniform(0.2, 1.1) * rows])
        reach = np.asarray([rng.uniform(0.05, 0.5) * columns, rng.uniform(0.03, 0.4) * rows])
        count = int(rng.integers(3, 9))
        turn = np.sort(rng.uniform(0, 2 * np.pi, count))
        outline = middle + reach * np.column_stack([np.cos(turn), np.sin(turn)])
        cv2.fillPoly(layer, [np.rint(outline).astype(np.int32)], float(rng.uniform(0.2, 1.0)))
    soft = cv2.GaussianBlur(layer, (0, 0), float(np.exp(rng.uniform(np.log(0.6), np.log(12)))))
    if rng.random() < 0.5:
        soft = soft * np.clip(tile((rows, columns), 0.4, rng), 0, 2)
    veil = float(rng.uniform(10, 90)) * brightness
    share = np.asarray(soft, np.float32)[..., None]
    image[:] = np.clip(image * (1 - 0.3 * share) + veil * share, 0, 255).astype(np.uint8)


def _dirt(image: Image, brightness: float, rng: np.random.Generator) -> None:
    """Spots and drops on the windscreen, out of focus."""
    rows, columns = image.shape[:2]
    layer = np.zeros((rows, columns), np.float32)
    for _ in range(int(rng.integers(2, 30))):
        at = int(rng.integers(0, columns)), int(rng.integers(0, rows))
        radius = max(1, round(float(np.exp(rng.uniform(0.0, 2.6)))))
        cv2.circle(layer, at, radius, float(rng.uniform(0.1, 0.7)), cv2.FILLED)
    soft = np.asarray(cv2.GaussianBlur(layer, (0, 0), float(rng.uniform(1, 4))))[..., None]
    tone = float(rng.uniform(0, 220)) * brightness
    image[:] = (image * (1 - soft) + tone * soft).astype(np.uint8)


def _fill(image: Image, hidden: Image, outline: Points, bgr: tuple[float, float, float]) -> None:
    corners = np.rint(outline * 16).astype(np.int32)
    cv2.fillPoly(image, [corners], bgr, cv2.LINE_AA, 4)
    cv2.fillPoly(hidden, [corners], (1,), cv2.LINE_8, 4)


def _bonnet(
    image: Image, hidden: Image, bottom: float, brightness: float, rng: np.random.Generator
) -> None:
    """The bonnet or the dashboard along the lower edge, with shapes on it."""
    rows, columns = image.shape[:2]
    tone = np.asarray(body_colour(rng)) * brightness
    x = np.linspace(-0.1, 1.1, 15)
    bow = float(rng.normal(0, 0.12)) * (x - rng.uniform(0.3, 0.7)) ** 2 * 2
    wave = 0.01 * rng.normal(0, 1, len(x)) * (rng.random() < 0.5)
    top = rows * (bottom + np.abs(bow) + wave)
    ends = np.asarray([(1.2 * columns, 1.2 * rows), (-0.2 * columns, 1.2 * rows)])
    for down, factor in ((0.0, 1.0), (0.02, 0.7), (0.08, float(rng.uniform(0.3, 1.2)))):
        outline = np.vstack([np.column_stack([x * columns, top + down * rows]), ends])
        shade = np.clip(factor * tone, 0, 255)
        _fill(image, hidden, outline, (float(shade[0]), float(shade[1]), float(shade[2])))
    for _ in range(int(rng.integers(0, 16))):
        _thing_on_dashboard(image, hidden, bottom, brightness, rng)


def _thing_on_dashboard(
    image: Image, hidden: Image, bottom: float, brightness: float, rng: np.random.Generator
) -> None:
    """A box, a vent, a holder or a mirrored sheet, at times with an edge or a shining spot."""
    rows, columns = image.shape[:2]
    middle = rng.uniform((0.0, bottom), (1.0, 1.1)) * (columns, rows)
    half = np.exp(rng.uniform(np.log((0.01, 0.008)), np.log((0.2, 0.12)))) * (columns, rows)
    corners = np.asarray([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    outline = middle + corners * half * (1 + rng.normal(0, 0.15, (4, 2)))
    tone = np.asarray(body_colour(rng)) * brightness * rng.uniform(0.05, 0.8)
    _fill(image, hidden, outline, (float(tone[0]), float(tone[1]), float(tone[2])))
    edge = np.rint(outline).astype(np.int32)
    light = float(rng.uniform(20, 200)) * brightness
    if rng.random() < 0.3:
        cv2.polylines(image, [edge], rng.random() < 0.5, (light, light, light), 1, cv2.LINE_AA)
    if rng.random() < 0.2:
        spot = int(middle[0]), int(middle[1])
        cv2.circle(image, spot, max(1, round(0.1 * half[1])), (light, light, light), cv2.FILLED)


def _pillar(image: Image, hidden: Image, brightness: float, rng: np.random.Generator) -> None:
    """A pillar, an arm, a mirror or a holder at a side or the top."""
    rows, columns = image.shape[:2]
    tone = float(rng.uniform(5, 90)) * brightness
    x, width = float(rng.choice([0.0, 1.0])) * columns, float(rng.uniform(0.03, 0.25)) * columns
    lean = float(rng.normal(0, 0.3)) * columns
    outline = np.asarray([(x - width, 0), (x + width, 0), (x + width + lean, rows)])
    kind = int(rng.integers(3))
    if kind == 1:  # hanging from the top
        middle = float(rng.uniform(0, 1)) * columns
        depth = float(rng.uniform(0.05, 0.25)) * rows
        outline = np.asarray(
            [(middle - width, 0), (middle + width, 0), (middle + 0.8 * width, depth)]
        )
    elif kind == 2:  # reaching in from the side
        reach = np.asarray([float(rng.uniform(0.05, 0.3)) * columns, 0.0])
        inwards = reach if x == 0 else -reach
        upper, lower = rng.uniform((0.3, 0.5), (0.6, 0.9)) * rows
        tip = np.asarray([x, (upper + lower) / 2 + rng.normal(0, 0.1) * rows]) + inwards
        below = tip + np.asarray([0.0, 0.05 * rows])
        outline = np.vstack([(x, upper), tip, below, (x, lower)])
    _fill(image, hidden, outline, (tone, tone, tone))


def burn_in(image: Image, rng: np.random.Generator) -> None:
    """Write date, speed or a maker's name on a picture, in place."""
    rows, columns = image.shape[:2]
    bgr = ((255.0, 255.0, 255.0), (60.0, 200.0, 250.0), (40.0, 150.0, 250.0), (20.0, 20.0, 20.0))[
        int(rng.integers(4))
    ]
    size = float(rng.uniform(0.02, 0.09)) * rows
    for _ in range(int(rng.integers(1, 4))):
        left = float(rng.uniform(0.0, 0.7)) * columns
        top = float(rng.choice([rng.uniform(0, 0.06), rng.uniform(0.84, 0.97)])) * rows
        if rng.random() < 0.5:  # date and time in one of OpenCV's fonts
            digits = "".join(str(number) for number in rng.integers(0, 10, 14))
            stamp = f"{digits[:4]}/{digits[4:6]}/{digits[6:8]} {digits[8:10]}:{digits[10:12]}"
            at = round(left), round(top + size)
            font, scale = int(rng.integers(0, 5)), size / 22
            if rng.random() < 0.4:
                thick = max(2, round(size / 5))
                cv2.putText(image, stamp, at, font, scale, (0, 0, 0), thick, cv2.LINE_AA)
            cv2.putText(image, stamp, at, font, scale, bgr, 1, cv2.LINE_AA)
            continue
        for _ in range(int(rng.integers(1, 4))):
            mask = word_mask(rng)
            width = max(2, round(size * mask.shape[1] / mask.shape[0]))
            x, y = round(left), round(top)
            part = image[y : y + round(size), x : x + width]
            if part.size:
                share = cv2.resize(mask, part.shape[1::-1], interpolation=cv2.INTER_AREA)
                alpha = np.asarray(share, np.float32)[..., None] / 255
                part[:] = (part * (1 - alpha) + alpha * np.asarray(bgr)).astype(np.uint8)
            left += width + size / 2
