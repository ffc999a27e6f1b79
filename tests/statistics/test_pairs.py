# SPDX-License-Identifier: Apache-2.0
"""Tests random stages with pairs of settings that must agree in expectation (pairs.py)."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from naive import Comparison, judge
from pairs import (
    MORE,
    PLAIN,
    SINGLE,
    Renders,
    Result,
    Variant,
    examine,
    is_open,
    most_undecided,
    variants,
)
from parts import needs
from random_enclosures import KINDS
from random_scenes import make_scene

from wavecomb import _core

pytestmark = needs("wavecomb._core")

FEW = (1, 4, 12, 22, 27, 38, 105, 342)
"""Seeds for `make test`: some that revealed faults (docs/testing.md), and three of other kinds."""
MANY = 500
REFUSED = "does not go with"


UNDECIDED: dict[int, str] = {}
"""Stages of `make test-long` with undecided comparisons, and these comparisons."""


def words_of(results: list[Result]) -> str:
    return "; ".join(f"{result.variant.name}: {result.found}" for result in results)


def check(seed: int, folder: Path, stages: int) -> str:
    """Fails where settings disagree; returns the comparisons that are undecided."""
    scene = make_scene(seed, folder, enclosure=True)
    tests = stages * (len(SINGLE) + 2)
    results = list(examine(scene, seed, tests=tests))
    faults = [r for r in results if r.is_fault(tests)]
    for result in results:
        assert result.found is not None or REFUSED in result.refusal
    words = words_of(faults)
    assert not faults, (
        f"stage {seed}: {words}; {', '.join(scene.features)}; depth {scene.depth}; look at it: "
        f".venv/bin/python tests/statistics/pairs.py {seed}"
    )
    return words_of([r for r in results if r.is_undecided(tests)])


@pytest.mark.slow
@pytest.mark.parametrize("seed", FEW)
def test_settings_agree(seed: int, tmp_path: Path) -> None:
    assert not check(seed, tmp_path, len(FEW)), "undecided"


@pytest.mark.long
@pytest.mark.parametrize("seed", range(100, 100 + MANY))
def test_settings_agree_at_night(seed: int, tmp_path: Path) -> None:
    if undecided := check(seed, tmp_path, MANY):
        UNDECIDED[seed] = undecided


@pytest.mark.long
def test_few_stages_are_undecided_at_night() -> None:
    """This test runs after the tests of all stages, in the same process."""
    assert len(UNDECIDED) <= most_undecided(MANY), UNDECIDED


def test_stages_come_from_their_seeds_alone(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    one, two = (make_scene(7, tmp_path / name, enclosure=True) for name in ("a", "b"))
    assert one.stage.read_bytes() == two.stage.read_bytes()
    assert (one.features, one.depth) == (two.features, two.depth)


@pytest.mark.slow
def test_every_enclosure_is_among_the_stages(tmp_path: Path) -> None:
    counts: Counter[str] = Counter()
    for seed in range(240):
        (folder := tmp_path / str(seed)).mkdir()
        scene = make_scene(seed, folder, enclosure=True)
        counts.update({*scene.features, f"depth {scene.depth}"})
        counts["single light"] += scene.single_light
    for feature in (
        *KINDS, "smooth shell", "faceted shell", "box shell", "thin transmission", "rough glass",
        "smooth glass", "emissive ball inside", "body inside", "no other light", "light tangent",
        "light sunk", "light edge", "light close", "light cut", "sphere light inside",
        "rect light inside", "disk light inside", "cylinder light inside", "single light",
        "depth 0", "depth 1", "depth 2", "depth 3", "depth 6",
    ):  # fmt: skip
        assert counts[feature] >= 1, feature


def test_every_choice_is_among_the_variants(tmp_path: Path) -> None:
    """For each setting that must not change the mean, a variant uses a non-plain value."""
    scene = make_scene(0, tmp_path, enclosure=True)
    met: dict[str, set[Any]] = {}
    for seed in range(40):
        for variant in variants(scene, seed):
            for name, value in variant.settings.items():
                met.setdefault(name, {PLAIN.get(name)}).add(value)
    assert met["transport"] == {"path", "light", "bdpt"}
    assert met["roulette"] == {"off", "throughput", "cost-aware", "efficient"}
    assert met["light_selection"] == {"auto", "tree", "power"}
    assert met["light_weights"] == {"calibrated", "power"}
    assert met["guiding"] == {"off", "on"} and met["cosine_sampling"] == {False, True}
    assert met["sampler"] == {"sobol", "independent"} and met["light_aim"] == {None, "on", "off"}


def test_light_that_is_lost_is_a_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A variant that is 5 % too dark is detected at once; a variant with an equal mean passes."""
    true = Renders.batches

    def darker(self: Renders, variant: Variant, more: int, first: int) -> Any:
        dark = variant.name == "cosine"
        return true(self, variant, 1, first) * np.float64(0.95 if dark else 1.0)

    monkeypatch.setattr(Renders, "batches", darker)
    monkeypatch.setattr("pairs.SINGLE", {name: SINGLE[name] for name in ("cosine", "power")})
    scene = make_scene(4, tmp_path, enclosure=True)
    found: dict[str, Result] = {r.variant.name: r for r in examine(scene, 4)}
    assert found["cosine"].is_fault(MANY * 12) and found["cosine"].tries == 3
    assert not found["power"].is_fault(MANY * 12)


def test_what_is_refused_is_no_fault(tmp_path: Path) -> None:
    scene = make_scene(38, tmp_path, enclosure=True)
    assert "lit subsurface" in scene.features
    renders = Renders(scene)
    with pytest.raises(_core.Error, match=REFUSED):
        renders.compare(Variant("light", SINGLE["light"], {}), 0)
    assert not Result(Variant("light", SINGLE["light"], {}), None, REFUSED).is_fault(1)


SHAPE = (10, 12, 12, 3)
"""Ten batches of images of 12 x 12 pixels."""


def flat(mean: float, seed: int) -> Any:
    """Batches with normal noise of 5 %."""
    return mean * (1 + 0.05 * np.random.default_rng(seed).standard_normal(SHAPE))


def sparse(mean: float, seed: int, paths: float) -> Any:
    """Batches in which all light comes from ``paths`` equal paths per pixel, on average.

    The paths are ten times as rare in the left third of the image, as behind a small opening.
    """
    expected = np.full(SHAPE[1:3], paths / SHAPE[0])
    expected[:, :4] /= 10
    counts = np.random.default_rng(seed).poisson(expected, SHAPE[:3])
    return np.repeat((mean * counts * (SHAPE[0] / paths))[..., None], 3, axis=3)


def dimmed(image: Any) -> Any:
    """The expected image, whose left third has a tenth of the light."""
    image[:, :, :4] /= 10
    return image


def test_rare_paths_are_open_and_no_fault() -> None:
    """With 0.2 to 3 expected paths per block, no difference counts as a sure fault."""
    open_ones = 0
    for seed in range(40):
        for paths in (0.2, 0.8, 2.0):
            found = judge(dimmed(flat(1.0, seed)), sparse(1.0, seed, paths))
            assert not found.is_sure(MANY * 12), (seed, paths)
            open_ones += is_open(found, MANY * 12)
    assert open_ones > 20


def test_equal_sparse_images_agree() -> None:
    for seed in range(40):
        for paths in (0.2, 2.0, 20.0):
            found = judge(sparse(1.0, seed, paths), sparse(1.0, 1000 + seed, paths))
            assert not found.is_sure(MANY * 12)


@pytest.mark.parametrize("paths", [0.2, 2.0, 20.0])
def test_a_difference_is_found_once_paths_suffice(paths: float) -> None:
    """Missing half of the light is certainly a fault if a block of 16 pixels expects 50 paths."""
    found = judge(flat(0.5, 1), sparse(1.0, 2, paths) + flat(1e-3, 3))
    assert found.is_sure(MANY * 12) == (paths > 4), found.events.max()


@pytest.mark.parametrize("excess", [0.02, 0.05, 1.0])
def test_a_difference_of_normal_noise_is_a_fault(excess: float) -> None:
    found = judge(flat(1.0 + excess, 1), flat(1.0, 2))
    assert found.is_sure(MANY * 12) and not is_open(found, MANY * 12)


def test_a_difference_without_noise_is_a_fault() -> None:
    assert judge(np.full(SHAPE, 1.01), np.ones(SHAPE)).is_sure(MANY * 12)


def test_contributions_of_earlier_comparisons_count() -> None:
    """A bright path that an earlier comparison found may be missing from both renders."""
    found = judge(flat(1.02, 1), flat(1.0, 2), samples=64)
    assert found.is_sure(MANY * 12)
    assert np.all(found.contribution < 64 * 0.05)
    again = judge(flat(1.02, 1), flat(1.0, 2), samples=64, contribution=1e4)
    assert is_open(again, MANY * 12) and np.all(again.contribution == 1e4)


def test_what_is_open_is_repeated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Undecided comparisons get a last turn, after which they are decided or stay undecided."""
    turns: list[tuple[str, int]] = []

    def compare(self: Renders, variant: Variant, turn: int, contribution: Any = 0.0) -> Comparison:
        turns.append((variant.name, turn))
        if variant.name == "cosine" or (variant.name == "power" and turn <= len(MORE)):
            return judge(dimmed(flat(1.0, 1)), sparse(1.0, 1, 0.2))
        if variant.name == "roulette":
            return judge(flat(1.1, 1), flat(1.0, 2))
        return judge(flat(1.0, 1), flat(1.0, 2))

    monkeypatch.setattr(Renders, "compare", compare)
    monkeypatch.setattr(Renders, "sees_lights", lambda self: True)
    monkeypatch.setattr(
        "pairs.SINGLE", {name: SINGLE[name] for name in ("cosine", "power", "roulette", "light")}
    )
    scene = make_scene(4, tmp_path, enclosure=True)
    found = {r.variant.name: r for r in examine(scene, 4, tests=MANY * 12)}
    last = {name: max(t for n, t in turns if n == name) for name, _ in turns}
    assert last["cosine"] == last["power"] == len(MORE) + 1
    assert last["roulette"] == len(MORE) and last["light"] == 0
    assert found["cosine"].is_undecided(MANY * 12) and not found["cosine"].is_fault(MANY * 12)
    assert not found["power"].is_undecided(MANY * 12)
    assert found["roulette"].is_fault(MANY * 12) and not found["roulette"].is_undecided(MANY * 12)


def test_few_stages_may_be_undecided() -> None:
    assert [most_undecided(n) for n in (1, 100, 500)] == [1, 1, 5]
