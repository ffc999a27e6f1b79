# SPDX-License-Identifier: Apache-2.0
"""Tests shaped distant lights and lights without shadows against closed forms."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stages import camera, ground, light, material, moved, quad, turned, write_stage

import wavecomb

FLOOR = material("M", "diffuse", diffuseColor=(0.5, 0.5, 0.5)) + "\n" + ground("M", 20)
AT_FLOOR = camera((4, 2, 0.5), (0, 0, 0), half=1e-3)
DOWN = turned(x=-90)


@pytest.fixture
def shot(tmp_path: Path, beauty: Any) -> Any:
    """Function that renders the floor and returns its mean irradiance."""

    def render(*prims: str, spp: int = 256) -> float:
        stage = wavecomb.load(write_stage(tmp_path / "stage.usda", AT_FLOOR, FLOOR, *prims))
        return float(beauty(stage, 16, spp, max_depth=1).mean(dtype=np.float64)) * np.pi / 0.5

    return render


def shaped(text: str, *lines: str) -> str:
    """A light with UsdLuxShapingAPI."""
    head, rest = text.split("{", 1)
    return f'{head}( prepend apiSchemas = ["ShapingAPI"] ) {{\n' + "\n".join(lines) + rest


def test_cone_of_a_distant_light(shot: Any) -> None:
    """A cone of half angle 10 degrees limits the irradiance to pi L sin^2(10 degrees)."""
    sun = shaped(light("Distant", transform=DOWN, angle=60), "float inputs:shaping:cone:angle = 10")
    expected = np.pi * np.sin(np.radians(10)) ** 2
    assert shot(sun, spp=4096) == pytest.approx(expected, rel=2e-3)


def test_focus_of_a_distant_light(shot: Any) -> None:
    """With focus 2, the irradiance of half angle 30 degrees is pi / 2 (1 - cos^4(30 degrees))."""
    sun = shaped(light("Distant", transform=DOWN, angle=60), "float inputs:shaping:focus = 2")
    expected = np.pi / 2 * (1 - np.cos(np.radians(30)) ** 4)
    assert shot(sun, spp=4096) == pytest.approx(expected, rel=1e-3)


def test_profile_of_a_parallel_light(shot: Any, tmp_path: Path) -> None:
    """An IES profile scales a light of angle 0 by the candela value on the axis."""
    (tmp_path / "lamp.ies").write_text(
        "IESNA:LM-63-2002\nTILT=NONE\n1 1000 1 3 1 1 2 0.1 0.1 0\n1 1 10\n0 45 90\n0\n7 3 0\n"
    )
    ies = "asset inputs:shaping:ies:file = @lamp.ies@"
    sun = shaped(light("Distant", colour=(3, 3, 3), transform=DOWN, angle=0), ies)
    assert shot(sun, spp=4) == pytest.approx(21, rel=1e-5)


def test_shadows_may_be_off(shot: Any) -> None:
    """Occluders have no effect, even if shadow linking includes them."""
    corners = [(-0.8, 0.5, 0.8), (0.8, 0.5, 0.8), (0.8, 0.5, -0.8), (-0.8, 0.5, -0.8)]
    shade = quad("Shade", corners, "M")
    lamp = light("Disk", transform=DOWN @ moved(0, 1, 0), radius=0.5)
    head, rest = lamp.split("{", 1)
    off = f'{head}( prepend apiSchemas = ["ShadowAPI"] ) {{ bool inputs:shadow:enable = 0\n{rest}'
    assert shot(shade, lamp) == 0
    assert shot(shade, off, spp=1024) == pytest.approx(np.pi * 0.25 / 1.25, rel=1e-3)
