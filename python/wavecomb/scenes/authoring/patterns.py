# SPDX-License-Identifier: Apache-2.0
"""Building blocks of procedural images: tileable noise, ramps and mixtures.

Colour images are float32 arrays (height, width, channels); scalar images are (height, width). Row 0
is the top of the image.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float32]
"""An image: float32 array (height, width, channels)."""


def grid(size: int) -> tuple[Image, Image]:
    """Returns the texel centres x (1, size) and y (size, 1), from 0 to 1; y grows downwards."""
    t = ((np.arange(size) + 0.5) / size).astype(np.float32)
    return t[None, :], t[:, None]


def _cells(t: Image, cells: int) -> tuple[NDArray[np.int64], NDArray[np.int64], Image]:
    """Returns the lattice points before and after each position, and the second point's weight."""
    place = t * cells
    low = np.floor(place)
    f = (place - low).astype(np.float32)
    first = low.astype(np.int64) % cells
    return first, (first + 1) % cells, f * f * (3 - 2 * f)


def value_noise(
    x: Image, y: Image, cells: int, rng: np.random.Generator, rows: int | None = None
) -> Image:
    """Evaluates tileable value noise, from 0 to 1.

    Args:
        x: Horizontal positions, of any shape; the shape (1, w), with y of shape (h, 1), is much
            faster.
        y: Vertical positions.
        cells: Lattice cells per unit.
        rng: Random generator for the lattice values.
        rows: Vertical lattice cells per unit; None uses ``cells``.
    """
    rows = rows or cells
    lattice = rng.random((rows, cells)).astype(np.float32)
    x0, x1, fx = _cells(x, cells)
    y0, y1, fy = _cells(y, rows)
    if x.shape[0] == 1 and y.shape[1] == 1:
        lines = lattice[y0[:, 0]] * (1 - fy) + lattice[y1[:, 0]] * fy
        return np.asarray(lines[:, x0[0]] * (1 - fx) + lines[:, x1[0]] * fx, np.float32)
    top = lattice[y0, x0] * (1 - fx) + lattice[y0, x1] * fx
    bottom = lattice[y1, x0] * (1 - fx) + lattice[y1, x1] * fx
    return np.asarray(top * (1 - fy) + bottom * fy, np.float32)


def fractal(
    x: Image,
    y: Image,
    cells: int,
    octaves: int,
    rng: np.random.Generator,
    gain: float = 0.5,
    rows: int | None = None,
) -> Image:
    """Sums octaves of tileable ``value_noise`` to values from 0 to 1."""
    rows = rows or cells
    total = np.zeros(np.broadcast(x, y).shape, np.float32)
    weight = 1.0
    weights = 0.0
    for octave in range(octaves):
        total += np.float32(weight) * value_noise(x, y, cells << octave, rng, rows << octave)
        weights += weight
        weight *= gain
    return total / np.float32(weights)


def shifted(image: Image, dx: Image, dy: Image) -> Image:
    """Looks up a tileable (n, n) image bilinearly, displaced by dx, dy (in image widths)."""
    size = image.shape[0]
    columns = np.arange(size, dtype=np.float32)[None, :] + dx * size
    rows = np.arange(size, dtype=np.float32)[:, None] + dy * size
    left, top = np.floor(columns), np.floor(rows)
    fx, fy = columns - left, rows - top
    i0, j0 = top.astype(np.int32) % size, left.astype(np.int32) % size
    i1, j1 = (i0 + 1) % size, (j0 + 1) % size
    upper = image[i0, j0] * (1 - fx) + image[i0, j1] * fx
    return upper * (1 - fy) + (image[i1, j0] * (1 - fx) + image[i1, j1] * fx) * fy


def ramp(t: Image, stops: list[tuple[float, tuple[float, float, float]]]) -> Image:
    """Maps values (h, w) to colours (h, w, 3) by linear interpolation between colour stops."""
    places = [place for place, _ in stops]
    return np.stack(
        [np.interp(t, places, [colour[k] for _, colour in stops]) for k in range(3)], axis=2
    ).astype(np.float32)


def mix(a: Image, b: Image, weight: Image) -> Image:
    """Interpolates from a to b, (h, w, 3), by a weight (h, w)."""
    return a + (b - a) * weight[..., None]


def flat(colour: tuple[float, float, float]) -> Image:
    """Makes an image of one texel with the given colour."""
    return np.array(colour, np.float32).reshape(1, 1, 3)


def step(x: Image, low: float, high: float) -> Image:
    """Smooth step from 0 at ``low`` to 1 at ``high``."""
    s = np.clip((x - low) / (high - low), 0.0, 1.0)
    return (s * s * (3.0 - 2.0 * s)).astype(np.float32)


def normal_map(height: Image, metres: float) -> Image:
    """Converts tileable heights (size, size) to a normal map that stores n as 0.5 + 0.5 n.

    Args:
        height: Height of the surface at each texel, in metres.
        metres: Edge length of the area that the image covers, in metres.
    """
    per_metre = 0.5 * height.shape[0] / metres
    slope_x = (np.roll(height, -1, 1) - np.roll(height, 1, 1)) * per_metre
    slope_y = (np.roll(height, 1, 0) - np.roll(height, -1, 0)) * per_metre
    normal = np.stack([-slope_x, -slope_y, np.ones_like(height)], axis=2)
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    return (0.5 + 0.5 * normal).astype(np.float32)
