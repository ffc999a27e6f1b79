# SPDX-License-Identifier: Apache-2.0
"""Tests renders in ACEScg: conversion of colours to ACEScg, and back for display."""

import numpy as np
import OpenImageIO as oiio
import pytest
from usd_recorder import QUAD, Recorder, load, write

import wavecomb
from wavecomb import WavecombError
from wavecomb.image.files.image import linear_from_srgb, read_image, read_metadata
from wavecomb.image.working_space import CHROMATICITIES, from_rec709, to_rec709
from wavecomb.usd import load_stage
from wavecomb.usd.materials.colour_space import convert_colour

RED = (0.9, 0.2, 0.1)
STAGE = f"""
def Mesh "Lamp" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
    {QUAD}
    rel material:binding = </Glow>
}}
def Material "Glow" {{
    custom token wavecomb:program = "emissive"
    token outputs:surface.connect = </Glow/S.outputs:surface>
    def Shader "S" {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:emissiveColor = {RED}
        token outputs:surface
    }}
}}
def Mesh "Plain" {{ {QUAD} color3f[] primvars:displayColor = [{RED}]
    double3 xformOp:translate = (0, 0, -9)
    uniform token[] xformOpOrder = ["xformOp:translate"] }}
def SphereLight "Light" {{
    color3f inputs:color = {RED}
    float inputs:intensity = 2
    double3 xformOp:translate = (0, 0, 50)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
def Camera "C" {{ float focalLength = 10
    float horizontalAperture = 10
    float verticalAperture = 10
    double3 xformOp:translate = (0.5, 0.5, 1.25)
    uniform token[] xformOpOrder = ["xformOp:translate"] }}
"""


def test_matrix_is_that_of_opencolorio():
    for colour in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.2, 0.3, 0.9)):
        there = convert_colour(colour, "ACEScg", "rec709")
        assert to_rec709(np.array(colour), "acescg") == pytest.approx(there, abs=2e-5)
        back = from_rec709(np.array(there), "acescg")
        assert back == pytest.approx(colour, abs=2e-5)
    assert to_rec709(np.ones(3), "acescg") == pytest.approx([1, 1, 1], abs=1e-5)


def test_all_colours_are_converted(tmp_path):
    scene, loaded = load(tmp_path, STAGE, working_space="acescg")
    red = from_rec709(np.array(RED), "acescg")
    assert loaded.working_space == "acescg"
    assert scene.material_of("Lamp")["emission"] == pytest.approx(red)
    assert scene.material_of("Plain")["base_color"] == pytest.approx(red)
    assert scene.lights[0]["color"] == pytest.approx(2 * red)


def test_colours_of_openpbr_are_converted(tmp_path):
    layers = ("transmission_color", "subsurface_color", "fuzz_color", "coat_color")
    colours = "\n".join(f"color3f inputs:{name} = {RED}" for name in (*layers, "specular_color"))
    text = f"""def Material "Mat" {{
        token outputs:mtlx:surface.connect = </Mat/S.outputs:out>
        def Shader "S" {{
            uniform token info:id = "ND_open_pbr_surface_surfaceshader"
            {colours}
            token outputs:out
        }}
    }}
    def Mesh "M" (prepend apiSchemas = ["MaterialBindingAPI"]) {{ {QUAD}
        rel material:binding = </Mat> }}"""
    for space in ("rec709", "acescg"):
        scene, _ = load(tmp_path, text, working_space=space)
        got = scene.material_of("M")
        expected = from_rec709(np.array(RED), space)
        assert got["specular_color"] == pytest.approx(expected)
        for name in layers:
            assert got["openpbr"][name] == pytest.approx(expected), name
        assert got["openpbr"]["coat_ior"] == pytest.approx(1.6)


def test_colours_beyond_rec709_are_kept(tmp_path):
    text = STAGE.replace(
        f"inputs:color = {RED}", 'inputs:color = (1, 0, 0) (colorSpace = "acescg")'
    )
    scene, _ = load(tmp_path, text, working_space="acescg")
    assert scene.lights[0]["color"] == pytest.approx((2, 0, 0), abs=1e-4)
    scene, _ = load(tmp_path, text)
    assert scene.lights[0]["color"] == pytest.approx((3.4101, 0, 0), abs=1e-3)


def test_files_say_what_they_hold_and_display_is_the_same(tmp_path):
    pictures = {}
    for space in ("rec709", "acescg"):
        loaded = wavecomb.load(write(tmp_path, STAGE), working_space=space)
        picture = wavecomb.render(loaded, size=(8, 8), spp=1)
        picture.save(tmp_path / f"{space}.exr")
        picture.save(tmp_path / f"{space}.png")
        pictures[space] = picture.beauty[4, 4]
    assert pictures["rec709"] == pytest.approx(RED)
    assert pictures["acescg"] == pytest.approx(from_rec709(np.array(RED), "acescg"), abs=1e-5)
    header = read_metadata(tmp_path / "acescg.exr")
    assert header["chromaticities"] == pytest.approx(CHROMATICITIES["acescg"])
    assert header["wavecomb:working_space"] == "acescg"
    assert "chromaticities" not in read_metadata(tmp_path / "rec709.exr")
    a, b = (read_image(tmp_path / f"{space}.png") for space in ("rec709", "acescg"))
    assert np.abs(a - b).max() < 0.01 and a[4, 4] == pytest.approx(RED, abs=0.01)


def test_textures_are_converted_by_what_they_are(tmp_path):
    out = oiio.ImageOutput.create(str(tmp_path / "a.png"))
    assert out.open(str(tmp_path / "a.png"), oiio.ImageSpec(2, 2, 3, "uint8"))
    assert out.write_image(np.full((2, 2, 3), (240, 40, 20), np.uint8))
    out.close()
    text = """def Material "Mat" {
        token outputs:surface.connect = </Mat/S.outputs:surface>
        def Shader "S" {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>
            float inputs:roughness.connect = </Mat/T.outputs:g>
            token outputs:surface
        }
        def Shader "T" {
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @a.png@
            float3 outputs:rgb
            float outputs:g
        }
    }
    def Mesh "M" (prepend apiSchemas = ["MaterialBindingAPI"]) { QUAD
        rel material:binding = </Mat> }"""
    scene, _ = load(tmp_path, text.replace("QUAD", QUAD), working_space="acescg")
    uses = scene.material_of("M")["textures"]
    colour, rough = (scene.textures[uses[s]["texture"]] for s in ("base_color", "roughness"))
    linear = linear_from_srgb(np.array([240, 40, 20], np.float32) / 255)
    assert colour["pixels"].dtype == np.float16 and not colour["srgb"]
    expected = from_rec709(linear, "acescg")
    assert colour["pixels"][0, 0] == pytest.approx(expected, rel=2e-3)
    assert rough["pixels"].dtype == np.uint8 and rough["srgb"]


def test_unknown_working_space(tmp_path):
    with pytest.raises(WavecombError, match="no working space 'aces'; there are rec709, acescg"):
        load_stage(write(tmp_path, STAGE), working_space="aces", builder_factory=Recorder)
