# SPDX-License-Identifier: Apache-2.0
"""Tests AOVs and adaptive renders with light paths against camera paths only."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from agreement import assert_agree

import wavecomb

EXPRESSIONS = {
    "caustics": "CD[GS]+L",
    "bounced": "CD.*D.*[LO]",
    "gloss": "C[GS].*",
    "last": "C.*G[LO]",
}
SEEDS = 10
PLAIN: dict[str, Any] = {
    "filter": "box",
    "filter_width": 1.0,
    "sampler": "independent",
    "max_depth": 5,
}
ENDINGS: list[dict[str, Any]] = [
    {"adaptive": 0.1, "spp": 64},
    {"noise": 0.1, "spp": 64},
    {"allocate": "error", "spp": 32},
]


@pytest.fixture(scope="module")
def wide(caustics: Path, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The caustics stage under a light of 25 times the radius, which camera paths can find."""
    from pxr import Sdf, Usd, UsdLux

    stage = Usd.Stage.Open(str(caustics))
    lamp = UsdLux.SphereLight.Get(stage, "/World/Lights/Lamp")
    lamp.GetRadiusAttr().Set(25 * lamp.GetRadiusAttr().Get())
    lamp.GetIntensityAttr().Set(0.0016 * lamp.GetIntensityAttr().Get())
    kind = Sdf.ValueTypeNames.String
    lamp.GetPrim().CreateAttribute("primvars:wavecomb:lightGroup", kind).Set("key")
    fill = UsdLux.DistantLight.Define(stage, "/World/Lights/Fill")
    fill.CreateAngleAttr(20.0)
    fill.CreateIntensityAttr(6.0)
    fill.CreateColorAttr((0.6, 0.8, 1.0))
    path = tmp_path_factory.mktemp("layers") / "wide.usdc"
    stage.Export(str(path))
    return wavecomb.load(path)


@pytest.mark.parametrize("transport", ["light", "bdpt"])
def test_layers_agree_with_those_of_camera_paths(wide: Any, transport: str) -> None:
    aovs = ["direct", "indirect", "light_groups"]
    aovs += [f"lpe:{name}={text}" for name, text in EXPRESSIONS.items()]

    def render(seed: int, spp: int, **settings: Any) -> dict[str, Any]:
        return wavecomb.render(
            wide, size=(16, 16), spp=spp, seed=seed, aovs=aovs, **PLAIN, **settings
        ).aovs

    joined = [render(seed, 12, transport=transport) for seed in range(SEEDS)]
    alone = [render(500 + seed, 48) for seed in range(SEEDS)]
    for name in joined[0]:
        a, b = (
            np.stack([one[name] for one in all_]).astype(np.float64) for all_ in (joined, alone)
        )
        assert b.max() > 0
        assert_agree(f"{transport} {name}", a, b)


@pytest.mark.slow
@pytest.mark.parametrize("transport", ["light", "bdpt"])
@pytest.mark.parametrize("ending", ENDINGS, ids=lambda e: next(iter(e)))
def test_samples_that_go_where_the_noise_is(
    wide: Any, ending: dict[str, Any], transport: str
) -> None:
    def render(seed: int, **settings: Any) -> wavecomb.Picture:
        return wavecomb.render(wide, size=(16, 16), seed=seed, **PLAIN, **settings)

    found = [render(seed, transport=transport, **ending) for seed in range(SEEDS)]
    assert all(one.samples.min() < one.samples.max() for one in found), "or it would show nothing"
    alone = [render(500 + seed, spp=96) for seed in range(SEEDS)]
    a, b = (np.stack([one.beauty for one in all_]).astype(np.float64) for all_ in (found, alone))
    # A pixel that stops early because its error seems small has a mean that is slightly too dark.
    assert_agree(f"{transport} {next(iter(ending))}", a, b, tolerance=0.01)
