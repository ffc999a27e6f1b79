# SPDX-License-Identifier: Apache-2.0
"""Procedural, tileable images, and an image of a sky, written through OpenImageIO.

Images are float32 arrays (height, width, channels) with row 0 on top. Colours are display-referred
sRGB values from 0 to 1; roughness and normal maps hold linear data; the sky holds linear radiance.
"""

from __future__ import annotations

import contextlib
import functools
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from wavecomb.scenes.authoring.patterns import (
    Image,
    flat,
    fractal,
    grid,
    mix,
    normal_map,
    ramp,
    shifted,
    step,
    value_noise,
)


@dataclass(frozen=True)
class TextureInfo:
    """Description of a procedural texture.

    Attributes:
        make: Function that returns the image for a size in texels and a random generator.
        size: Edge in texels at full resolution.
        colour: True for sRGB colour, False for raw data.
        channels: Output of UsdUVTexture to use, "rgb" or "r".
        normal: True for a tangent space normal map (stored as 0.5 + 0.5 n).
    """

    make: Callable[[int, np.random.Generator], Image]
    size: int
    colour: bool
    channels: str = "rgb"
    normal: bool = False


def checker(size: int, rng: np.random.Generator) -> Image:
    """Ivory and deep blue checks, 8 x 8, slightly abraded."""
    x, y = grid(size)
    odd = ((np.floor(x * 8) + np.floor(y * 8)) % 2).astype(np.float32)
    wear = 0.90 + 0.14 * fractal(x, y, 8, 5, rng)
    return np.clip(
        mix(flat((0.92, 0.87, 0.76)), flat((0.10, 0.19, 0.36)), odd) * wear[..., None], 0, 1
    )


def wood(size: int, rng: np.random.Generator) -> Image:
    """Walnut: growth rings stretched along v, pores and fibres."""
    x, y = grid(size)
    warp = fractal(x, y, 3, 4, rng)
    ring = (x * 5.0 + 1.6 * warp + 0.25 * np.sin(2 * np.pi * y)) % 1.0
    late = step(ring, 0.0, 0.75) * (1.0 - step(ring, 0.88, 1.0))
    fibre = value_noise(x, (y * 0.03125) % 1.0, 256, rng)
    pores = step(fractal(x, (y * 0.0625) % 1.0, 128, 2, rng), 0.62, 0.75)
    base = ramp(
        late, [(0.0, (0.66, 0.43, 0.24)), (0.5, (0.53, 0.32, 0.17)), (1.0, (0.33, 0.18, 0.09))]
    )
    return np.clip(base * (0.86 + 0.24 * fibre - 0.30 * pores)[..., None], 0, 1)


def marble(size: int, rng: np.random.Generator) -> Image:
    """White marble with grey and gold veins."""
    x, y = grid(size)
    wx, wy = fractal(x, y, 3, 6, rng), fractal(x, y, 3, 6, rng)
    wx, wy = 0.35 * wx, 0.35 * wy
    broad = np.abs(2.0 * shifted(fractal(x, y, 4, 6, rng, 0.55), wx, wy) - 1.0)
    thin = np.abs(2.0 * shifted(fractal(x, y, 6, 6, rng, 0.6), wy, wx) - 1.0)
    cloud = fractal(x, y, 4, 6, rng)
    base = mix(flat((0.95, 0.94, 0.92)), flat((0.80, 0.81, 0.83)), step(cloud, 0.35, 0.75))
    base = mix(base, flat((0.36, 0.38, 0.42)), 0.85 * (1.0 - step(broad, 0.0, 0.10)))
    return np.clip(mix(base, flat((0.72, 0.55, 0.28)), 0.8 * (1.0 - step(thin, 0.0, 0.035))), 0, 1)


def weave(size: int, rng: np.random.Generator) -> Image:
    """Twill cloth: crimson warp, ochre weft."""
    x, y = grid(size)
    threads = 48
    px, py = x * threads, y * threads
    ix, iy = np.floor(px), np.floor(py)
    warp_up = ((ix + iy) % 4 < 2).astype(np.float32)
    across = np.where(warp_up > 0, px - ix, py - iy) - 0.5
    along = np.where(warp_up > 0, py - iy, px - ix) - 0.5
    shade = (1.0 - 2.4 * across**2) * (1.0 - 0.7 * along**2)
    twist = 0.90 + 0.10 * np.sin(2 * np.pi * (3 * along + 2.5 * across))
    worn = 0.85 + 0.3 * fractal(x, y, 16, 4, rng)
    colour = mix(flat((0.80, 0.55, 0.22)), flat((0.60, 0.10, 0.13)), warp_up)
    return np.clip(colour * (shade * twist * worn)[..., None], 0, 1).astype(np.float32)


_TILE_SEED = 77


@functools.lru_cache(maxsize=1)
def _tile_layout(size: int) -> tuple[Image, Image, Image, Image]:
    """Returns a mask of joints, each tile's tone, fine grain and broad stains, (size, size) each.

    The seed is fixed, since the colour and the roughness image of the floor tiles must have the
    same layout.
    """
    rng = np.random.default_rng(_TILE_SEED)
    x, y = grid(size)
    count = 4
    px, py = x * count, y * count
    ix, iy = np.floor(px).astype(np.int64), np.floor(py).astype(np.int64)
    chip = 0.012 * (fractal(x, y, 32, 3, rng) - 0.5)
    inset = np.minimum(np.minimum(px - ix, ix + 1 - px), np.minimum(py - iy, iy + 1 - py))
    joint = 1.0 - step(inset + chip, 0.010, 0.020)
    tone = rng.random((count, count)).astype(np.float32)[iy, ix]
    return joint, tone, fractal(x, y, 32, 6, rng, 0.6), fractal(x, y, 4, 5, rng)


def tiles(size: int, rng: np.random.Generator) -> Image:
    """Slate floor tiles, 4 x 4, with pale joints."""
    del rng
    joint, tone, grain, stain = _tile_layout(size)
    slate = ramp(
        0.42 * tone + 0.28 * grain + 0.30 * stain,
        [(0.15, (0.23, 0.245, 0.27)), (0.5, (0.33, 0.335, 0.34)), (0.85, (0.45, 0.42, 0.385))],
    )
    return np.clip(mix(slate, flat((0.17, 0.165, 0.16)), joint), 0, 1)


def tiles_roughness(size: int, rng: np.random.Generator) -> Image:
    """Roughness of the floor tiles: honed stone with smooth walked-on areas, and matt joints."""
    del rng
    joint, tone, grain, stain = _tile_layout(size)
    rough = 0.22 + 0.12 * tone + 0.20 * grain + 0.28 * step(stain, 0.35, 0.7)
    rough = rough + (0.9 - rough) * joint
    return np.repeat(np.clip(rough, 0.05, 1.0)[..., None], 3, axis=2).astype(np.float32)


def brushed(size: int, rng: np.random.Generator) -> Image:
    """Roughness of brushed metal: long scratches along u, with a few deep ones."""
    x, y = grid(size)
    fine = value_noise((x * 0.03125) % 1.0, y, 256, rng)
    mid = value_noise((x * 0.0625) % 1.0, y, 96, rng)
    deep = step(value_noise((x * 0.125) % 1.0, y, 192, rng), 0.86, 0.95)
    rough = 0.16 + 0.20 * fine + 0.14 * mid + 0.25 * deep
    return np.repeat(np.clip(rough, 0.05, 1.0)[..., None], 3, axis=2).astype(np.float32)


def hammered(size: int, rng: np.random.Generator) -> Image:
    """Normal map of hammered metal: overlapping round dents; n stored as 0.5 + 0.5 n."""
    count = 9
    centres = (
        np.stack(np.meshgrid(np.arange(count), np.arange(count)), axis=2).reshape(-1, 2)
        + rng.random((count * count, 2))
    ) / count
    height = np.zeros((size, size), np.float32)
    reach = int(np.ceil(1.05 / count * size))
    for cx, cy in centres:
        columns = np.arange(int(cx * size) - reach, int(cx * size) + reach + 1)
        rows = np.arange(int(cy * size) - reach, int(cy * size) + reach + 1)
        dx, dy = (columns + 0.5) / size - cx, ((rows + 0.5) / size - cy)[:, None]
        dent = np.clip(1.0 - (dx * dx + dy * dy) * (count / 1.05) ** 2, 0.0, None)
        window = np.ix_(rows % size, columns % size)
        height[window] = np.maximum(height[window], dent)
    height = -0.020 * height
    return normal_map(height, 1.0)


def glaze(size: int, rng: np.random.Generator) -> Image:
    """Porcelain with a cobalt pattern of waves and dots."""
    x, y = grid(size)
    wobble = 0.02 * (fractal(x, y, 6, 4, rng) - 0.5)
    cx, cy = (x * 4) % 1.0 - 0.5, (y * 8 + 0.5 * (np.floor(x * 4) % 2)) % 1.0
    arcs = np.abs((np.hypot(cx, cy * 0.6) * 3.0 + wobble * 10) % 1.0 - 0.5)
    line = 1.0 - step(arcs, 0.10, 0.16)
    band = step(np.sin(2 * np.pi * 2 * y + wobble * 20), 0.25, 0.35)
    dots = 1.0 - step(np.hypot((x * 10) % 1.0 - 0.5, (y * 10) % 1.0 - 0.5), 0.14, 0.20)
    ink = np.clip(
        line * band + dots * (1 - band) * step(np.sin(2 * np.pi * 2 * y), -1.0, -0.6), 0, 1
    )
    pool = 0.75 + 0.25 * fractal(x, y, 24, 3, rng)
    return np.clip(
        mix(
            flat((0.93, 0.93, 0.90)) * np.ones((size, size, 1), np.float32),
            flat((0.07, 0.17, 0.52)),
            (ink * pool).astype(np.float32),
        ),
        0,
        1,
    )


TEXTURES: dict[str, TextureInfo] = {
    "checker": TextureInfo(checker, 1024, True),
    "wood": TextureInfo(wood, 1024, True),
    "marble": TextureInfo(marble, 2048, True),
    "weave": TextureInfo(weave, 1024, True),
    "glaze": TextureInfo(glaze, 1024, True),
    "tiles": TextureInfo(tiles, 2048, True),
    "tiles_roughness": TextureInfo(tiles_roughness, 2048, False, "r"),
    "brushed": TextureInfo(brushed, 1024, False, "r"),
    "hammered": TextureInfo(hammered, 1024, False, "rgb", True),
}
"""Images that materials may use, by name. The file is ``<name>.png``."""


def sky(width: int, height: int, seed: int) -> Image:
    """Makes a late afternoon sky as a latitude-longitude map, (height, width, 3).

    Values are linear radiance. Row 0 is the zenith (+Y). The sun is a soft disc of about 8 degrees,
    24 degrees above the horizon. A few texels hold most of the light, which makes importance
    sampling necessary.
    """
    rng = np.random.default_rng([seed, 5])
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    theta, phi = np.pi * v, 2 * np.pi * (u - 0.5)
    up = np.cos(theta)
    sun_theta, sun_phi = np.radians(90.0 - 24.0), np.radians(58.0)
    to_sun = np.sin(theta) * np.sin(sun_theta) * np.cos(phi - sun_phi) + np.cos(theta) * np.cos(
        sun_theta
    )
    to_sun = np.clip(to_sun, -1.0, 1.0)
    elevation = np.clip(up, 0.0, 1.0)
    stops = [0.0, 0.06, 0.2, 0.5, 1.0]
    colours = np.array(
        [
            [1.00, 0.72, 0.50],
            [0.86, 0.74, 0.66],
            [0.50, 0.62, 0.80],
            [0.24, 0.40, 0.70],
            [0.13, 0.25, 0.52],
        ]
    )
    image = np.stack([np.interp(elevation, stops, colours[:, k]) for k in range(3)], axis=2)
    facing = (0.5 + 0.5 * to_sun)[..., None]
    image *= 0.55 + 0.75 * facing**2
    glow = np.maximum(to_sun, 0.0)[..., None]
    image += np.array([1.0, 0.62, 0.30]) * (0.9 * glow**14 + 2.5 * glow**110)
    # The clouds are a noise texture on a horizontal plane above the viewer. In perspective, they
    # are denser towards the horizon.
    reach = 1.0 / np.maximum(up, 0.03)
    px = (0.11 * reach * np.sin(theta) * np.cos(phi) + 0.5) % 1.0
    py = (0.11 * reach * np.sin(theta) * np.sin(phi) + 0.5) % 1.0
    cover = step(fractal(px.astype(np.float32), py.astype(np.float32), 5, 6, rng, 0.55), 0.48, 0.72)
    cover = (cover * step(up.astype(np.float32), 0.03, 0.22))[..., None]
    lit = np.array([1.10, 0.95, 0.84]) * (0.55 + 1.3 * facing**6)
    image = image * (1.0 - 0.75 * cover) + 0.75 * cover * lit
    disc = step(
        to_sun.astype(np.float32), float(np.cos(np.radians(4.4))), float(np.cos(np.radians(3.6)))
    )[..., None]
    image = image + disc * np.array([300.0, 220.0, 135.0])
    ground = np.array([0.12, 0.115, 0.11]) * (0.6 + 0.4 * facing)
    blend = step((-up).astype(np.float32), -0.004, 0.015)[..., None]
    return (image * (1.0 - blend) + ground * blend).astype(np.float32)


def write_image(path: Path, image: Image, data_format: str) -> None:
    """Writes an image atomically.

    Args:
        path: PNG or EXR file.
        image: (height, width, channels).
        data_format: OpenImageIO's name of the stored type: "uint8" or "half".

    Raises:
        OSError: The file cannot be written.
    """
    height, width, channels = image.shape
    part = path.with_name(f".{path.stem}.part{path.suffix}")
    spec = oiio.ImageSpec(width, height, channels, data_format)
    if path.suffix == ".exr":
        spec.attribute("compression", "zip")
    else:
        spec.attribute("png:compressionLevel", 4)
    output = oiio.ImageOutput.create(str(part))
    if output is None:
        raise OSError(f"{path}: OpenImageIO cannot write this kind of file")
    try:
        if not output.open(str(part), spec) or not output.write_image(
            np.ascontiguousarray(image, dtype=np.float32)
        ):
            raise OSError(f"{path}: {output.geterror()}")
        output.close()
        os.replace(part, path)
    finally:
        with contextlib.suppress(FileNotFoundError):
            part.unlink()
