"""Graphics beside a plate's number and between its groups: crests, seals, pictures.

Random shapes, as `Outline`s around a position. A reader that has not seen them takes a coat of arms
for an M and a cactus for a 4.
"""

import itertools

import numpy as np
import numpy.typing as npt

from sim_rig.rendering.plate_art import Bgr, Outline

_Points = npt.NDArray[np.float64]
_SHIELD = (
    (-0.5, -0.5),
    (0.5, -0.5),
    (0.5, 0.1),
    (0.33, 0.33),
    (0, 0.5),
    (-0.33, 0.33),
    (-0.5, 0.1),
)


def emblem(
    rng: np.random.Generator, at: tuple[float, float], size: tuple[float, float], ink: Bgr
) -> tuple[Outline, ...]:
    """Draw a crest, a blob or a pictogram.

    Args:
        rng: source of all random numbers.
        at: centre (x, y), mm.
        size: about (width, height), mm.
        ink: colour of its lines.
    """
    draw = (_crest, _blob, _pictogram)[rng.choice(3, p=[0.4, 0.25, 0.35])]
    return draw(rng, np.asarray(at), np.asarray(size), ink)


def crest(
    rng: np.random.Generator, at: tuple[float, float], size: tuple[float, float], ink: Bgr
) -> tuple[Outline, ...]:
    """Draw a coat of arms: a shield, its border, and some charges on it.

    Args:
        rng: source of all random numbers.
        at: centre (x, y), mm.
        size: about (width, height), mm.
        ink: colour of its lines.
    """
    return _crest(rng, np.asarray(at), np.asarray(size), ink)


def mark(rng: np.random.Generator, ink: Bgr) -> tuple[Outline, ...]:
    """Draw a separator of groups, in row heights around (0, 0): a shape, or seals at a hyphen."""
    if rng.random() < 0.5:
        height = rng.uniform(0.3, 1.0)
        return emblem(rng, (0.0, 0.0), (min(height * rng.uniform(0.6, 0.9), 0.6), height), ink)
    hyphen = _bar(np.zeros(2), np.asarray([rng.uniform(0.15, 0.3), rng.uniform(0.07, 0.14)]))
    radius, ground, seals = rng.uniform(0.08, 0.22), colour(rng), list[Outline]()
    rim = rng.uniform(1.15, 1.4) if rng.random() < 0.4 else 0.0  # then two of them look like an 8
    kind = rng.integers(3)  # a seal over the hyphen, one below it too, or two and no hyphen
    for up in (-1, 1)[: 1 if kind == 0 else 2]:
        middle = np.asarray([0.0, up * (radius + rng.uniform(0.04, 0.16))])
        if rim:
            seals.append(Outline(_points(_round(middle, rim * radius)), ink))
        seals.append(Outline(_points(_round(middle, radius)), ground))
        if rng.random() < 0.7:
            seals += _charges(rng, middle, np.asarray([1.2 * radius, 1.2 * radius]))
    return (*seals, *([Outline(_points(hyphen), ink)] if kind != 2 else []))


def landscape(rng: np.random.Generator, ground: Bgr) -> tuple[Outline, ...]:
    """Mountains or a skyline behind the number of a plate of 305 by 152 mm."""
    count = int(rng.integers(4, 14))
    x_mm = np.linspace(0, 305, count)
    y_mm = rng.uniform(60, 150) - rng.uniform(0, 45) * rng.random(count)
    ridge = tuple((float(a), float(d)) for a, d in zip(x_mm, y_mm, strict=True))
    return (Outline((*ridge, (305.0, 152.0), (0.0, 152.0)), near(ground, rng, 70)),)


def colour(rng: np.random.Generator) -> Bgr:
    """Draw a colour."""
    blue, green, red = (int(channel) for channel in rng.integers(10, 245, 3))
    return blue, green, red


def near(bgr: Bgr, rng: np.random.Generator, spread: int) -> Bgr:
    """Draw a colour similar to `bgr`.

    Args:
        bgr: the colour.
        rng: source of all random numbers.
        spread: largest difference of a channel.
    """
    moved = np.clip(np.asarray(bgr) + rng.integers(-spread, spread + 1, 3), 0, 255)
    blue, green, red = (int(channel) for channel in moved)
    return blue, green, red


def _crest(rng: np.random.Generator, at: _Points, size: _Points, ink: Bgr) -> tuple[Outline, ...]:
    shape = np.asarray(_SHIELD) if rng.random() < 0.7 else _round(np.zeros(2), 0.5)
    edge = ink if rng.random() < 0.6 else colour(rng)
    inner = Outline(_points(at + 0.84 * size * shape), colour(rng))
    return (Outline(_points(at + size * shape), edge), inner, *_charges(rng, at, 0.7 * size))


def _charges(rng: np.random.Generator, at: _Points, size: _Points) -> list[Outline]:
    """A few bars and discs inside, upright, level or anywhere."""
    shade, charges = colour(rng), []
    for _ in range(rng.integers(1, 5)):
        middle = at + size * rng.uniform(-0.35, 0.35, 2)
        shape = (
            _round(middle, float(size.min()) * rng.uniform(0.1, 0.25))
            if rng.random() < 0.3
            else _bar(middle, size * rng.permutation([rng.uniform(0.3, 0.9), 0.16]))
        )
        charges.append(Outline(_points(shape), shade))
    return charges


def _pictogram(
    rng: np.random.Generator, at: _Points, size: _Points, ink: Bgr
) -> tuple[Outline, ...]:
    """Strokes as thick as a character's that are none: a plant, a chair on wheels, an animal."""
    shade = ink if rng.random() < 0.5 else colour(rng)
    thick, strokes = float(size.min()) * rng.uniform(0.08, 0.2), list[Outline]()
    place = rng.uniform(-0.5, 0.5, 2)
    for _ in range(rng.integers(2, 7)):
        other = np.clip(place + rng.normal(0, 0.45, 2), -0.5, 0.5)
        strokes.append(
            Outline(_points(_stroke(at + size * place, at + size * other, thick)), shade)
        )
        place = other if rng.random() < 0.6 else rng.uniform(-0.5, 0.5, 2)
    if rng.random() < 0.4:
        middle, radius = at + size * rng.uniform(-0.2, 0.2, 2), float(size.min()) * 0.3
        angles = np.linspace(0, 2 * np.pi, 13)
        rim = [middle + radius * np.asarray([np.cos(a), np.sin(a)]) for a in angles]
        strokes += [
            Outline(_points(_stroke(one, two, thick)), shade)
            for one, two in itertools.pairwise(rim)
        ]
    return tuple(strokes)


def _blob(rng: np.random.Generator, at: _Points, size: _Points, _: Bgr) -> tuple[Outline, ...]:
    """A state, a saint: corners at random around a middle."""
    angles = np.sort(rng.uniform(0, 2 * np.pi, int(rng.integers(4, 12))))
    reach = rng.uniform(0.3, 1.0, len(angles))[:, None] * size / 2
    corners = at + reach * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return (Outline(_points(corners), colour(rng)),)


def _round(middle: _Points, radius: float) -> _Points:
    angles = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    return middle + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _bar(middle: _Points, size: _Points) -> _Points:
    corners = np.asarray([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    return np.asarray(middle + size / 2 * corners, np.float64)


def _stroke(start: _Points, end: _Points, thick: float) -> _Points:
    along = (end - start) / max(1e-9, float(np.hypot(*(end - start))))
    aside = np.asarray([-along[1], along[0]]) * thick / 2
    return np.asarray([start - aside, end - aside, end + aside, start + aside])


def _points(corners: _Points) -> tuple[tuple[float, float], ...]:
    return tuple((float(x), float(y)) for x, y in corners)
