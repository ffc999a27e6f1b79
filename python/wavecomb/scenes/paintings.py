# SPDX-License-Identifier: Apache-2.0
"""What hangs in the room's frames."""

from __future__ import annotations

import numpy as np

from wavecomb.scenes.patterns import Image, flat, fractal, grid, mix, ramp, step


def hills(size: int, rng: np.random.Generator) -> Image:
    """Hills behind hills in an evening haze, and a low sun."""
    x, y = grid(size)
    sky = ramp(
        np.broadcast_to(y, (size, size)),
        [(0.0, (0.30, 0.42, 0.56)), (0.4, (0.85, 0.71, 0.55)), (0.6, (0.95, 0.60, 0.36))],
    )
    sun = 1.0 - step(np.hypot(x - 0.66, y - 0.42), 0.05, 0.06)
    picture = mix(sky, flat((1.0, 0.93, 0.74)), sun)
    for layer in range(5):
        share = layer / 4.0
        noise = fractal(x, 0.0 * y + 0.37, 3 + layer, 6, rng, 0.5)
        ridge = 0.44 + 0.12 * layer - 0.28 * (noise[:1] - 0.5)
        near = ramp(np.full((1, 1), share), [(0.0, (0.72, 0.52, 0.46)), (1.0, (0.10, 0.14, 0.16))])
        brushed = near * (0.9 + 0.25 * fractal(x, y, 24, 4, rng))[..., None]
        picture = mix(picture, brushed, step(y - ridge, -0.002, 0.006))
    return np.clip(picture, 0, 1).astype(np.float32)


def fields(size: int, rng: np.random.Generator) -> Image:
    """Two soft fields of colour on a third."""
    x, y = grid(size)
    wobble = 0.03 * (fractal(x, y, 8, 5, rng) - 0.5)
    cloud = fractal(x, y, 6, 6, rng, 0.6)
    picture = flat((0.16, 0.22, 0.27)) * (0.85 + 0.3 * cloud)[..., None]
    for low, high, colour in (
        (0.09, 0.52, (0.83, 0.42, 0.14)),
        (0.58, 0.92, (0.62, 0.12, 0.11)),
    ):
        inside = np.minimum(np.minimum(x - 0.1, 0.9 - x), np.minimum(y - low, high - y)) + wobble
        tinted = flat(colour) * (0.7 + 0.5 * cloud)[..., None]
        picture = mix(picture, tinted, step(inside, -0.012, 0.02))
    return np.clip(picture, 0, 1).astype(np.float32)


def fern(size: int, rng: np.random.Generator) -> Image:
    """A pressed fern on old paper."""
    x, y = grid(size)
    paper = flat((0.88, 0.84, 0.73)) * (0.92 + 0.1 * fractal(x, y, 8, 6, rng))[..., None]
    rise = 0.93 - y
    stem = 0.5 + 0.07 * np.sin(2.2 * rise)
    side = x - stem
    swell = np.maximum(np.sin(np.pi * np.clip(rise / 0.86, 0.0, 1.0)), 0.0)
    reach = 0.34 * swell**0.8 * (1.2 - rise)
    height = (rise - 0.55 * np.abs(side)) * 19.0
    leaf = np.abs(height - np.floor(height) - 0.5)
    slim = 0.42 * np.sqrt(np.clip(1.0 - np.abs(side) / np.maximum(reach, 1e-3), 0.0, 1.0))
    ink = ((leaf < slim) & (rise > 0.08) & (rise < 0.86)) * 1.0
    ink = np.maximum(ink, (np.abs(side) < 0.005) & (rise > 0.0) & (rise < 0.86))
    green = flat((0.20, 0.29, 0.14)) * (0.75 + 0.5 * fractal(x, y, 32, 4, rng))[..., None]
    return np.clip(mix(paper, green, 0.93 * ink), 0, 1).astype(np.float32)
