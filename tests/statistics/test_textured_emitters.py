# SPDX-License-Identifier: Apache-2.0
"""Tests that textured emission has the same mean for all sampling techniques.

A floor is lit by a square that shows half of its texture: fine stripes, next to a much brighter
half that a filtered lookup would blend in. Light samples read the finest level, so bounces must do
the same although their ray cones are wide.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from stages import camera, ground, light, material, matrix, moved, numbers, turned, write_stage

import wavecomb
from wavecomb.scenes.authoring.textures import write_image

ALBEDO = 0.6
SIZE = 64
END = (SIZE // 2 - 0.5) / SIZE
"""Texture coordinate up to which a lookup reads only dark texels."""


def stripes() -> NDArray[np.float32]:
    """Alternating texels of 2 and 0 on the left, 40 on the right, (64, 64, 3)."""
    image = np.full((SIZE, SIZE, 3), 40.0, np.float32)
    image[:, : SIZE // 2] = np.where(np.arange(SIZE // 2) % 2, 0.0, 2.0)[None, :, None]
    return image


def square(height: float) -> str:
    """A square of 1 x 1 that faces down, with the left half of the texture."""
    corners = [(-0.5, 0.5, 0), (0.5, 0.5, 0), (0.5, -0.5, 0), (-0.5, -0.5, 0)]
    lines = [
        f"point3f[] points = {numbers(corners)}",
        "int[] faceVertexCounts = [4]\nint[] faceVertexIndices = [0, 1, 2, 3]",
        'uniform token subdivisionScheme = "none"',
        f"texCoord2f[] primvars:st = [(0, 0), ({END}, 0), ({END}, 1), (0, 1)]"
        ' ( interpolation = "vertex" )',
        "rel material:binding = </World/G>",
        matrix(turned(x=-90) @ moved(0, height, 0)),
    ]
    body = "\n".join(lines)
    return f'def Mesh "Square" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {{\n{body}\n}}'


GLOW = """def Material "G" {
    token outputs:surface.connect = </World/G/Surface.outputs:surface>
    def Shader "Surface" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0, 0, 0)
        color3f inputs:emissiveColor.connect = </World/G/Map.outputs:rgb>
        float inputs:ior = 1
        token outputs:surface
    }
    def Shader "Map" {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @stripes.exr@
        token inputs:sourceColorSpace = "raw"
        token inputs:wrapS = "clamp"
        token inputs:wrapT = "clamp"
        float2 inputs:st.connect = </World/G/St.outputs:result>
        float3 outputs:rgb
    }
    def Shader "St" {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }
}"""


def exact(height: float) -> float:
    """Radiance of the floor below the centre, integrating the finest level over the square."""
    x, z = (np.arange(2048) + 0.5) / 2048, (np.arange(256) + 0.5) / 256
    at = x * END * SIZE - 0.5
    texels = stripes()[0, :, 0]
    low = np.floor(at).astype(int)
    part = at - low
    row = texels[np.maximum(low, 0)] * (1 - part) + texels[low + 1] * part
    dx, dz = np.meshgrid(x - 0.5, z - 0.5, indexing="ij")
    form = height**2 / (dx**2 + dz**2 + height**2) ** 2
    return float(ALBEDO / np.pi * (row[:, None] * form).mean())


@pytest.mark.slow
@pytest.mark.parametrize("texture_filter", ["auto", "whole"])
@pytest.mark.parametrize("height", [0.3, 3.0])
@pytest.mark.parametrize("technique", ["both", "bounces", "bdpt"])
def test_one_mean(
    tmp_path: Path, beauty: Any, technique: str, height: float, texture_filter: str
) -> None:
    """Light samples with bounces, almost only bounces, and light paths have the same mean."""
    write_image(tmp_path / "stripes.exr", stripes(), "float")
    prims = [
        camera((0, 0.2, 0.001), (0, 0, 0), half=0.02),
        material("M", "diffuse", diffuseColor=(ALBEDO,) * 3),
        ground("M", 20),
        GLOW,
        square(height),
    ]
    settings: dict[str, Any] = {"max_depth": 1, "texture_filter": texture_filter}
    spp = 256
    if technique == "bounces":
        prims.append(light("Rect", "Decoy", colour=(1e5, 1e5, 1e5), transform=moved(0, 0, -99)))
        settings |= {"light_weights": "power", "light_selection": "power"}
        spp = 4096 if height > 1 else 512
    elif technique == "bdpt":
        settings["transport"] = "bdpt"
    stage = wavecomb.load(write_stage(tmp_path / "stage.usda", *prims))
    renders = np.array(
        [beauty(stage, 16, spp, seed=seed, **settings).mean(dtype=np.float64) for seed in range(4)]
    )
    ratio, error = renders / exact(height), renders.std(ddof=1) / 2 / exact(height)
    assert error < 0.01
    assert abs(ratio.mean() - 1.0) < 0.003 + 4 * error


def test_every_way_gives_the_same_picture(tmp_path: Path) -> None:
    """Lanes, waves, threads and the reference integrator give equal images."""
    write_image(tmp_path / "stripes.exr", stripes(), "float")
    prims = [
        camera((0, 1.0, 2.0), (0, 0.1, 0), half=0.4),
        material("M", "diffuse", diffuseColor=(ALBEDO,) * 3),
        ground("M", 20),
        GLOW,
        square(0.3),
    ]
    stage = wavecomb.load(write_stage(tmp_path / "stage.usda", *prims))

    def render(**settings: Any) -> Any:
        return wavecomb.render(stage, size=(24, 16), spp=4, max_depth=3, **settings).beauty

    first = render()
    assert first.mean() > 0.01
    for other in ({"integrator": "reference"}, {"lanes": 1}, {"wave_size": 64, "threads": 2}):
        assert np.array_equal(render(**other), first), other
