# SPDX-License-Identifier: Apache-2.0
"""Tests that learning changes noise but not the mean: each learned part, and all together.

Each stage is rendered with many seeds for each setting. Tiles of the image are compared by Welch's
t, at a level that is Sidak's correction of 1 % over all stages, settings, tiles and channels of the
long run. Skewed noise from rare bright paths inflates t, so a significant difference is tested
again with new seeds, twice as many. A difference counts only if the second test finds it with the
same sign, as with a bias.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from parts import asset, needs, written_scenes
from scipy import stats

pytestmark = needs("wavecomb._core")

OFF: dict[str, Any] = {
    "light_weights": "power",
    "light_selection": "power",
    "shadow_roulette": "off",
    "allocate": "even",
    "roulette": "off",
    "guiding": "off",
}
PARTS: dict[str, dict[str, Any]] = {
    "lights": {
        "light_weights": "calibrated",
        "light_selection": "auto",
        "shadow_roulette": "on",
        "roulette": "throughput",
    },
    "pixels by error": {"allocate": "error"},
    "pixels by efficiency": {"allocate": "efficiency"},
    "roulette": {"roulette": "efficient"},
    "guiding": {"guiding": "on"},
}
ALL: dict[str, Any] = {
    "light_weights": "calibrated",
    "light_selection": "auto",
    "shadow_roulette": "on",
    "allocate": "efficiency",
    "roulette": "efficient",
    "guiding": "on",
}
WAYS = {**PARTS, "all": ALL}
PUBLIC = (
    "StandardShaderBall/standard_shader_ball_scene.usda",
    "SubdivisionSurfaces/Creases_SpinningPyramids.usda",
    "Teapot/Teapot.usd",
    "cornell-box/display-color/cornell-box.usda",
    "cornell-box/mtlx-usdshade/cornell-box.usda",
    "cornell-box/usdpreviewsurface/cornell-box.usda",
    "kaolin/amsterdam.usda",
    "kaolin/avocado.usda",
    "meshes/armadillo.usdc",
    "openusd/Block/Block.usda",
    "openusd/teapot/teapot.usda",
    "openusd/testUsdImagingGLDomeLight/sphereGrid.usda",
    "openusd/testUsdImagingGLDomeLight/multiDomeLights.usda",
    "openusd/testUsdImagingGLInstancing/instance.usda",
    "openusd/testUsdImagingGLPointInstancer/pi.usda",
    "usdlux/cylinder.usda",
    "usdlux/iesTest.usda",
    "usdlux/rect.usda",
    "usdlux/sphere.usda",
    "wg_test_assets/RoughnessTest/RoughnessTest.usdz",
)
"""Third-party stages with all kinds of lights and materials."""

SIZE = (64, 48)
SPP = 48
"""Training uses an eighth of the samples, 18,432 paths; the minimum is 16,384."""
SEEDS = 10
TILES = (3, 4)
GENERATED = 23
TESTS = (GENERATED + len(PUBLIC)) * len(WAYS) * TILES[0] * TILES[1] * 3
LEVEL = 1.0 - (1.0 - 0.01) ** (1.0 / TESTS)
AGAIN = 0.01
"""Significance level of the second test."""

FAST = ("cornell", "studio")
Array = NDArray[np.float64]


def tiles(scene: Any, way: dict[str, Any], seeds: range) -> Array:
    """Means of image tiles for each seed, (seeds, 3, 4, 3)."""
    import wavecomb

    rows, columns = TILES
    settings: dict[str, Any] = {
        **{"size": SIZE, "spp": SPP, "filter": "box", "max_depth": 5, "clamp_indirect": 0.0},
        **{"threads": 2, **OFF, **way},
    }
    pictures = [wavecomb.render(scene, seed=seed, **settings).beauty for seed in seeds]
    cut = np.array(pictures, np.float64).reshape(
        len(seeds), rows, SIZE[1] // rows, columns, SIZE[0] // columns, 3
    )
    return cut.mean(axis=(2, 4))


def deviates(a: Array, b: Array) -> tuple[Array, Array]:
    """p-values of two-sided Welch tests (1 where there is no noise), and signs of the differences.

    Tiles without noise must be equal up to float rounding.
    """
    va, vb = a.var(axis=0, ddof=1) / len(a), b.var(axis=0, ddof=1) / len(b)
    difference = a.mean(axis=0) - b.mean(axis=0)
    level = np.maximum(np.maximum(np.abs(a), np.abs(b).max(axis=0)).max(axis=0), 1e-6)
    noisy = va + vb > (1e-6 * level) ** 2
    error2 = np.where(noisy, va + vb, 1.0)
    freedom = error2**2 / np.maximum(va**2 / (len(a) - 1) + vb**2 / (len(b) - 1), 1e-300)
    t = np.abs(difference) / np.sqrt(error2)
    p = 2.0 * stats.t.sf(t, np.where(noisy, freedom, 10.0))
    quiet = np.where(np.abs(difference) < 1e-4 * level, 1.0, 0.0)
    return np.where(noisy, p, quiet), np.sign(difference)


def differences(scene: Any, ways: dict[str, dict[str, Any]], number: int) -> list[str]:
    """Differences from rendering without learning, one line each; prints the smallest p per
    setting.

    Args:
        scene: The scene to render.
        ways: Settings by name.
        number: Index of the stage, which determines the seeds.
    """
    first = 100_000 * (number + 1)
    off = tiles(scene, {}, range(first, first + SEEDS))
    off_again: Array | None = None
    found = []
    for k, (name, way) in enumerate(ways.items(), start=1):
        begin = first + 1000 * k
        p, sign = deviates(tiles(scene, way, range(begin, begin + SEEDS)), off)
        least = float(p.min())
        text = f"{name}: least p {least:.1e} of {p.size}"
        suspects = p < LEVEL
        if suspects.any():
            if off_again is None:
                off_again = tiles(scene, {}, range(first + 500, first + 500 + 2 * SEEDS))
            second = tiles(scene, way, range(begin + 500, begin + 500 + 2 * SEEDS))
            p2, sign2 = deviates(second, off_again)
            level = 1.0 - (1.0 - AGAIN) ** (1.0 / suspects.sum())
            again = suspects & (p2 < level) & (sign == sign2)
            text += f", {suspects.sum()} looked at again: least p {p2[suspects].min():.1e}"
            if again.any():
                found.append(text)
        print(text)
    return found


def check(name: str, path: Path, ways: dict[str, dict[str, Any]], number: int) -> None:
    import wavecomb

    print(name)
    found = differences(wavecomb.load(path), ways, number)
    assert not found, f"{name}: " + "; ".join(found)


@pytest.fixture
def write(tmp_path: Path) -> Any:
    """Function that writes a small generated stage."""

    def stage(name: str) -> Path:
        from wavecomb.scenes import write_scene

        path = tmp_path / f"{name}.usdc"
        write_scene(
            name, path, triangles=10_000, teapot_level=6, texture_size=128, lights=200, voxels=32
        )
        return path

    return stage


@pytest.mark.slow
@pytest.mark.parametrize("name", FAST)
def test_all_together(name: str, write: Any) -> None:
    check(name, write(name), {"all": ALL}, 900 + FAST.index(name))


def test_there_are_as_many_stages_as_the_level_is_for() -> None:
    from wavecomb.scenes import SCENES

    assert len(SCENES) == GENERATED
    assert len(PUBLIC) == 20


@pytest.mark.long
@pytest.mark.parametrize("number", range(GENERATED))
def test_each_part_on_a_generated_stage(number: int, write: Any) -> None:
    from wavecomb.scenes import SCENES

    name = sorted(SCENES)[number]
    if name not in written_scenes():
        pytest.skip(f"{name} needs OpenVDB")
    check(name, write(name), WAYS, number)


@pytest.mark.long
@pytest.mark.parametrize("number", range(len(PUBLIC)))
def test_each_part_on_a_public_stage(number: int) -> None:
    name = PUBLIC[number]
    check(name, asset(f"usd/{name}"), WAYS, GENERATED + number)
