# SPDX-License-Identifier: Apache-2.0
"""Tests shadow colours of lights that are seen through volumes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from parts import needs
from test_interiors import SIGMA, seen_from_above, slab
from test_walks import box

import wavecomb

pytestmark = needs("wavecomb._core")


def lit(has_smoke: bool, is_blocked: bool, **more: Any) -> Any:
    """Renders a floor under a light with a blue shadow colour, with smoke or an occluder."""
    builder = wavecomb.SceneBuilder()
    grey = builder.add_material("diffuse", base_color=(0.5, 0.5, 0.5))
    slab(builder, -1.0, 0.0, grey)
    if is_blocked:
        box(builder, (-3, -3, 8.0), (3, 3, 8.1), grey)
    if has_smoke:
        bounds = ((-3, -3, 6.0), (3, 3, 7.0))
        builder.add_volume(np.eye(4), bounds=bounds, extinction=tuple(SIGMA), albedo=(0, 0, 0))
    builder.add_light(
        "distant", np.eye(4), color=(1, 1, 1), angle=0.0, shadow_color=(0.1, 0.2, 0.6)
    )
    return seen_from_above(builder, depth=1, **more)


@pytest.mark.parametrize("integrator", ["wavefront", "reference"])
def test_a_coloured_shadow_has_come_through_smoke(integrator: str) -> None:
    """The smoke attenuates the shadow colour."""
    pixels = {
        (has_smoke, is_blocked): lit(has_smoke, is_blocked, integrator=integrator)
        for has_smoke in (False, True)
        for is_blocked in (False, True)
    }
    through = np.exp(-SIGMA)
    assert np.all(pixels[False, True] > 0)
    for is_blocked in (False, True):
        ratio = pixels[True, is_blocked] / pixels[False, is_blocked]
        assert np.allclose(ratio, through, rtol=1e-3)
