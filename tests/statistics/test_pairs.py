# SPDX-License-Identifier: Apache-2.0
"""Random stages with all pairs of settings that must agree in expectation (pairs.py)."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pairs import PLAIN, SINGLE, Renders, Result, Variant, examine, variants
from parts import needs
from random_enclosures import KINDS
from random_scenes import make_scene

from wavecomb import _core

pytestmark = needs("wavecomb._core")

FEW = (1, 4, 12, 22, 27, 38, 105, 342)
"""Seeds for `make test`: some that revealed faults (docs/testing.md), and three of other kinds."""
MANY = 500
REFUSED = "does not go with"


def check(seed: int, folder: Path, stages: int) -> None:
    scene = make_scene(seed, folder, enclosure=True)
    results = list(examine(scene, seed))
    faults = [r for r in results if r.is_fault(stages * (len(SINGLE) + 2))]
    for result in results:
        assert result.found is not None or REFUSED in result.refusal
    words = "; ".join(f"{result.variant.name}: {result.found}" for result in faults)
    assert not faults, (
        f"stage {seed}: {words}; {', '.join(scene.features)}; depth {scene.depth}; look at it: "
        f".venv/bin/python tests/statistics/pairs.py {seed}"
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", FEW)
def test_settings_agree(seed: int, tmp_path: Path) -> None:
    check(seed, tmp_path, len(FEW))


@pytest.mark.long
@pytest.mark.parametrize("seed", range(100, 100 + MANY))
def test_settings_agree_at_night(seed: int, tmp_path: Path) -> None:
    check(seed, tmp_path, MANY)


def test_stages_come_from_their_seeds_alone(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    one, two = (make_scene(7, tmp_path / name, enclosure=True) for name in ("a", "b"))
    assert one.stage.read_bytes() == two.stage.read_bytes()
    assert (one.features, one.depth) == (two.features, two.depth)


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
    """Each setting that must not change the mean differs from its plain value in a variant."""
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
    """A variant that is 5 % too dark is detected at once; an equal one passes."""
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
