# SPDX-License-Identifier: Apache-2.0
"""Tests that techniques that connect the same points agree, also with closed forms."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stages import camera, light, moved, sphere, write_stage

import wavecomb
from wavecomb import _core

CASES = Path(__file__).parent / "cases"


def mean(stage: Any, seed: int = 0, middle: bool = False, **settings: Any) -> float:
    plain: dict[str, Any] = {"size": (32, 32), "roulette": "off", "filter": "box", "seed": seed}
    picture = wavecomb.render(stage, **(plain | settings)).beauty
    if middle:
        picture = picture[12:20, 12:20]
    return float(picture.mean())


def seeds(stage: Any, count: int, **settings: Any) -> np.ndarray:
    return np.array([mean(stage, seed, **settings) for seed in range(count)])


def z_of(a: np.ndarray, b: np.ndarray) -> float:
    """Welch's statistic of two sets of independent renders."""
    variance = a.var(ddof=1) / len(a) + b.var(ddof=1) / len(b)
    return float((a.mean() - b.mean()) / np.sqrt(variance))


@pytest.mark.slow
@pytest.mark.parametrize("transport", ["path", "light"])
@pytest.mark.parametrize(("lights", "right"), [("visible", 2.597), ("hidden", 8 / 3)])
def test_lampshade(transport: str, lights: str, right: float) -> None:
    """A thin-walled ball with smooth normals around a light.

    The wall transmits 0.4 of the light and reflects 0.4. Irradiance inside is 4 pi / (1 - 0.4 s),
    where s is the fraction of reflected light that hits the wall again: 0.96 if the light's shape
    is visible and blocks some of it, else 1.
    """
    stage = wavecomb.load(CASES / "lampshade.usda", lights=lights)
    settings = {"spp": 256, "max_depth": 12, "transport": transport}
    found = seeds(stage, 4, middle=True, **settings)
    assert found.mean() == pytest.approx(right, rel=0.015)


@pytest.mark.slow
def test_techniques_agree_at_lifted_origins(tmp_path: Path) -> None:
    """A light without effect takes 99 of 100 light samples, so that bounces find the other light.

    Walls are coarse with smooth normals: ray origins are lifted by a tenth of the distance to the
    light to avoid the shadow terminator.
    """
    settings: dict[str, Any] = {"max_depth": 2, "light_weights": "power"}
    settings["light_selection"] = "power"
    sampled = seeds(wavecomb.load(coarse_shade(tmp_path)), 8, spp=64, **settings)
    decoy = light("Rect", "Decoy", colour=(4e4, 4e4, 4e4), transform=moved(0, 0, -99))
    bounced = seeds(wavecomb.load(coarse_shade(tmp_path, decoy)), 8, spp=256, **settings)
    assert sampled.mean() == pytest.approx(bounced.mean(), rel=0.02)
    assert abs(z_of(sampled, bounced)) < 4.5


def coarse_shade(folder: Path, *prims: str) -> Path:
    wall = """def Material "M" {
        token outputs:mtlx:surface.connect = </World/M/S.outputs:surface>
        def Shader "S" {
            uniform token info:id = "ND_open_pbr_surface_surfaceshader"
            float inputs:specular_weight = 0
            float inputs:subsurface_weight = 1
            color3f inputs:subsurface_color = (0.8, 0.8, 0.8)
            bool inputs:geometry_thin_walled = 1
            token outputs:surface
        }
    }"""
    return write_stage(
        folder / "shade.usda",
        camera((0, 0, 6), (0, 0, 0), half=0.25),
        wall,
        sphere("Shade", "M", (0, 0, 0), 1.0, rings=8, smooth=True),
        light("Sphere", colour=(20, 20, 20), radius=0.5),
        *prims,
    )


@pytest.mark.parametrize("weights", ["power", "calibrated"])
def test_a_light_below_a_surface_is_the_walks_to_find(weights: str) -> None:
    """The light is 100 mean free paths deep, so no light leaves, however lights are selected."""
    stage = wavecomb.load(CASES / "light_in_subsurface.usda")
    found = mean(stage, spp=32, middle=True, light_weights=weights)
    assert found == pytest.approx(0.0, abs=1e-3)


@pytest.mark.slow
def test_guided_bounces_by_cosine() -> None:
    """Guiding is mixed with the density that samples bounces; a fault once lost 15 % of light."""
    stage = wavecomb.load(CASES / "glossy_box.usda")
    settings = {"spp": 128, "max_depth": 4, "cosine_sampling": True}
    guided = seeds(stage, 4, guiding="on", **settings)
    assert guided.mean() == pytest.approx(seeds(stage, 4, **settings).mean(), rel=0.02)


@pytest.mark.parametrize("transport", ["light", "bdpt", "auto"])
def test_depth_0_has_no_scattered_light(transport: str) -> None:
    stage = wavecomb.load(CASES / "ball_and_glass.usda")
    path = wavecomb.render(stage, size=(32, 32), spp=4, max_depth=0)
    other = wavecomb.render(stage, size=(32, 32), spp=4, max_depth=0, transport=transport)
    assert np.array_equal(path.beauty, other.beauty)


def test_light_paths_do_not_go_with_a_stone_in_tinted_glass() -> None:
    """Light paths would attenuate other segments than camera paths; `auto` uses camera paths."""
    stage = wavecomb.load(CASES / "stone_in_glass.usda")
    with pytest.raises(_core.Error, match="objects inside of absorbing glass"):
        mean(stage, spp=1, transport="light")
    assert mean(stage, spp=16, transport="auto") == mean(stage, spp=16, transport="path")
