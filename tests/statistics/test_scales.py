# SPDX-License-Identifier: Apache-2.0
"""Tests that scenes give equal images in millimetres and in kilometres, without leaks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from agreement import assert_agree, batches
from stages import box, camera, ground, light, material, moved, quad, sphere, write_stage

import wavecomb

SCALES = (1e-3, 1e3, 1e5)


def scaled(folder: Path, scale: float, place: tuple[float, float, float] = (0, 0, 0)) -> Any:
    """A ball, a block and a light. The points of the geometry are scaled, not its transform.

    ``place`` moves everything by this offset before scaling.
    """
    s, (x, y, z) = scale, place
    grey = material("Grey", "diffuse", diffuseColor=(0.6, 0.5, 0.4))
    blue = material("Blue", "plastic", diffuseColor=(0.2, 0.35, 0.7), roughness=0.3)
    floor = [(-4, 0, 4), (4, 0, 4), (4, 0, -4), (-4, 0, -4)]
    corners = [((a + x) * s, (b + y) * s, (c + z) * s) for a, b, c in floor]

    low, high = np.array((1.1, 0.0, 0.8)) + place, np.array((1.9, 0.7, 1.5)) + place
    return wavecomb.load(
        write_stage(
            folder / f"s{scale:g}_{x:g}.usda",
            camera(
                ((2.5 + x) * s, (2.6 + y) * s, (5 + z) * s),
                (x * s, (0.7 + y) * s, z * s),
                clip=(1e-3 * s, 1e4 * s),
            ),
            light("Sphere", "Lamp", (9, 6, 3), moved((1.4 + x) * s, (2.6 + y) * s, z * s),
                  radius=0.3 * s),
            light("Dome", "Sky", (0.2, 0.25, 0.3)),
            grey,
            blue,
            quad("Floor", corners, "Grey"),
            sphere("Ball", "Blue", (x * s, (1 + y) * s, z * s), s, rings=24, smooth=True),
            box("Block", tuple(low * s), tuple(high * s), "Grey"),
        )
    )  # fmt: skip


@pytest.mark.slow
def test_scales(tmp_path: Path, beauty: Any) -> None:
    """Each scale has a separate range of seeds, so that noise is independent."""
    unit = scaled(tmp_path, 1.0)
    b = batches(lambda seed: beauty(unit, 64, 64, seed=seed, max_depth=5), 8, first_seed=700)
    for k, scale in enumerate(SCALES):
        stage = scaled(tmp_path, scale)
        first = 100 * k
        a = batches(
            lambda seed, stage=stage: beauty(stage, 64, 64, seed=seed, max_depth=5), 8, first
        )
        assert_agree(f"scale {scale:g}", a, b)


@pytest.mark.slow
def test_far_from_the_origin(tmp_path: Path, beauty: Any) -> None:
    """A thousand units from the origin, floats resolve 6e-5 units; no surface shadows itself."""
    near, far = scaled(tmp_path, 1.0), scaled(tmp_path, 1.0, (1000.0, 0.0, -1000.0))
    b = batches(lambda seed: beauty(near, 64, 64, seed=seed, max_depth=5), 8, first_seed=700)
    a = batches(lambda seed: beauty(far, 64, 64, seed=seed, max_depth=5), 8)
    # Edges move by a thousandth of a pixel, and the shadows of facets with them.
    assert_agree("far away", a, b, tolerance=0.01)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3, 1e5])
def test_same_noise(tmp_path: Path, beauty: Any, scale: float) -> None:
    """With equal random numbers, pixels differ only by rounding and where a few paths diverge."""
    scale = 2.0 ** round(np.log2(scale))
    a, b = (beauty(scaled(tmp_path, s), 48, 4, max_depth=5) for s in (scale, 1.0))
    close = np.isclose(a, b, rtol=1e-3, atol=1e-4).all(axis=2)
    assert close.mean() > 0.98, f"{(~close).sum()} pixels differ"


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3, 1e5])
def test_a_closed_box_is_dark(tmp_path: Path, beauty: Any, scale: float) -> None:
    """No light from a bright sky leaks in through edges and corners."""
    s = scale
    grey = material("Grey", "diffuse", diffuseColor=(0.9, 0.9, 0.9))
    stage = write_stage(
        tmp_path / "s.usda",
        camera((0.1 * s, 0.2 * s, 0.3 * s), (-0.3 * s, -0.5 * s, -0.9 * s), half=0.9,
               clip=(1e-6 * s, 100 * s)),
        light("Dome", colour=(1e4, 1e4, 1e4)),
        grey,
        box("Box", (-s,) * 3, (s,) * 3, "Grey"),
    )  # fmt: skip
    assert beauty(wavecomb.load(stage), 64, 64, max_depth=6).max() == 0.0


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3, 1e5])
def test_an_open_floor_has_no_acne(tmp_path: Path, beauty: Any, scale: float) -> None:
    """A white plane under a white dome has radiance 1; self-intersections would darken it."""
    s = scale
    white = material("White", "diffuse", diffuseColor=(1, 1, 1))
    eye = (0.3 * s, 0.4 * s, 2.0 * s)
    stage = write_stage(
        tmp_path / "s.usda",
        camera(eye, (0, 0, 0), half=0.1, clip=(1e-6 * s, 100 * s)),
        light("Dome"),
        white,
        ground("White", half=4 * s),
    )
    picture = beauty(wavecomb.load(stage), 32, 1024, max_depth=4)
    assert abs(picture.mean() - 1.0) < 2e-3
    assert np.abs(picture.reshape(8, 4, 8, 4, 3).mean(axis=(1, 3)) - 1.0).max() < 0.02
