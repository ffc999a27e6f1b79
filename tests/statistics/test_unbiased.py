# SPDX-License-Identifier: Apache-2.0
"""Tests settings that must not change the mean: roulette, sampler, lobe sampling, filter."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from agreement import assert_agree, batches
from stages import camera, ground, light, look_at, material, quad, sphere, write_sky, write_stage

import wavecomb

_plain: dict[Any, Any] = {}
"""Cached images with plain settings, which several tests use as reference."""


@pytest.fixture(scope="module")
def cornell(generated: Any) -> Any:
    return wavecomb.load(generated("cornell"))


@pytest.fixture(scope="module")
def mixed(generated: Any) -> Any:
    return wavecomb.load(generated("mixed"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("roulette", {"roulette": "throughput", "roulette_depth": 1}),
        ("cost-aware roulette", {"roulette": "cost-aware", "costs": "model"}),
        ("late roulette", {"roulette": "throughput", "roulette_depth": 4}),
        ("sobol", {"sampler": "sobol"}),
        ("cosine", {"cosine_sampling": True}),
        ("textures", {"texture_filter": "whole"}),
    ],
)
@pytest.mark.parametrize("scene", ["cornell", "mixed"])
def test_same_mean(
    scene: str, name: str, settings: dict[str, Any], beauty: Any, request: Any, fewer: int
) -> None:
    """The scene `mixed` has smooth metal and glass, textures, and all shading programs."""
    stage = request.getfixturevalue(scene)
    plain: dict[str, Any] = {"max_depth": 8}
    if scene == "mixed":
        # With cosine sampling, one sample in thousands hits the narrow lobe's reflection of another
        # object, which takes too long here. Direct light, which light samples find too, is
        # sufficient.
        plain["max_depth"] = 1 if name == "cosine" else 4
    size, spp = 64 if fewer == 1 else 48, 64 // fewer
    a = batches(lambda seed: beauty(stage, size, spp, seed=seed, **plain, **settings), 12)
    key = scene, plain["max_depth"], spp
    if key not in _plain:
        _plain[key] = batches(
            lambda seed: beauty(stage, size, spp, seed=seed, **plain), 12, first_seed=500
        )
    assert_agree(f"{scene} {name}", a, _plain[key])


@pytest.mark.slow
@pytest.mark.parametrize("sampler", ["independent", "sobol"])
def test_seeds_are_independent(cornell: Any, beauty: Any, sampler: str) -> None:
    """The mean of four renders has a quarter of the variance of one (measured: 4.03 and 4.00)."""
    pictures = batches(
        lambda seed: beauty(cornell, 48, 8, seed=seed, max_depth=4, sampler=sampler), 64
    )
    single = pictures.var(axis=0, ddof=1)
    fours = pictures.reshape(16, 4, *pictures.shape[1:]).mean(axis=1).var(axis=0, ddof=1)
    noisy = single > 1e-8 * pictures.mean() ** 2
    assert 1.0 / np.mean(fours[noisy] / single[noisy]) == pytest.approx(4.0, rel=0.06)


def rel_mse(picture: Any, reference: Any) -> float:
    """Errors exclude the worst 1 % of pixels, at the edge of the light, as benchmarks do."""
    error = ((picture - reference) ** 2 / (reference**2 + 0.01)).mean(axis=2).ravel()
    return float(np.sort(error)[: -error.size // 100].mean())


@pytest.mark.slow
def test_owen_sobol_converges_faster(cornell: Any, beauty: Any, fewer: int) -> None:
    """Independent sampling has 1.3 times the error of Sobol at 16 samples, and 1.9 times at 256.

    The measured ratios at 8 bounces are 1.6 and 2.4. With direct light only, the ratios are 4.4 and
    7.0.
    """
    reference = beauty(cornell, 32, 8192 // fewer, seed=900, sampler="sobol")
    gain = {}
    for spp, count in ((16, 16), (256, 4)):
        errors = {
            kind: np.mean(
                [
                    rel_mse(beauty(cornell, 32, spp, seed=k, sampler=kind), reference)
                    for k in range(count)
                ]
            )
            for kind in ("independent", "sobol")
        }
        gain[spp] = errors["independent"] / errors["sobol"]
    print("error of independent over that of Sobol:", gain)
    assert gain[16] > 1.3
    assert gain[256] > 1.9


@pytest.mark.parametrize(
    ("kind", "width"),
    [
        ("box", 1.0),
        ("box", 3.0),
        ("gaussian", 3.0),
        ("blackman-harris", 3.0),
        ("blackman-harris", 4.0),
    ],
)
def test_filters_keep_energy(tmp_path: Path, kind: str, width: float) -> None:
    """The total light of a bright square on black does not depend on the filter."""
    lamp = material("L", "emissive", emissiveColor=(4, 2, 8))
    corners = [(-0.3, -0.2, 0), (0.25, -0.2, 0), (0.25, 0.35, 0), (-0.3, 0.35, 0)]
    view = camera((0, 0, 5), (0, 0, 0), half=0.2)
    stage = write_stage(tmp_path / "s.usda", view, lamp, quad("Q", corners, "L"))
    picture = wavecomb.render(stage, size=(32, 32), spp=1024, filter=kind, filter_width=width)
    total = picture.beauty.mean(axis=(0, 1))
    expected = np.array((4, 2, 8)) * 0.55 * 0.55 / 4.0
    assert np.abs(total / expected - 1.0).max() < 5e-3
    assert (picture.samples == 1024).all()


@pytest.mark.parametrize("kind", ["box", "gaussian", "blackman-harris"])
def test_filters_keep_a_flat_field(tmp_path: Path, kind: str) -> None:
    stage = write_stage(tmp_path / "s.usda", camera((0, 0, 5), (0, 0, 0)), light("Dome"))
    picture = wavecomb.render(stage, size=(9, 9), spp=4, filter=kind)
    assert np.abs(picture.beauty - 1.0).max() < 1e-6


def test_clamping_only_takes_away(cornell: Any, beauty: Any) -> None:
    """Clamps indirect light only: one bounce is unchanged, more bounces get darker."""
    one = beauty(cornell, 32, 16, max_depth=1)
    assert np.array_equal(beauty(cornell, 32, 16, max_depth=1, clamp_indirect=0.05), one)
    more, clamped = (beauty(cornell, 32, 16, clamp_indirect=c) for c in (0.0, 0.05))
    assert (clamped <= more * (1.0 + 1e-5)).all()
    assert clamped.mean() < 0.97 * more.mean()


@pytest.mark.slow
def test_more_samples_extend_fewer(cornell: Any, beauty: Any) -> None:
    """Sample k does not depend on the count: the first 4 of 8 samples equal a 4-sample render.

    The noise of both renders has a correlation of sqrt(4 / 8), but 0 with another seed.
    """
    plain = {"sampler": "independent", "max_depth": 1}
    truth = beauty(cornell, 32, 2048, seed=50, **plain)
    four, eight, other = (
        np.asarray(beauty(cornell, 32, n, seed=s, **plain) - truth) / (truth + 0.05)
        for n, s in ((4, 0), (8, 0), (8, 1))
    )
    keep = (truth > 0.02) & (truth < 2.0)
    assert np.corrcoef(four[keep], eight[keep])[0, 1] == pytest.approx(np.sqrt(0.5), abs=0.12)
    assert abs(np.corrcoef(four[keep], other[keep])[0, 1]) < 0.12


@pytest.mark.slow
@pytest.mark.parametrize("bounces", [1, 3])
def test_cosine_beside_smooth_lobes(tmp_path: Path, beauty: Any, bounces: int, fewer: int) -> None:
    """Beside a diffuse lobe, cosine sampling accounts for the probability of a delta lobe."""
    coat = {"clearcoat": 1.0, "clearcoatRoughness": 0.0}
    prims = [
        light("Dome", texture=write_sky(tmp_path)),
        light(
            "Rect",
            "Lamp",
            colour=(8, 8, 8),
            transform=look_at((0, 4, 1), (0, 0, 0)),
            width=2,
            height=2,
        ),
        camera((0, 1.5, 5), (0, 0.5, 0)),
        material("P", "plastic", diffuseColor=(0.6, 0.5, 0.4), roughness=0.0),
        material("C", "principled", diffuseColor=(0.3, 0.5, 0.6), **coat),
        material("S", "principled", diffuseColor=(0.7, 0.2, 0.2), roughness=0.0, opacity=0.6),
        ground("P"),
        sphere("A", "C", (-0.8, 0.7, 0), 0.7),
        sphere("B", "S", (0.8, 0.7, 0), 0.7),
    ]
    loaded = wavecomb.load(write_stage(tmp_path / "s.usda", *prims))
    plain, spp = {"max_depth": bounces}, 64 // fewer
    a = batches(lambda s: beauty(loaded, 48, spp, seed=s, cosine_sampling=True, **plain), 12)
    b = batches(lambda s: beauty(loaded, 48, spp, seed=s, **plain), 12, first_seed=500)
    assert_agree(f"cosine beside smooth lobes {bounces}", a, b)


def test_light_by_either_technique(tmp_path: Path, beauty: Any) -> None:
    """Bounces by lobe sampling and by cosine sampling have consistent MIS weights with light
    samples.
    """
    sky = light("Dome", texture=write_sky(tmp_path))
    silver = material("M", "metal", diffuseColor=(1, 1, 1), roughness=0.0)
    grey = material("G", "diffuse", diffuseColor=(0.5, 0.5, 0.5))
    view = camera((0, 1.5, 5), (0, 0.5, 0))
    stage = write_stage(
        tmp_path / "s.usda", view, sky, silver, grey, ground("G"), sphere("B", "M", (0, 1, 0))
    )
    loaded = wavecomb.load(stage)
    a = batches(lambda s: beauty(loaded, 32, 64, seed=s, max_depth=3), 8)
    b = batches(lambda s: beauty(loaded, 32, 64, seed=s, max_depth=3, cosine_sampling=True), 8, 100)
    assert_agree("either technique", a, b)
