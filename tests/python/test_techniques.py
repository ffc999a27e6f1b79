# SPDX-License-Identifier: Apache-2.0
"""Tests layers that split the beauty by technique: bounces, light samples, light paths."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wavecomb

pytest.importorskip("wavecomb._core")

SIZE = 32


def render(stage: Any, **settings: Any) -> wavecomb.Picture:
    plain: dict[str, Any] = {"size": (SIZE, SIZE), "spp": 64, "transport": "light"}
    return wavecomb.render(stage, **(plain | settings))


@pytest.mark.slow
def test_techniques_add_up_to_the_beauty(caustics: Path) -> None:
    stage = wavecomb.load(caustics)
    plain = render(stage)
    assert plain.stats["transport"] is None
    asked = render(stage, aovs=("techniques",))
    assert asked.beauty.tobytes() == plain.beauty.tobytes()
    parts = [asked.aovs[f"by_{name}"] for name in ("bounces", "light_samples", "light_paths")]
    np.testing.assert_allclose(sum(parts), asked.beauty, rtol=1e-5, atol=1e-6)
    assert all(part.max() > 0 for part in parts)
    for way in ({"lanes": 1, "wave_size": 64}, {"integrator": "reference"}, {"threads": 1}):
        other = render(stage, aovs=("techniques",), **way)
        for name, layer in asked.aovs.items():
            assert layer.tobytes() == other.aovs[name].tobytes(), (name, way)
    path = render(stage, aovs=("techniques",), transport="path")
    assert not path.aovs["by_light_paths"].any()
    both = path.aovs["by_bounces"] + path.aovs["by_light_samples"]
    np.testing.assert_allclose(both, path.beauty, rtol=1e-5, atol=1e-6)
    direct = render(stage, aovs=("by_light_samples",), transport="path")
    assert direct.aovs["by_light_samples"].tobytes() == path.aovs["by_light_samples"].tobytes()
