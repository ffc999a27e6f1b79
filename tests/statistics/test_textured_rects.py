# SPDX-License-Identifier: Apache-2.0
"""Tests textured rect lights: closed form, wave and reference integrator, and noise."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from stages import camera, ground, light, material, moved, turned, write_stage

import wavecomb
from wavecomb.scenes.authoring.textures import write_image

Array = NDArray[np.float64]

WIDTH, HEIGHT = 1.0, 0.7
FLOOR = material("M", "diffuse", diffuseColor=(0.5, 0.5, 0.5))
DOWN = camera((0, 5, 0), (0, 0, 0), half=0.004)
"""A camera above the floor that sees 4 cm around the origin."""
PLACES = {
    "above": turned(-90) @ moved(0.8, 1.2, 0.3),
    "tilted": turned(-60, 70, 10) @ moved(0.8, 1.2, 0.3),
    "close by": turned(-90) @ moved(0.75, 0.2, 0.0),
}


def spots() -> NDArray[np.float32]:
    """Three bright texels of three colours on a dim background, (12, 16, 3)."""
    image = np.full((12, 16, 3), 0.02, np.float32)
    image[2, 3], image[7, 11], image[10, 12] = (30, 5, 2), (4, 40, 3), (1, 6, 50)
    return image


def radiance(image: Array, s: Array, t: Array) -> Array:
    """Looks up the image bilinearly with clamped coordinates; t points up."""
    height, width, _ = image.shape
    x, y = s * width - 0.5, (1 - t) * height - 0.5
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    a, b = (x - i)[..., None], (y - j)[..., None]

    def at(dx: int, dy: int) -> Array:
        return image[np.clip(j + dy, 0, height - 1), np.clip(i + dx, 0, width - 1)]

    low, high = at(0, 0) * (1 - a) + at(1, 0) * a, at(0, 1) * (1 - a) + at(1, 1) * a
    return np.asarray(low * (1 - b) + high * b)


@pytest.mark.parametrize("place", PLACES)
def test_irradiance(tmp_path: Path, beauty: Any, place: str) -> None:
    """Irradiance at the origin of the floor, compared with an integral of the image over the rect.

    Seen from the front, looking along +z with +y up, +x is on the left: s increases along -x.
    """
    image, frame = spots(), PLACES[place]
    write_image(tmp_path / "spots.exr", image, "float")
    lamp = light("Rect", texture="spots.exr", width=WIDTH, height=HEIGHT, transform=frame)
    stage = write_stage(tmp_path / "stage.usda", DOWN, FLOOR, ground("M"), lamp)
    found = beauty(stage, 16, 512, max_depth=1).mean(axis=(0, 1), dtype=np.float64)

    n = 600
    s, t = np.meshgrid((np.arange(n) + 0.5) / n, (np.arange(n) + 0.5) / n)
    local = np.stack([(0.5 - s) * WIDTH, (t - 0.5) * HEIGHT, 0 * s, 0 * s + 1], axis=-1)
    p = (local @ frame)[..., :3]
    d2 = (p**2).sum(-1)
    cos_floor = np.maximum(p[..., 1], 0) / np.sqrt(d2)
    cos_light = np.maximum((p @ frame[2, :3]) / np.sqrt(d2), 0)
    given = radiance(image.astype(np.float64), s, t) * (cos_floor * cos_light / d2)[..., None]
    expected = 0.5 / np.pi * given.mean((0, 1)) * WIDTH * HEIGHT
    assert np.abs(found / expected - 1).max() < 1e-2, (found, expected)


@pytest.fixture(scope="module")
def screen(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A floor in front of a screen with bright spots, and a uniform rect beside it."""
    folder = tmp_path_factory.mktemp("screen")
    write_image(folder / "spots.exr", spots(), "float")
    view = camera((0, 2, 4), (0, 0.3, 0), half=0.4)
    lit = light(
        "Rect",
        texture="spots.exr",
        width=2.0,
        height=1.5,
        transform=turned(0, 180) @ moved(0, 1, -1),
    )
    even = light("Rect", "Even", (0.02, 0.02, 0.02), turned(-90) @ moved(1, 2, 0))
    return write_stage(folder / "stage.usda", view, FLOOR, ground("M"), lit, even)


def test_the_wave_is_the_reference(screen: Path) -> None:
    settings: dict[str, Any] = {"size": (40, 32), "spp": 8, "max_depth": 3}
    reference = wavecomb.render(screen, integrator="reference", **settings)
    others: list[dict[str, Any]] = [{}, {"threads": 1}, {"wave_size": 64}, {"policy": "none"}]
    others += [{"traversal": "single"}, {"lanes": 1}]
    for other in others:
        assert wavecomb.compare(wavecomb.render(screen, **settings, **other), reference).equal, (
            other
        )


def test_the_floor_is_not_salt_and_pepper(screen: Path) -> None:
    """Relative noise at 16 samples is 0.45; with uniform sampling of the rect it was 1.69."""
    pictures = np.stack(
        [
            wavecomb.render(
                screen, size=(64, 64), spp=16, max_depth=1, filter="box", seed=seed
            ).beauty
            for seed in range(6)
        ]
    )
    floor = pictures[:, 44:]
    noise = np.sqrt(floor.var(axis=0, ddof=1).mean()) / floor.mean()
    print(f"noise {noise:.3f}")
    assert noise < 0.7
