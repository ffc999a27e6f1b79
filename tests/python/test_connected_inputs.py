# SPDX-License-Identifier: Apache-2.0
"""Tests texture inputs that read one value per object, for example from primvar readers."""

import numpy as np
import OpenImageIO as oiio
import pytest
from usd_recorder import QUAD, load, said

ST = 'texCoord2f[] primvars:st = [(0,0),(1,0),(1,1),(0,1)] (interpolation = "vertex")'
OTHER = ST.replace("primvars:st", "primvars:map")


def stage(inputs, nodes="", own="", st="</M/R.outputs:result>", meshes=None, varname=""):
    found = "".join(
        f"""def Mesh "{name}" (prepend apiSchemas = ["MaterialBindingAPI"]) {{ {QUAD}
            {ST}
            {OTHER}
            {primvars}
            rel material:binding = </M>
        }}
        """
        for name, primvars in (meshes or {"Q": ""}).items()
    )
    return f"""def Material "M" {{ {own}
        token outputs:surface.connect = </M/S.outputs:surface>
        def Shader "S" {{ uniform token info:id = "UsdPreviewSurface"
            color3f inputs:emissiveColor.connect = </M/T.outputs:rgb>
            token outputs:surface
        }}
        def Shader "T" {{ uniform token info:id = "UsdUVTexture"
            asset inputs:file = @./t.png@
            float2 inputs:st.connect = {st}
            {inputs}
            float3 outputs:rgb
        }}
        def Shader "R" {{ uniform token info:id = "UsdPrimvarReader_float2"
            {varname or 'string inputs:varname = "st"'}
            float2 outputs:result
        }}
        {nodes}
    }}
    {found}"""


def reader(kind, varname, fallback=""):
    fallback = f"{kind} inputs:fallback = {fallback}" if fallback else ""
    return f"""def Shader "P" {{ uniform token info:id = "UsdPrimvarReader_{kind}"
        string inputs:varname = "{varname}"
        {fallback}
        {kind} outputs:result
    }}"""


FROM_P = ".connect = </M/P.outputs:result>"
MESHES = {
    "Q": 'float4[] primvars:tint = [(1, 0.5, 0, 1)] (interpolation = "constant")',
    "W": 'float4[] primvars:tint = [(0, 0.5, 1, 1)] (interpolation = "constant")',
    "Bare": "",
}


@pytest.fixture(autouse=True)
def _image(tmp_path):
    pixels = oiio.ImageBuf(oiio.ImageSpec(2, 2, 3, "uint8"))
    oiio.ImageBufAlgo.fill(pixels, (0.25, 0.5, 1.0))
    assert pixels.write(str(tmp_path / "t.png"))


def use_of(scene, name):
    return scene.material_of(name)["textures"]["emission"]


@pytest.mark.parametrize("name", ["scale", "bias"])
def test_scale_and_bias_by_a_primvar(tmp_path, name):
    nodes = reader("float4", "tint", "(2, 2, 2, 2)")
    scene, loaded = load(tmp_path, stage(f"float4 inputs:{name}{FROM_P}", nodes, meshes=MESHES))
    assert use_of(scene, "Q")[name] == (1, 0.5, 0, 1)
    assert use_of(scene, "W")[name] == (0, 0.5, 1, 1)
    assert use_of(scene, "Bare")[name] == (2, 2, 2, 2)
    assert not loaded.report.unsupported and not loaded.report.warnings


def test_values_are_inherited_and_differ_between_instances(tmp_path):
    text = stage(f"float4 inputs:scale{FROM_P}", reader("float4", "tint", "(2, 2, 2, 2)"))
    text = text.replace('def Mesh "Q"', 'class Mesh "Q"')
    for number, value in (("A", "(1, 0, 0, 1)"), ("B", "(0, 1, 0, 1)"), ("C", "(0, 1, 0, 1)")):
        text += f"""def Xform "{number}" {{
            float4[] primvars:tint = [{value}] (interpolation = "constant")
            def Xform "I" (instanceable = true
                references = </Proto>) {{ }}
        }}
        """
    text += 'class Xform "Proto" { def "Q" (references = </Q>) { } }'
    scene, _ = load(tmp_path, text)
    scales = sorted(m["textures"]["emission"]["scale"] for m in scene.materials if m["textures"])
    assert scales == [(0, 1, 0, 1), (1, 0, 0, 1)] and len(scene.meshes) == 2


def test_fallback_by_a_primvar(tmp_path):
    (tmp_path / "t.png").unlink()
    nodes = reader("float4", "tint", "(0.125, 0.25, 0.5, 1)")
    scene, _ = load(tmp_path, stage(f"float4 inputs:fallback{FROM_P}", nodes, meshes=MESHES))
    assert scene.material_of("Q")["emission"] == (1, 0.5, 0)
    assert scene.material_of("Bare")["emission"] == (0.125, 0.25, 0.5)


@pytest.mark.parametrize("kind", ["string", "token"])
def test_wrap_modes_by_a_primvar(tmp_path, kind):
    nodes = reader("string", "how", '"clamp"')
    meshes = {"Q": f'{kind} primvars:how = "mirror"', "Bare": ""}
    scene, loaded = load(tmp_path, stage(f"token inputs:wrapS{FROM_P}", nodes, meshes=meshes))
    assert scene.textures[use_of(scene, "Q")["texture"]]["wrap"] == ("mirror", "black")
    assert scene.textures[use_of(scene, "Bare")["texture"]]["wrap"] == ("clamp", "black")
    assert not loaded.report.unsupported


def test_transforms_by_primvars_and_interfaces(tmp_path):
    nodes = (
        reader("float", "turn")
        + """def Shader "X" { uniform token info:id = "UsdTransform2d"
            float2 inputs:in.connect = </M/R.outputs:result>
            float inputs:rotation.connect = </M/P.outputs:result>
            float2 inputs:scale.connect = </M.inputs:size>
            float2 outputs:result
        }"""
    )
    scene, _ = load(
        tmp_path,
        stage(
            "", nodes, "float2 inputs:size = (2, 3)", "</M/X.outputs:result>",
            {"Q": "float primvars:turn = 90", "Bare": ""},
        ),
    )  # fmt: skip
    assert use_of(scene, "Q")["uv"] == pytest.approx((0, -3, 0, 2, 0, 0), abs=1e-6)
    assert use_of(scene, "Bare")["uv"] == pytest.approx((2, 0, 0, 0, 3, 0), abs=1e-6)


def test_names_of_primvars_by_a_primvar(tmp_path):
    """A string primvar of a mesh chooses the primvar that holds its texture coordinates."""
    nodes = reader("string", "set", '"st"')
    meshes = {"Q": 'string primvars:set = "map"', "Bare": ""}
    text = stage("", nodes, meshes=meshes, varname=f"string inputs:varname{FROM_P}")
    text = text.replace("primvars:map = [(0,0)", "primvars:map = [(7,7)")
    scene, loaded = load(tmp_path, text)
    assert scene.mesh("Q")["uvs"].reshape(-1, 2)[0] == pytest.approx((7, 7))
    assert np.abs(scene.mesh("Bare")["uvs"]).max() <= 1
    assert not loaded.report.unsupported


def test_constant_nodes_count_too(tmp_path):
    nodes = """def Shader "P" { uniform token info:id = "ND_constant_vector4"
        float4 inputs:value = (3, 2, 1, 1)
        float4 outputs:out
    }"""
    scene, loaded = load(tmp_path, stage("float4 inputs:scale.connect = </M/P.outputs:out>", nodes))
    assert use_of(scene, "Q")["scale"] == (3, 2, 1, 1) and not loaded.report.unsupported


def test_what_varies_is_listed_once_for_each_input(tmp_path):
    values = "[(0,0,0,0), (0,0,0,0), (0,0,0,0), (4,4,4,4)]"
    varying = f'float4[] primvars:tint = {values} (\ninterpolation = "vertex"\n)'
    nodes = (
        reader("float4", "tint")
        + """def Shader "U" { uniform token info:id = "UsdUVTexture"
            asset inputs:file = @./t.png@
            float3 outputs:rgb
        }"""
    )
    inputs = f"float4 inputs:scale{FROM_P}\nfloat4 inputs:bias.connect = </M/U.outputs:rgb>"
    scene, loaded = load(tmp_path, stage(inputs, nodes, meshes={"Q": varying}))
    assert use_of(scene, "Q")["scale"] == (1, 1, 1, 1) and use_of(scene, "Q")["bias"] == (0,) * 4
    assert [finding.line() for finding in loaded.report.unsupported] == [
        "UsdUVTexture input bias by UsdUVTexture (its default): /M/T",
        "varying primvar 'tint' for an input of a texture (its mean is used): /Q",
    ]


def test_files_by_a_primvar_are_listed(tmp_path):
    text = stage("", reader("string", "file")).replace(
        "asset inputs:file = @./t.png@", "asset inputs:file.connect = </M/P.outputs:result>"
    )
    _, loaded = load(tmp_path, text)
    assert "not supported: UsdUVTexture input file by UsdPrimvarReader_string: /M/T" in said(loaded)


@pytest.mark.parametrize(("fallback", "listed"), [("(0.25, 0.75)", True), ("(0, 0)", False)])
def test_a_fallback_of_texture_coordinates_is_listed(tmp_path, fallback, listed):
    """Meshes without the primvar use (0, 0), not the fallback value of the primvar reader."""
    oiio.ImageBuf(oiio.ImageSpec(2, 2, 3, "uint8")).write(str(tmp_path / "t.png"))
    varname = f'string inputs:varname = "st"\nfloat2 inputs:fallback = {fallback}'
    _, loaded = load(tmp_path, stage("", varname=varname))
    assert ("fallback of a reader of 'st'" in said(loaded)) == listed
