# SPDX-License-Identifier: Apache-2.0
"""Tests lights whose shapes only mirrors and clear glass show."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wavecomb
from wavecomb import _core

pytestmark = pytest.mark.slow

HIDDEN = "bool primvars:wavecomb:visibility:camera = 0"
KINDS = {
    "RectLight": "float inputs:width = 2\n float inputs:height = 1",
    "DiskLight": "float inputs:radius = 0.8",
    "SphereLight": "float inputs:radius = 0.5",
    "CylinderLight": "float inputs:length = 1.5\n float inputs:radius = 0.4",
}
# The camera looks at a vertical wall. The left half of the wall is a mirror or a diffuse surface,
# the right half is diffuse. A light between camera and wall faces the wall.
STAGE = """#usda 1.0
(
    upAxis = "Y"
)
def Camera "Camera" {{
    float focalLength = 30
    double3 xformOp:translate = (0, 0, 8)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
def DomeLight "Sky" {{
    color3f inputs:color = (0.2, 0.3, 0.4)
}}
def Xform "Rig" {{
    {above}
    def {kind} "Lamp" {{
        {size}
        float inputs:intensity = 3
        {flags}
        double3 xformOp:translate = (-1.5, 0, 3)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
}}
def Material "Left" {{
    token outputs:surface.connect = </Left/S.outputs:surface>
    def Shader "S" {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0.8, 0.7, 0.6)
        float inputs:metallic = {metallic}
        float inputs:roughness = {roughness}
        token outputs:surface
    }}
}}
def Mesh "Wall" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-4, -3, 0), (0, -3, 0), (0, 3, 0), (-4, 3, 0)]
    rel material:binding = </Left>
}}
def Mesh "Plain" {{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, -3, 0), (4, -3, 0), (4, 3, 0), (0, 3, 0)]
}}
"""
SIZE = {"size": (48, 32), "spp": 4, "seed": 3, "quality": "plain"}


def write(folder: Path, kind: str, flags: str = "", above: str = "", *, mirror: bool) -> Path:
    path = folder / "s.usda"
    path.write_text(STAGE.format(
        kind=kind, size=KINDS[kind], flags=flags, above=above,
        metallic=1 if mirror else 0, roughness=0 if mirror else 0.6,
    ))  # fmt: skip
    return path


def render(stage: Any, **settings: Any) -> Any:
    loaded = wavecomb.load(stage) if isinstance(stage, Path) else stage
    return np.asarray(wavecomb.render(loaded, **(SIZE | settings)).beauty)


@pytest.mark.parametrize("kind", KINDS)
def test_without_mirrors_the_light_has_no_shape(tmp_path: Path, kind: str) -> None:
    """Neither camera rays nor shadow rays nor other bounces hit the shape."""
    hidden = render(write(tmp_path, kind, HIDDEN, mirror=False))
    without = render(write(tmp_path, kind, "bool wavecomb:visible = 0", mirror=False))
    visible = render(write(tmp_path, kind, mirror=False))
    assert np.array_equal(hidden, without)
    assert not np.array_equal(hidden, visible)


@pytest.mark.parametrize("kind", KINDS)
def test_a_mirror_shows_the_light(tmp_path: Path, kind: str) -> None:
    """Paths that only see the mirror and the light are the same as with a visible light."""
    hidden = render(write(tmp_path, kind, HIDDEN, mirror=True), max_depth=1)
    without = render(write(tmp_path, kind, "bool wavecomb:visible = 0", mirror=True), max_depth=1)
    visible = render(write(tmp_path, kind, mirror=True), max_depth=1)
    # The noise beside the mirror may differ, since light selection learns from pilot renders.
    shown = np.any(hidden > without + 0.5, axis=2)
    changed = np.any(visible != without, axis=2)
    assert shown.sum() >= 10, "the mirror shows the light"
    assert not shown[:, 26:].any(), "beside the mirror, nothing has changed"
    # Where a visible light does not cover the mirror, both show the same reflection.
    same = np.all(hidden == visible, axis=2) & shown
    assert same.sum() >= 10
    assert (changed & ~shown).any(), "the camera sees a visible light"


@pytest.mark.parametrize("transport", ["path", "light"])
@pytest.mark.parametrize("kind", ["RectLight", "CylinderLight"])
def test_the_image_does_not_depend_on_the_schedule(
    tmp_path: Path, kind: str, transport: str
) -> None:
    stage = wavecomb.load(write(tmp_path, kind, HIDDEN, mirror=True))
    settings = {"transport": transport, "spp": 2}
    first = render(stage, integrator="reference", threads=1, **settings)
    for lanes in _core.lane_widths():
        assert np.array_equal(first, render(stage, lanes=lanes, **settings))
    assert np.array_equal(first, render(stage, wave_size=256, threads=2, **settings))


def test_the_attribute_is_inherited(tmp_path: Path) -> None:
    own = render(write(tmp_path, "RectLight", HIDDEN, mirror=True))
    above = render(write(tmp_path, "RectLight", "", HIDDEN, mirror=True))
    overridden = "bool primvars:wavecomb:visibility:camera = 1"
    seen = render(write(tmp_path, "RectLight", overridden, HIDDEN, mirror=True))
    assert np.array_equal(own, above)
    assert np.array_equal(seen, render(write(tmp_path, "RectLight", mirror=True)))


@pytest.mark.parametrize(
    "other",
    ["bool primvars:arnold:visibility:camera = 0",
     "int primvars:ri:attributes:visibility:camera = 0",
     'string primvars:karma:object:rendervisibility = "-primary"'],
)  # fmt: skip
def test_attributes_of_other_renderers(tmp_path: Path, other: str) -> None:
    own = render(write(tmp_path, "DiskLight", HIDDEN, mirror=True))
    assert np.array_equal(own, render(write(tmp_path, "DiskLight", other, mirror=True)))


def test_hidden_from_bounces(tmp_path: Path) -> None:
    bounces = "bool primvars:wavecomb:visibility:bounces = 0"
    both = render(write(tmp_path, "RectLight", f"{HIDDEN}\n{bounces}", mirror=True))
    without = render(write(tmp_path, "RectLight", "bool wavecomb:visible = 0", mirror=True))
    assert np.array_equal(both, without)
    stage = wavecomb.load(write(tmp_path, "RectLight", bounces, mirror=True))
    assert "lights hidden from bounces only" in [one.what for one in stage.report.unsupported]
