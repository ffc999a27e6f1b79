# SPDX-License-Identifier: Apache-2.0
"""Tests that stages get a soft dome unless lights or emissive meshes light their objects."""

import numpy as np
import OpenImageIO as oiio
import pytest
from usd_recorder import load, said, write

import wavecomb

DIM = "no light except emissive materials that are too dim: added a soft dome"
ROOM = """
def Mesh "Floor" {{ point3f[] points = [(-4,0,-4), (-4,0,4), (4,0,4), (4,0,-4)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0,1,2,3]
    uniform token subdivisionScheme = "none"
    color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)]
}}
def Sphere "A" {{ double3 xformOp:translate = (-1.5, 1, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"] }}
def Sphere "B" {{ double3 xformOp:translate = (1.5, 1, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"] }}
def Camera "C" {{ double3 xformOp:translate = (0, 2, 14)
    uniform token[] xformOpOrder = ["xformOp:translate"] }}
def Material "M" {{ token outputs:surface.connect = </M/S.outputs:surface>
    def Shader "S" {{ uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0, 0, 0)
        {emission}
        token outputs:surface }}
    def Shader "T" {{ uniform token info:id = "UsdUVTexture"
        asset inputs:file = @./e.exr@
        float2 inputs:st.connect = </M/R.outputs:result>
        float3 outputs:rgb }}
    def Shader "R" {{ uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result }}
}}
{lamp}
"""
PANEL = """def Mesh "{name}" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
    point3f[] points = [
        (-{half},5,-{half}), (-{half},5,{half}), ({half},5,{half}), ({half},5,-{half})
    ]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0,3,2,1]
    uniform token subdivisionScheme = "none"
    texCoord2f[] primvars:st = [(0,0), (1,0), (1,1), (0,1)] (interpolation = "vertex")
    rel material:binding = </M>
}}"""
EMITS = "color3f inputs:emissiveColor = ({0}, {0}, {0})"


def room(radiance, half, lamp=""):
    panel = PANEL.format(name="Panel", half=half)
    return ROOM.format(emission=EMITS.format(radiance), lamp=lamp or panel)


@pytest.mark.parametrize(
    ("radiance", "half", "lit"),
    [(10, 1.0, True), (1000, 0.1, True), (2, 0.01, False), (10, 0.01, False), (0.5, 1.0, False)],
)
def test_a_dome_unless_emitters_light_the_room(tmp_path, radiance, half, lit):
    scene, loaded = load(tmp_path, room(radiance, half))
    assert [light["kind"] for light in scene.lights] == ([] if lit else ["dome"])
    note = "no visible light; the scene is lit by emissive materials" if lit else "soft dome"
    assert said(loaded).count(note) == 1
    assert (DIM in said(loaded)) == (not lit and radiance >= 1)


def test_a_light_of_intensity_0_keeps_it_off(tmp_path):
    dark = 'def DomeLight "Dark" { float inputs:intensity = 0 }'
    scene, loaded = load(tmp_path, room(2, 0.01) + dark)
    assert len(scene.lights) == 1 and "soft dome" not in said(loaded)


def test_sizes_are_those_of_the_world(tmp_path):
    """The area of emissive meshes is measured in world space, after scaling and instancing."""
    text = PANEL.format(name="Panel", half=0.01)
    big = f"""def Xform "Big" {{ float3 xformOp:scale = (100, 1, 100)
        uniform token[] xformOpOrder = ["xformOp:scale"]
        {text} }}"""
    scene, _ = load(tmp_path, room(10, 0, big))
    assert not scene.lights
    places = ", ".join(f"({x % 30 / 10}, 0, {x // 30 / 10})" for x in range(900))
    many = f"""def PointInstancer "Many" {{ rel prototypes = </Many/P>
        int[] protoIndices = [{", ".join("0" * 900)}]
        point3f[] positions = [{places}]
        def Xform "P" {{ {text} }} }}"""
    scene, _ = load(tmp_path, room(100, 0, many))
    assert not scene.lights
    scene, _ = load(tmp_path, room(1, 0, many))
    assert scene.lights


@pytest.mark.parametrize(("bright", "lit"), [(1.0, True), (0.001, False)])
def test_emissive_textures_count_by_their_means(tmp_path, bright, lit):
    """An emissive texture, which may be mostly black, counts as a light by its mean."""
    side = 64
    pixels = np.zeros((side, side, 3), np.float32)
    pixels[: max(int(side * bright), 1), : max(int(side * bright), 1)] = 5.0
    image = oiio.ImageBuf(oiio.ImageSpec(side, side, 3, "float"))
    assert image.set_pixels(oiio.ROI(), pixels) and image.write(str(tmp_path / "e.exr"))
    emission = "color3f inputs:emissiveColor.connect = </M/T.outputs:rgb>"
    text = ROOM.format(emission=emission, lamp=PANEL.format(name="Panel", half=1.0))
    scene, _ = load(tmp_path, text)
    assert bool(scene.lights) != lit


def test_unlit_assets_stay_as_they_are(tmp_path):
    """If all visible meshes emit, a dome would change their colours, so none is added."""
    text = room(1, 0, " ").split("def Mesh")[0]
    ball = """def Sphere "{0}" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
        rel material:binding = </M> }}"""
    material = room(1, 0, " ")[room(1, 0, " ").index('def Material "M"') :]
    scene, loaded = load(tmp_path, text + material + ball.format("X") + ball.format("Y"))
    assert not scene.lights and "no visible light" in said(loaded)


def test_the_picture_is_no_longer_black(tmp_path):
    picture = wavecomb.render(write(tmp_path, room(2, 0.01)), size=(32, 24), spp=8).beauty
    assert picture[16:].mean() > 0.05
