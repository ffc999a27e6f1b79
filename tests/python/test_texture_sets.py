# SPDX-License-Identifier: Apache-2.0
"""Tests several sets of texture coordinates on one mesh."""

import numpy as np
from test_usd_material import surface, write_image
from usd_recorder import load, said

import wavecomb

SETS = """
    texCoord2f[] primvars:UVMap2 = [(1,0), (0,0), (0,1), (1,1)] (interpolation = "vertex")
    texCoord2f[] primvars:st = [(0,0), (1,0), (1,1), (0,1)] (interpolation = "vertex")
"""


def texture(name, primvar, shift=0.0):
    return f"""def Shader "{name}" {{ uniform token info:id = "UsdUVTexture"
            asset inputs:file = @t.png@
            token inputs:sourceColorSpace = "raw"
            token inputs:wrapS = "repeat"
            token inputs:wrapT = "repeat"
            float2 inputs:st.connect = </Mat/{name}At.outputs:result>
            float3 outputs:rgb
            float outputs:r
        }}
        def Shader "{name}At" {{ uniform token info:id = "UsdTransform2d"
            float2 inputs:translation = ({shift}, 0)
            float2 inputs:in.connect = </Mat/{name}Uv.outputs:result>
            float2 outputs:result
        }}
        def Shader "{name}Uv" {{ uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "{primvar}"
            float2 outputs:result
        }}
    """


def stage(tmp_path, colour="UVMap2", rough="st"):
    rows = np.tile(np.linspace(20, 230, 8, dtype=np.uint8)[None, :, None], (2, 1, 3))
    write_image(tmp_path / "t.png", rows, "uint8")
    text = surface(
        "color3f inputs:diffuseColor.connect = </Mat/C.outputs:rgb>\n"
        "float inputs:roughness.connect = </Mat/R.outputs:r>",
        texture("R", rough) + texture("C", colour, 0.25),
    )
    start = text.index("texCoord2f[] primvars:st")
    end = text.index("\n", start)
    return text[:start] + SETS.strip() + text[end:]


def test_each_texture_is_at_its_own_set(tmp_path):
    scene, loaded = load(tmp_path, stage(tmp_path))
    mesh, got = scene.mesh("M"), scene.material_of("M")
    # The colour is read first, so UVMap2 becomes the mesh's uv, and st an attribute.
    assert mesh["uvs"][:2].tolist() == [[1, 0], [0, 0]]
    assert set(mesh["attributes"]) == {"st"} and "sets" not in said(loaded)
    assert set(got["textures"]) == {"base_color"} and got["textures"]["base_color"]["uv"][2] == 0.25
    assert scene.graphs[got["graph"]].names == ("st",)


def test_a_set_that_is_not_there_leaves_the_other(tmp_path):
    scene, _ = load(tmp_path, stage(tmp_path, rough="none"))
    got = scene.material_of("M")
    assert set(got["textures"]) == {"base_color", "roughness"} and "graph" not in got
    scene, _ = load(tmp_path, stage(tmp_path, colour="none"))
    mesh, got = scene.mesh("M"), scene.material_of("M")
    assert mesh["uvs"][:2].tolist() == [[0, 0], [1, 0]] and mesh["attributes"] == {}


def test_parts_of_a_mesh_have_their_own(tmp_path):
    """Face subsets whose materials use different sets of texture coordinates."""
    text = stage(tmp_path, "st", "st")
    other = stage(tmp_path, "UVMap2", "UVMap2").split("def Mesh")[0]
    other = other.replace('"Mat"', '"Two"').replace("</Mat", "</Two")
    part = """def GeomSubset "P" (prepend apiSchemas = ["MaterialBindingAPI"]) {
        uniform token elementType = "face"
        uniform token familyName = "materialBind"
        int[] indices = [0]
        rel material:binding = </Two>
    }"""
    text = other + text[: text.rindex("}")] + part + "}"
    scene, loaded = load(tmp_path, text)
    mesh = scene.mesh("M")
    assert set(mesh["attributes"]) == {"UVMap2"} and "sets" not in said(loaded)
    (used,) = set(mesh["face_materials"].tolist())
    got = scene.materials[used]
    assert not got["textures"] and scene.graphs[got["graph"]].names == ("UVMap2",)


def test_the_picture_is_that_of_the_set_as_the_mesh_s(tmp_path):
    """A roughness texture looks the same on the second of two UV sets as on the only UV set."""
    two = stage(tmp_path)
    write_image(tmp_path / "flat.png", np.full((2, 2, 3), 102, np.uint8), "uint8")
    two = two.replace("@t.png@", "@rough.png@", 1).replace("@t.png@", "@flat.png@")
    (tmp_path / "rough.png").write_bytes((tmp_path / "t.png").read_bytes())
    link, value = "diffuseColor.connect = </Mat/C.outputs:rgb>", "diffuseColor = (0.4, 0.4, 0.4)"
    one = two.replace(link, value)
    pictures = []
    for text in (two, one):
        (tmp_path / "s.usda").write_text("#usda 1.0\n" + text)
        picture = wavecomb.render(tmp_path / "s.usda", size=(24, 24), spp=64, seed=3)
        pictures.append(np.asarray(picture.beauty, np.float64))
    assert pictures[1].max() > 0.1
    # Sampling uses other tangents, so means over strips are compared.
    two, one = (picture.reshape(24, 4, 6, 3).mean(axis=(0, 2)) for picture in pictures)
    assert np.abs(two - one).max() < 0.02 * one.max()
