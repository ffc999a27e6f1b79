# SPDX-License-Identifier: Apache-2.0
"""Tests random scenes against an integrator that shares no sampling code (naive.py)."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from naive import Comparison, compare, examine, judge, limit, naive_module
from random_scenes import make_scene
from stages import camera, ground, light, material, moved, quad, turned, write_stage

FEW, MANY = 30, 500
"""Number of scenes in `make test` and in `make test-long`."""
TELLING = (460,)
"""Further seeds for `make test`, which revealed faults: open panes of absorbing glass."""


@pytest.fixture(scope="module", autouse=True)
def module() -> Any:
    try:
        return naive_module()
    except ImportError as error:
        pytest.skip(f"needs the naive integrator: {error}")


def agrees(seed: int, folder: Path, scenes: int) -> None:
    scene = make_scene(seed, folder)
    found = examine(scene)
    print(f"{seed}: {found}: {', '.join(scene.features)}")
    assert not found.is_fault(scenes), (
        f"scene {seed}: {found}; {', '.join(scene.features)}; depth {scene.depth}; look at it: "
        f".venv/bin/python tests/statistics/naive.py {seed}"
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", [*range(FEW), *TELLING])
def test_features_that_meet(seed: int, tmp_path: Path) -> None:
    agrees(seed, tmp_path, FEW)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(FEW, FEW + MANY))
def test_features_that_meet_at_night(seed: int, tmp_path: Path) -> None:
    agrees(seed, tmp_path, MANY)


def test_scenes_come_from_their_seeds_alone(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    one, two = (make_scene(3, tmp_path / name) for name in ("a", "b"))
    assert one.stage.read_bytes() == two.stage.read_bytes()
    assert (one.features, one.settings) == (two.features, two.settings)


def test_everything_is_among_the_scenes(tmp_path: Path) -> None:
    counts: Counter[str] = Counter()
    for seed in range(FEW):
        (folder := tmp_path / str(seed)).mkdir()
        counts.update(set(make_scene(seed, folder).features))
    for feature in (
        "diffuse", "metal", "dielectric", "plastic", "principled", "openpbr", "presence",
        "transparent", "transparency texture", "threshold", "opacity texture",
        "glow that is cut out", "glow texture", "textured",
        "portal", "instances", "moving", "cage", "lightLink", "shadowLink", "multipliers",
        "meshlight light", "rect light", "disk light", "sphere light", "cylinder light",
        "distant light", "dome light", "cosine sampling", "hidden lights", "lens",
        "hidden from the camera",
    ):  # fmt: skip
        assert counts[feature] >= 1, feature
    assert counts["glow that is cut out"] >= 3, "the fault that began this"


def test_the_referee(module: Any) -> None:
    """Equal means pass, a difference of 2 % fails; images without noise must be equal."""
    rng = np.random.default_rng(1)

    def noisy(mean: float) -> Any:
        return mean * (1 + 0.05 * rng.standard_normal((10, 12, 12, 3)))

    assert not judge(noisy(1.0), noisy(1.0)).is_fault(MANY)
    assert judge(noisy(1.02), noisy(1.0)).is_fault(MANY)
    flat = np.ones((10, 12, 12, 3))
    assert not judge(flat, flat).is_fault(MANY)
    assert judge(flat, flat * 1.01).is_fault(MANY)
    assert limit(30) == pytest.approx(3.587, abs=1e-3)


def lit(module: Any, folder: Path, *prims: str, **changes: Any) -> float:
    """Irradiance at the centre of a floor, by the naive integrator."""
    import wavecomb

    floor = material("M", "diffuse", diffuseColor=(0.5, 0.5, 0.5)) + "\n" + ground("M", 20)
    view = camera((4, 2, 0.5), (0, 0, 0), half=1e-3)
    loaded = wavecomb.load(write_stage(folder / "stage.usda", view, floor, *prims))
    settings = {
        "width": 16, "height": 16, "samples": 64, "max_depth": 1, "directions": 16,
        "delta_tries": 0, "seed": 1, "schlick_fresnel": False,
    }  # fmt: skip
    return float(module.render(loaded.scene, **(settings | changes)).mean()) * np.pi / 0.5


DOWN = turned(x=-90)


@pytest.mark.slow
def test_the_naive_integrator_is_right(module: Any, tmp_path: Path) -> None:
    """Irradiance from a dome, a disk overhead, a sphere, a point and a distant light."""
    shots = {
        light("Dome"): np.pi,
        light("Disk", transform=DOWN @ moved(0, 1, 0), radius=1): np.pi / 2,
        light("Sphere", transform=moved(0, 2, 0), radius=1): np.pi / 4,
        light("Disk", transform=DOWN @ moved(0, 1, 0), radius=1, diffuse=2): np.pi,
        light("Distant", transform=DOWN, angle=0): None,
    }
    for text, expected in shots.items():
        found = lit(module, tmp_path, text)
        if expected is None:
            import wavecomb

            stage = wavecomb.load(tmp_path / "stage.usda")
            ours = wavecomb.render(stage, size=(16, 16), spp=4, max_depth=1)
            expected = float(ours.beauty.mean()) * np.pi / 0.5
            assert found == pytest.approx(expected, rel=1e-4) and found > 0
        else:
            assert found == pytest.approx(expected, rel=0.015), text


@pytest.mark.parametrize("opacity", [0.5, 0.0])
def test_glow_that_is_cut_out(module: Any, tmp_path: Path, opacity: float) -> None:
    """Closed form: half of an emissive square gives half of the whole square's light."""
    corners = [(-1, 1, 1), (1, 1, 1), (1, 1, -1), (-1, 1, -1)]
    cut = material("G", "principled", emissiveColor=(1, 1, 1), diffuseColor=(0, 0, 0), opacity=1)
    whole = lit(module, tmp_path, cut, quad("Square", corners, "G"))
    mode = 'float inputs:opacity = {}\ntoken inputs:opacityMode = "presence"'
    part = cut.replace("float inputs:opacity = 1", mode.format(opacity))
    assert lit(module, tmp_path, part, quad("Square", corners, "G")) == pytest.approx(
        opacity * whole, rel=0.02, abs=1e-6
    )


@pytest.mark.slow
def test_comparison_reads_well(module: Any, tmp_path: Path) -> None:
    found = compare(make_scene(0, tmp_path))
    assert isinstance(found, Comparison)
    assert found.ours.shape == found.naive.shape == (10, 12, 12, 3)
    assert "largest |z|" in str(found)
