# SPDX-License-Identifier: Apache-2.0
"""Layers of renders where paths start at the lights, too, against those of camera paths alone."""

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


@pytest.fixture(scope="module")
def wide(caustics: Path, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The stage of caustics under a lamp of 25 times the radius, which camera paths find."""
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
        plain = {"filter": "box", "filter_width": 1.0, "sampler": "independent", "max_depth": 5}
        return wavecomb.render(
            wide, size=(16, 16), spp=spp, seed=seed, aovs=aovs, **(plain | settings)
        ).aovs

    joined = [render(seed, 12, transport=transport) for seed in range(SEEDS)]
    alone = [render(500 + seed, 48) for seed in range(SEEDS)]
    for name in joined[0]:
        a, b = (
            np.stack([one[name] for one in all_]).astype(np.float64) for all_ in (joined, alone)
        )
        assert b.max() > 0
        assert_agree(f"{transport} {name}", a, b)
