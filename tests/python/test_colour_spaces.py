# SPDX-License-Identifier: Apache-2.0
"""Tests colour spaces of colours in networks, primvars, lights and MaterialX files."""

import pytest
from parts import needs
from usd_recorder import QUAD, load, said

pytestmark = needs("MaterialX")

LINEAR = ((0.5 + 0.055) / 1.055) ** 2.4
"""Linear value of 0.5 in sRGB."""

SPACE = '(\ncolorSpace = "srgb_texture"\n)'
GREY = f"= (0.5, 0.5, 0.5) {SPACE}"
API = '(prepend apiSchemas = ["ColorSpaceAPI"])'
NAME = 'uniform token colorSpace:name = "srgb_texture"'
CONSTANT = """def Shader "X" {api} {{ uniform token info:id = "ND_constant_color3"
    {inputs}
    color3f outputs:out
}}"""
MULTIPLY = f"""def Shader "X" {{ uniform token info:id = "ND_multiply_color3"
    color3f inputs:in1 {GREY}
    color3f inputs:in2 = (1, 1, 1)
    color3f outputs:out
}}"""
TO_X = "color3f inputs:base_color.connect = </Set/M/X.outputs:out>"
TO_MATERIAL = "color3f inputs:{}.connect = </Set/M.inputs:c>"


def material(base="", nodes="", own="", above="", api="", shader_api=""):
    return f"""def Xform "Set" {api} {{
        {above}
        def Material "M" {{ {own}
            token outputs:mtlx:surface.connect = </Set/M/S.outputs:out>
            def Shader "S" {shader_api} {{
                uniform token info:id = "ND_open_pbr_surface_surfaceshader"
                {base}
                token outputs:out
            }}
            {nodes}
        }}
        def Mesh "Q" (prepend apiSchemas = ["MaterialBindingAPI"]) {{ {QUAD}
            rel material:binding = </Set/M>
        }}
    }}"""


@pytest.mark.parametrize(
    "stage",
    [
        material(f"color3f inputs:base_color {GREY}"),
        material(TO_MATERIAL.format("base_color"), own=f"color3f inputs:c {GREY}"),
        material(TO_X, CONSTANT.format(api="", inputs=f"color3f inputs:value {GREY}")),
        material(
            TO_X,
            CONSTANT.format(api="", inputs=TO_MATERIAL.format("value")),
            own=f"color3f inputs:c {GREY}",
        ),
        material(TO_X, MULTIPLY),
        material(
            TO_X,
            CONSTANT.format(api=API, inputs=f"{NAME}\ncolor3f inputs:value = (0.5, 0.5, 0.5)"),
        ),
        material("color3f inputs:base_color = (0.5, 0.5, 0.5)", api=API, above=NAME),
    ],
    ids=["shader", "interface", "node", "node by interface", "operands", "api", "api above"],
)
def test_colours_of_networks_are_read_in_their_spaces(tmp_path, stage):
    scene, loaded = load(tmp_path, stage)
    assert scene.material_of("Q")["base_color"] == pytest.approx((LINEAR,) * 3, rel=1e-4)
    assert not loaded.report.warnings and not loaded.report.unsupported


def test_layers_and_numbers_of_a_shader(tmp_path):
    """Colours of a shader that also has textures are converted; numbers and vectors are not."""
    scene, _ = load(
        tmp_path,
        material(
            f"""{NAME}
            color3f inputs:fuzz_color = (0.5, 0.5, 0.5)
            float inputs:fuzz_weight = 0.5
            float inputs:specular_roughness = 0.5""",
            shader_api=API,
        ),
    )
    found = scene.material_of("Q")
    assert found["openpbr"]["fuzz_color"] == pytest.approx((LINEAR,) * 3, rel=1e-4)
    assert found["openpbr"]["fuzz_weight"] == 0.5 and found["roughness"] == 0.5


def test_a_space_of_its_own_goes_before_that_of_prims(tmp_path):
    own = 'color3f inputs:base_color = (0.5, 0.5, 0.5) (\ncolorSpace = "lin_rec709"\n)'
    scene, _ = load(tmp_path, material(own, api=API, above=NAME))
    assert scene.material_of("Q")["base_color"] == (0.5, 0.5, 0.5)


def test_other_primaries(tmp_path):
    red = 'color3f inputs:base_color = (0.5, 0, 0) (\ncolorSpace = "acescg"\n)'
    scene, _ = load(tmp_path, material(red))
    expected = (0.5 * 1.70505, 0.5 * -0.13026, 0.5 * -0.02400)
    assert scene.material_of("Q")["base_color"] == pytest.approx(expected, abs=1e-3)


def test_an_unknown_space_is_listed(tmp_path):
    odd = 'color3f inputs:base_color = (0.5, 0.5, 0.5) (\ncolorSpace = "my_camera"\n)'
    scene, loaded = load(tmp_path, material(odd))
    assert scene.material_of("Q")["base_color"] == (0.5, 0.5, 0.5)
    assert "not supported: colour space my_camera (read as linear): /Set/M" in said(loaded)


def test_primvars_of_colours(tmp_path):
    colours = "[(0.5, 0.5, 0.5), (0, 0, 0), (1, 1, 1), (0.5, 0, 0)]"
    vertex = f'color3f[] primvars:displayColor = {colours} (\ncolorSpace = "srgb_texture"\n'
    scene, _ = load(
        tmp_path,
        f"""def Mesh "A" {{ {QUAD}
            color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)] {SPACE}
        }}
        def Mesh "B" {{ {QUAD}
            {vertex}interpolation = "vertex"
            )
        }}""",
    )
    assert scene.material_of("A")["base_color"] == pytest.approx((LINEAR,) * 3, rel=1e-4)
    rate, values = scene.mesh("B")["attributes"]["displayColor"]
    assert rate == "vertex"
    assert values[0] == pytest.approx([LINEAR] * 3, rel=1e-4)
    assert values[3] == pytest.approx([LINEAR, 0, 0], abs=1e-4)


def test_colours_of_lights(tmp_path):
    scene, _ = load(
        tmp_path,
        f"""def SphereLight "L" (prepend apiSchemas = ["ShadowAPI"]) {{
            color3f inputs:shadow:color {GREY}
        }}""",
    )
    assert scene.lights[0]["shadow_color"] == pytest.approx((LINEAR,) * 3, rel=1e-4)


MTLX = """<?xml version="1.0"?>
<materialx version="1.39"{document}>
  <open_pbr_surface name="S" type="surfaceshader">
    <input name="base_color" type="color3" value="0.5, 0.5, 0.5"{own} />
  </open_pbr_surface>
  <surfacematerial name="M" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="S" />
  </surfacematerial>
</materialx>
"""
_SRGB = ' colorspace="srgb_texture"'


@pytest.mark.parametrize(
    ("document", "own", "above", "value"),
    [
        (_SRGB, "", "", LINEAR),
        ("", _SRGB, "", LINEAR),
        (_SRGB, ' colorspace="lin_rec709"', "", 0.5),
        (_SRGB, ' colorspace="none"', "", 0.5),
        (' colorspace="lin_rec709"', "", "", 0.5),
        ("", "", "", 0.5),
        ("", ' colorspace="lin_rec709"', NAME, 0.5),
    ],
)
def test_colours_of_materialx_files(tmp_path, document, own, above, value):
    (tmp_path / "m.mtlx").write_text(MTLX.format(document=document, own=own))
    scene, _ = load(
        tmp_path,
        f"""def Xform "Set" {API if above else ""} {{ {above}
            def "Looks" (references = @m.mtlx@</MaterialX>) {{ }}
            def Mesh "Q" (prepend apiSchemas = ["MaterialBindingAPI"]) {{ {QUAD}
                rel material:binding = </Set/Looks/Materials/M>
            }}
        }}""",
    )
    assert scene.material_of("Q")["base_color"] == pytest.approx((value,) * 3, rel=1e-4)
