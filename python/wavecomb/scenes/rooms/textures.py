# SPDX-License-Identifier: Apache-2.0
"""Images of the room's walls, floor, fabrics and books, and of the pictures on its walls."""

from __future__ import annotations

import functools

import numpy as np

from wavecomb.scenes.authoring.patterns import (
    Image,
    flat,
    fractal,
    grid,
    mix,
    normal_map,
    ramp,
    step,
    value_noise,
)

PLASTER_METRES, PLANKS_METRES, WALNUT_METRES = 1.6, 2.4, 0.5
LINEN_METRES, LEATHER_METRES = 0.16, 0.18
"""Edge lengths of the areas that the images cover, in metres."""
RUG_METRES = (2.7, 1.9)
"""Width and height of the area that the rug's image covers, in metres."""
_BOARDS = 16
_THREADS = 64
_LAYOUT_SEED = 78


def _grey(values: Image) -> Image:
    return np.repeat(np.clip(values, 0, 1)[..., None], 3, axis=2).astype(np.float32)


def plaster(size: int, rng: np.random.Generator) -> Image:
    """Painted plaster: warm white, with broad faint stains."""
    x, y = grid(size)
    tone = 0.965 + 0.04 * fractal(x, y, 4, 5, rng) + 0.02 * (fractal(x, y, 64, 3, rng) - 0.5)
    return np.clip(flat((0.925, 0.905, 0.87)) * tone[..., None], 0, 1).astype(np.float32)


def plaster_normal(size: int, rng: np.random.Generator) -> Image:
    """Normal map of plaster, with trowel strokes and sand grains up to a millimetre high."""
    x, y = grid(size)
    strokes = fractal(x, y, 12, 4, rng, 0.5, rows=6)
    grains = fractal(x, y, 128, 3, rng, 0.6)
    return normal_map(0.0035 * strokes + 0.0006 * grains, PLASTER_METRES)


@functools.lru_cache(maxsize=1)
def _planks(size: int) -> tuple[Image, Image, Image]:
    """Returns the joints, board tones and grain of the floor's images, each (size, size)."""
    rng = np.random.default_rng(_LAYOUT_SEED)
    x, y = grid(size)
    across = x * _BOARDS
    row = np.floor(across).astype(np.int64)[0]
    along = 2.0 * y + rng.random(_BOARDS)[row][None, :]
    board = np.floor(along).astype(np.int64) % 2
    width, length = PLANKS_METRES / _BOARDS, PLANKS_METRES / 2.0
    edge = np.minimum(across - np.floor(across), np.ceil(across) - across) * width
    end = np.minimum(along - np.floor(along), np.ceil(along) - along) * length
    texel = PLANKS_METRES / size
    joint = 1.0 - step(np.minimum(edge, end), 0.3 * texel, 0.3 * texel + 0.0018)
    tone = rng.random((_BOARDS, 2)).astype(np.float32)[row[None, :], board]
    warp = fractal(x, y, 32, 3, rng, 0.5, rows=3)
    ring = (3.0 * (across - row) + 4.0 * warp + 5.0 * tone) % 1.0
    late = step(ring, 0.0, 0.8) * (1.0 - step(ring, 0.9, 1.0))
    fibre = value_noise(x, y, 1024, rng, rows=24)
    pores = step(fractal(x, y, 512, 2, rng, 0.5, rows=48), 0.66, 0.78)
    return joint, tone, (0.45 * late + 0.35 * fibre + 0.4 * pores).astype(np.float32)


def planks(size: int, rng: np.random.Generator) -> Image:
    """Floor of oak boards, 15 cm wide, along v."""
    del rng
    joint, tone, grain = _planks(size)
    oak = ramp(
        0.55 * grain + 0.45 * (1.0 - tone),
        [(0.05, (0.74, 0.58, 0.41)), (0.45, (0.61, 0.44, 0.28)), (0.95, (0.40, 0.26, 0.155))],
    )
    return np.clip(mix(oak, flat((0.11, 0.075, 0.05)), 0.9 * joint), 0, 1).astype(np.float32)


def planks_roughness(size: int, rng: np.random.Generator) -> Image:
    """Roughness of oiled boards, with duller grain, matt joints and areas polished by steps."""
    joint, tone, grain = _planks(size)
    x, y = grid(size)
    worn = step(fractal(x, y, 3, 4, rng), 0.4, 0.7)
    rough = 0.27 + 0.10 * tone + 0.16 * grain + 0.10 * worn
    return _grey(rough + (0.95 - rough) * joint)


def walnut(size: int, rng: np.random.Generator) -> Image:
    """Oiled walnut with an even, nearly straight grain along v."""
    x, y = grid(size)
    warp = fractal(x, y, 5, 4, rng, 0.45, rows=1)
    ring = ((12.0 * x + 3.0 * warp) % 1.0).astype(np.float32)
    late = step(ring, 0.0, 0.85) * (1.0 - step(ring, 0.92, 1.0))
    streak = fractal(x, y, 24, 3, rng, 0.6, rows=2)
    fibre = value_noise(x, y, 512, rng, rows=12)
    pores = step(fractal(x, y, 256, 2, rng, 0.5, rows=24), 0.64, 0.78)
    tone = 0.45 * late + 0.55 * step(streak, 0.25, 0.75)
    wood = ramp(
        tone, [(0.0, (0.56, 0.39, 0.26)), (0.5, (0.46, 0.30, 0.19)), (1.0, (0.33, 0.205, 0.13))]
    )
    shade = 0.90 + 0.18 * fibre - 0.22 * pores
    return np.clip(wood * shade[..., None], 0, 1).astype(np.float32)


def _threads(size: int, rng: np.random.Generator) -> tuple[Image, Image]:
    """Returns the height of a plain weave and the strength of each thread, both 0 to 1."""
    x, y = grid(size)
    px, py = x * _THREADS, y * _THREADS
    ix, iy = np.floor(px), np.floor(py)
    warp = ((ix + iy) % 2 < 1).astype(np.float32)
    across = np.where(warp > 0, px - ix, py - iy) - 0.5
    along = np.where(warp > 0, py - iy, px - ix) - 0.5
    height = (1.0 - 3.2 * across**2) * (1.0 - 1.6 * along**2)
    thread = rng.random((2, _THREADS)).astype(np.float32)
    strength = np.where(warp > 0, thread[0][ix.astype(int)], thread[1][iy.astype(int)])
    return height.astype(np.float32), strength.astype(np.float32)


def linen(size: int, rng: np.random.Generator) -> Image:
    """Undyed linen, near white.

    Materials tint the linen with the ``scale`` input of the texture.
    """
    height, strength = _threads(size, rng)
    shade = (0.55 + 0.45 * height) * (0.93 + 0.07 * strength)
    return np.clip(flat((0.80, 0.79, 0.76)) * shade[..., None], 0, 1).astype(np.float32)


def wool(size: int, rng: np.random.Generator) -> Image:
    """Grey-blue upholstery of plain weave with flecks."""
    height, strength = _threads(size, rng)
    x, y = grid(size)
    fleck = step(fractal(x, y, 32, 3, rng, 0.6), 0.55, 0.75)
    colour = mix(flat((0.40, 0.50, 0.55)), flat((0.64, 0.69, 0.69)), 0.6 * fleck + 0.3 * strength)
    return np.clip(colour * (0.62 + 0.38 * height)[..., None], 0, 1).astype(np.float32)


def weave_normal(size: int, rng: np.random.Generator) -> Image:
    """Normal map of the plain weave of ``linen`` and ``wool``."""
    height, _ = _threads(size, rng)
    return normal_map(0.0004 * height, LINEN_METRES)


def leather_normal(size: int, rng: np.random.Generator) -> Image:
    """Normal map of grained leather: pebbles of about 3 mm with creases between."""
    count = 56
    x, y = grid(size)
    px, py = x * count, y * count
    ix, iy = np.floor(px).astype(np.int64), np.floor(py).astype(np.int64)
    jitter = rng.random((2, count, count)).astype(np.float32)
    first = np.full((size, size), 9.0, np.float32)
    second = first.copy()
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            cx, cy = (ix + dx) % count, (iy + dy) % count
            distance = np.hypot(
                ix + dx + jitter[0][cy, cx] - px, iy + dy + jitter[1][cy, cx] - py
            ).astype(np.float32)
            second = np.minimum(second, np.maximum(first, distance))
            first = np.minimum(first, distance)
    return normal_map(0.00035 * step(second - first, 0.0, 0.45), LEATHER_METRES)


def rug(size: int, rng: np.random.Generator) -> Image:
    """A knotted rug: borders, a field with a lattice of stars, and a medallion in the middle."""
    x, y = grid(size)
    across, down = x * RUG_METRES[0], y * RUG_METRES[1]
    edge = np.minimum(
        np.minimum(across, RUG_METRES[0] - across), np.minimum(down, RUG_METRES[1] - down)
    )
    red, navy = flat((0.46, 0.10, 0.09)), flat((0.10, 0.13, 0.24))
    cream, ochre = flat((0.80, 0.72, 0.56)), flat((0.66, 0.46, 0.20))
    here = np.zeros((size, size), np.float32)
    picture = mix(red, navy, here)

    def lattice(pitch: float, reach: float) -> Image:
        """Returns a mask of diamonds on a grid; ``reach`` is half a diamond's width in metres."""
        u, v = (across / pitch) % 1.0 - 0.5, (down / pitch) % 1.0 - 0.5
        return ((np.abs(u) + np.abs(v)) * pitch < reach).astype(np.float32)

    picture = mix(picture, ochre, lattice(0.10, 0.022))
    picture = mix(picture, navy, lattice(0.10, 0.010))
    cx, cy = across - 0.5 * RUG_METRES[0], down - 0.5 * RUG_METRES[1]
    angle = np.arctan2(cy / 0.40, cx / 0.66)
    ring = np.hypot(cy / 0.40, cx / 0.66) + 0.05 * np.cos(12.0 * angle)
    for reach, colour in ((1.0, cream), (0.95, navy), (0.72, ochre), (0.67, red), (0.3, cream)):
        picture = mix(picture, colour, (ring < reach).astype(np.float32))
    petals = np.abs((angle * 6.0 / np.pi) % 1.0 - 0.5)
    picture = mix(picture, cream, ((ring < 0.90) & (ring > 0.78) & (petals < 0.18)) * 1.0)
    picture = mix(picture, navy, ((ring < 0.22) & (petals < 0.3)) * 1.0)
    for reach, colour in (
        (0.30, cream), (0.29, navy), (0.26, ochre), (0.25, red), (0.09, cream), (0.08, navy)
    ):  # fmt: skip
        picture = mix(picture, colour, (edge < reach).astype(np.float32))
    border = ((edge > 0.10) & (edge < 0.24)).astype(np.float32)
    picture = mix(picture, cream, border * lattice(0.14, 0.05))
    picture = mix(picture, navy, border * lattice(0.14, 0.03))
    picture = mix(picture, ochre, border * lattice(0.14, 0.012))
    knots = 0.80 + 0.4 * fractal(x, y, 256, 2, rng, 0.7) * (0.6 + 0.4 * fractal(x, y, 8, 4, rng))
    return np.clip(picture * knots[..., None], 0, 1).astype(np.float32)


def pages(size: int, rng: np.random.Generator) -> Image:
    """Edges of a book's pages: fine lines across v."""
    x, y = grid(size)
    leaf = value_noise(0.0 * x + 0.5, y, 128, rng) + 0.0 * x
    tone = 0.84 + 0.16 * leaf + 0.04 * (fractal(x, y, 16, 3, rng) - 0.5)
    return np.clip(flat((0.88, 0.83, 0.71)) * tone[..., None], 0, 1).astype(np.float32)


def hills(size: int, rng: np.random.Generator) -> Image:
    """Rows of hills in an evening haze, and a low sun."""
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
    """An abstract painting: two soft fields of colour on a third."""
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
