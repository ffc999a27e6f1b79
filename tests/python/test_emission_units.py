# SPDX-License-Identifier: Apache-2.0
"""Tests units of emission in MaterialX's graphs and in UsdLux, where intensity 1 is 1 nit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

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


def mean(folder: Path, prims: str, aperture: float = 10, **settings: Any) -> np.ndarray:
    path = folder / "stage.usda"
    path.write_text(
        '#usda 1.0\n(\ndefaultPrim = "W"\nupAxis = "Y"\n)\ndef Xform "W" {\n'
        f'def Camera "C" {{\nfloat focalLength = 50\nfloat horizontalAperture = {aperture}\n'
        f"float verticalAperture = {aperture}\ndouble3 xformOp:translate = (0, 0, 4)\n"
        'uniform token[] xformOpOrder = ["xformOp:translate"]\n}\n' + prims + "\n}\n"
    )
    picture = wavecomb.render(path, size=(4, 4), **({"spp": 4, "max_depth": 0} | settings))
    return picture.beauty.mean((0, 1))


def surface(shader: str) -> str:
    return (
        f'def Material "M" {{\ntoken outputs:surface.connect = </W/M/S.outputs:surface>\n'
        f'def Shader "S" {{\nuniform token info:id = "{shader}"\n{SURFACES[shader]}\n'
        "token outputs:surface\n}\n}\n"
    )


@pytest.mark.parametrize("shader", SURFACES)
def test_emission_is_radiance(tmp_path: Path, shader: str) -> None:
    """Emission is luminance (or strength) times colour, as in MaterialX's graph of each model."""
    assert np.allclose(mean(tmp_path, surface(shader) + SQUARE), (250, 125, 50), rtol=1e-5)


@pytest.mark.parametrize("kind", ["Rect", "Disk", "Sphere", "Cylinder"])
def test_area_lights_are_of_the_same_unit(tmp_path: Path, kind: str) -> None:
    """A UsdLux light of intensity 1 has a luminance of 1 nit."""
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


COLOUR = np.array((1.0, 0.5, 0.2))
EMITTED = "float inputs:intensity = 250\ncolor3f inputs:color = (1, 0.5, 0.2)\n"


@pytest.mark.parametrize("normalize", [False, True])
def test_domes_are_of_the_same_unit(tmp_path: Path, normalize: bool) -> None:
    """Dome lights ignore inputs:normalize, as UsdLux specifies."""
    light = f'def DomeLight "L" {{\n{EMITTED}bool inputs:normalize = {int(normalize)}\n}}'
    assert np.allclose(mean(tmp_path, light), 250 * COLOUR, rtol=1e-5)


def illuminance(folder: Path, light: str) -> np.ndarray:
    """Returns the illuminance of a white square at the origin that faces +z."""
    matte = (
        'def Material "M" {\ntoken outputs:surface.connect = </W/M/S.outputs:surface>\n'
        'def Shader "S" {\nuniform token info:id = "UsdPreviewSurface"\n'
        "color3f inputs:diffuseColor = (1, 1, 1)\nfloat inputs:ior = 1\n"
        "float inputs:roughness = 1\ntoken outputs:surface\n}\n}\n"
    )
    return np.pi * mean(folder, f"{matte}{SQUARE}\n{light}", 0.1, spp=1024, max_depth=1)


@pytest.mark.parametrize(
    ("angle", "normalize", "expected"),
    [
        (0.0, False, 1.0),
        (0.0, True, 1.0),
        (60.0, False, np.pi * 0.25),
        (60.0, True, 1.0),
        (180.0, True, 1.0),
        (270.0, False, np.pi),
        (270.0, True, 1 / 1.5),
    ],
)
def test_distant_lights_are_divided_by_their_size_factor(
    tmp_path: Path, angle: float, normalize: bool, expected: float
) -> None:
    """The size factor of a distant light is pi sin^2(angle / 2), or 1 for angle 0.

    Above 180 degrees, the factor is pi (2 - sin^2(angle / 2)). With inputs:normalize,
    intensity is the illuminance in lux. The square sees at most a hemisphere of the light.
    """
    light = (
        f'def DistantLight "L" {{\n{EMITTED}float inputs:angle = {angle}\n'
        f"bool inputs:normalize = {int(normalize)}\n}}"
    )
    found = illuminance(tmp_path, light)
    assert np.allclose(found, 250 * COLOUR * expected, rtol=0.01)


@pytest.mark.parametrize(
    ("radius", "point", "normalize", "expected"),
    [
        (0.1, False, False, np.pi * 0.01),
        (0.1, True, False, np.pi * 0.01),
        (0.1, True, True, 0.25),
        (0.0, False, True, 0.25),
    ],
)
def test_points_shine_as_far_spheres(
    tmp_path: Path, radius: float, point: bool, normalize: bool, expected: float
) -> None:
    """treatAsPoint allows renderers to replace a sphere light by a sphere light of radius 0.

    The illuminance at distance d is pi r^2 / d^2 times the luminance. With inputs:normalize, which
    divides by 4 pi r^2, the irradiance is 1 / (4 d^2).
    """
    light = (
        f'def SphereLight "L" {{\n{EMITTED}float inputs:radius = {radius}\n'
        f"bool inputs:normalize = {int(normalize)}\nbool treatAsPoint = {int(point)}\n"
        "double3 xformOp:translate = (0, 3, 4)\n"
        'uniform token[] xformOpOrder = ["xformOp:translate"]\n}'
    )
    found = illuminance(tmp_path, light)
    assert np.allclose(found, 250 * COLOUR * expected / 25 * 0.8, rtol=0.01)
