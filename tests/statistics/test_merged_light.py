# SPDX-License-Identifier: Apache-2.0
"""Tests caustics seen in mirrors and through glass against closed forms and camera paths."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from agreement import assert_agree, batches
from stages import box, camera, ground, light, material, moved, quad, sphere, write_stage

import wavecomb

GREY = material("Grey", "diffuse", diffuseColor=(0.6,) * 3)


def test_a_floor_under_glass(tmp_path: Path, beauty: Any) -> None:
    """A point light and the camera above a clear plate over a floor: only merging finds the light.

    The irradiance is that of test_light_through_a_plate_of_glass, E = I sum_m (1 - R)^2 R^(2 m) /
    (h - t (1 - 1 / n) + 2 m t / n)^2, and the plate transmits sum_m (1 - R)^2 R^(2 m) = (1 - R) /
    (1 + R) on the way back.
    """
    height, thick, index, albedo, power = 2.0, 0.3, 1.5, 0.6, 10.0
    glass = material("Clear", "dielectric", roughness=0.0, ior=index, diffuseColor=(1, 1, 1))
    point = light("Sphere", colour=(4 * power,) * 3, transform=moved(0, height, 0), radius=0)
    prims = (
        glass,
        GREY,
        ground("Grey", 3.0),
        box("Plate", (-3.0, 1.2, -3.0), (3.0, 1.2 + thick, 3.0), "Clear"),
        point,
        camera((0.15, 3.0, 0.0), (0, 0, 0), half=0.03),
    )
    stage = wavecomb.load(write_stage(tmp_path / "stage.usda", *prims))
    r = ((index - 1) / (index + 1)) ** 2
    way = height - thick * (1 - 1 / index)
    reflected = [(1 - r) ** 2 * r ** (2 * m) / (way + 2 * m * thick / index) ** 2 for m in range(3)]
    expected = albedo / np.pi * power * sum(reflected) * (1 - r) / (1 + r)
    settings: dict[str, Any] = {"max_depth": 12, "sampler": "sobol", "transport": "light"}
    found = beauty(stage, 32, 256, merge_radius=2.0, **settings)
    assert found.mean() == pytest.approx(1.015 * expected, rel=0.06)
    assert beauty(stage, 16, 16, **settings).max() == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("lamp", ["ball", "sun"])
def test_what_a_mirror_shows_is_unbiased(lamp: str, tmp_path: Path, beauty: Any) -> None:
    """A glass ball in front of a mirror, with lights that camera paths find."""
    lamps = {
        "ball": light("Sphere", colour=(30, 28, 25), transform=moved(0.9, 2.2, 0.4), radius=0.35),
        "sun": light("Distant", colour=(2, 2, 2), angle=30),
    }
    prims = (
        material("Clear", "dielectric", roughness=0.0, ior=1.5, diffuseColor=(1, 1, 1)),
        material("Mirror", "metal", roughness=0.0, diffuseColor=(0.9, 0.9, 0.95)),
        material("Coated", "plastic", diffuseColor=(0.6, 0.3, 0.2), roughness=0.0, ior=1.5),
        GREY,
        ground("Grey", 2.0),
        quad("Glass", [(-2, 0, -1.2), (2, 0, -1.2), (2, 2, -1.2), (-2, 2, -1.2)], "Mirror"),
        quad("Wall", [(-1.5, 0, 1), (-1.5, 0, -1.2), (-1.5, 1.5, -1.2), (-1.5, 1.5, 1)], "Coated"),
        sphere("Ball", "Clear", (0.2, 0.6, 0.1), 0.4, rings=24, smooth=True),
        lamps[lamp],
        camera((0.2, 1.4, 3.0), (0.0, 0.4, -1.2), half=0.4),
    )
    stage = wavecomb.load(write_stage(tmp_path / "stage.usda", *prims))
    plain: dict[str, Any] = {"max_depth": 7}
    merged = batches(
        lambda seed: beauty(stage, 32, 16, seed=seed, transport="light", merge_radius=0.5, **plain),
        12,
    )
    alone = batches(lambda seed: beauty(stage, 32, 48, seed=seed, **plain), 12, 500)
    # Merging blurs light by half a pixel, so edges differ.
    assert_agree(f"merged {lamp}", merged, alone, tolerance=0.03)
