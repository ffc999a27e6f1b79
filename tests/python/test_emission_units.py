# SPDX-License-Identifier: Apache-2.0
"""Units of emission: the radiance of MaterialX's own graphs, beside UsdLux, where 1 is 1 nit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import wavecomb

pytest.importorskip("wavecomb._core")
pytest.importorskip("MaterialX")

SURFACES = {
    "ND_open_pbr_surface_surfaceshader": (
        "float inputs:emission_luminance = 250\ncolor3f inputs:emission_color = (1, 0.5, 0.2)\n"
        "float inputs:base_weight = 0\nfloat inputs:specular_weight = 0"
    ),
    "ND_standard_surface_surfaceshader": (
        "float inputs:emission = 250\ncolor3f inputs:emission_color = (1, 0.5, 0.2)\n"
        "float inputs:base = 0\nfloat inputs:specular = 0"
    ),
    "ND_gltf_pbr_surfaceshader": (
        "float inputs:emissive_strength = 250\ncolor3f inputs:emissive = (1, 0.5, 0.2)\n"
        "color3f inputs:base_color = (0, 0, 0)\nfloat inputs:metallic = 0"
    ),
    "UsdPreviewSurface": "color3f inputs:emissiveColor = (250, 125, 50)",
}

SQUARE = """def Mesh "Square" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    uniform token subdivisionScheme = "none"
    rel material:binding = </W/M>
}"""


def mean(folder: Path, prims: str) -> np.ndarray:
    path = folder / "stage.usda"
    path.write_text(
        '#usda 1.0\n(\ndefaultPrim = "W"\nupAxis = "Y"\n)\ndef Xform "W" {\n'
        'def Camera "C" {\nfloat focalLength = 50\nfloat horizontalAperture = 10\n'
        "float verticalAperture = 10\ndouble3 xformOp:translate = (0, 0, 4)\n"
        'uniform token[] xformOpOrder = ["xformOp:translate"]\n}\n' + prims + "\n}\n"
    )
    picture = wavecomb.render(path, size=(4, 4), spp=4, max_depth=0)
    return picture.beauty.mean((0, 1))


def surface(shader: str) -> str:
    return (
        f'def Material "M" {{\ntoken outputs:surface.connect = </W/M/S.outputs:surface>\n'
        f'def Shader "S" {{\nuniform token info:id = "{shader}"\n{SURFACES[shader]}\n'
        "token outputs:surface\n}\n}\n"
    )


@pytest.mark.parametrize("shader", SURFACES)
def test_emission_is_radiance(tmp_path: Path, shader: str) -> None:
    """Luminance, or strength, times colour, as the graph of each model in MaterialX's library."""
    assert np.allclose(mean(tmp_path, surface(shader) + SQUARE), (250, 125, 50), rtol=1e-5)


@pytest.mark.parametrize("kind", ["Rect", "Disk", "Sphere", "Cylinder"])
def test_area_lights_are_of_the_same_unit(tmp_path: Path, kind: str) -> None:
    """UsdLux: a light of intensity 1 has a luminance of 1 nit."""
    sizes = {
        "Rect": "float inputs:width = 2\nfloat inputs:height = 2",
        "Disk": "float inputs:radius = 2",
        "Sphere": "float inputs:radius = 2",
        "Cylinder": "float inputs:radius = 1\nfloat inputs:length = 4",
    }
    light = (
        f'def {kind}Light "L" {{\nfloat inputs:intensity = 250\n'
        f"color3f inputs:color = (1, 0.5, 0.2)\n{sizes[kind]}\n"
        'float xformOp:rotateY = 180\nuniform token[] xformOpOrder = ["xformOp:rotateY"]\n}'
    )
    assert np.allclose(mean(tmp_path, light), (250, 125, 50), rtol=1e-5)
