# SPDX-License-Identifier: Apache-2.0
"""Tests materials for other renderers, such as Arnold's standard_surface."""

import numpy as np
import OpenImageIO as oiio
import pytest
from parts import needs
from usd_recorder import QUAD, load, said

ST = 'texCoord2f[] primvars:st = [(0,0),(1,0),(1,1),(0,1)] (interpolation = "vertex")'
BIND = '(prepend apiSchemas = ["MaterialBindingAPI"])'


def material(output, shader, meshes=("Q", "")):
    names = dict([meshes]) if isinstance(meshes, tuple) else meshes
    drawn = "".join(
        f"""def Mesh "{name}" {BIND} {{ {QUAD}
            {ST}
            {primvars}
            rel material:binding = </M>
        }}
        """
        for name, primvars in names.items()
    )
    return f"""def Material "M" {{
        token outputs:{output}.connect = </M/S.outputs:out>
        def Shader "S" {{ {shader}
            token outputs:out
        }}
        def Shader "I" {{ uniform token info:id = "arnold:image"
            string inputs:filename = "./t.png"
            NODE
            color4f outputs:out
            float outputs:r
        }}
        def Shader "N" {{ uniform token info:id = "arnold:normal_map"
            vector3f inputs:input.connect = </M/I.outputs:out>
            float inputs:strength = 0.5
            vector3f outputs:out
        }}
        def Shader "X" {{ uniform token info:id = "arnold:multiply"
            color3f inputs:input1.connect = </M/I.outputs:out>
            color3f inputs:input2 = (0.5, 0.25, 1)
            color3f outputs:out
        }}
    }}
    {drawn}"""


def arnold(inputs, node="", **more):
    shader = f'uniform token info:id = "arnold:standard_surface"\n{inputs}'
    return material("arnold:surface", shader, **more).replace("NODE", node)


@pytest.fixture(autouse=True)
def _image(tmp_path):
    pixels = oiio.ImageBuf(oiio.ImageSpec(2, 2, 3, "uint8"))
    oiio.ImageBufAlgo.fill(pixels, (0.25, 0.5, 1.0))
    assert pixels.write(str(tmp_path / "t.png"))


@needs("MaterialX")
def test_constants_of_arnolds_standard_surface(tmp_path):
    scene, loaded = load(
        tmp_path,
        arnold(
            """float inputs:base = 0.5
            color3f inputs:base_color = (0.8, 0.4, 0.2)
            float inputs:metalness = 0.25
            float inputs:specular_roughness = 0.3
            float inputs:specular_IOR = 1.4
            float inputs:coat = 0.75"""
        ),
    )
    found = scene.material_of("Q")
    assert found["program"] == "openpbr" and not loaded.report.unsupported
    assert found["base_color"] == pytest.approx((0.4, 0.2, 0.1))
    names = ("metallic", "roughness", "ior", "clearcoat")
    assert [found[name] for name in names] == pytest.approx([0.25, 0.3, 1.4, 0.75])


@needs("MaterialX")
def test_images_of_arnold(tmp_path):
    node = """float inputs:sscale = 2
        bool inputs:tflip = 1
        token inputs:swrap = "mirror"
        color3f inputs:multiply = (0.5, 1, 1)"""
    scene, loaded = load(
        tmp_path,
        arnold("color3f inputs:base_color.connect = </M/I.outputs:out>", node),
    )
    use = scene.material_of("Q")["textures"]["base_color"]
    assert use["uv"] == pytest.approx((2, 0, 0, 0, -1, 1))
    assert use["scale"][:3] == pytest.approx((0.5, 1, 1))
    found = scene.textures[use["texture"]]
    assert found["wrap"] == ("mirror", "repeat") and found["srgb"]
    assert not loaded.report.unsupported and not loaded.report.warnings


@needs("MaterialX")
def test_numbers_and_products_by_images(tmp_path):
    inputs = """float inputs:specular_roughness.connect = </M/I.outputs:r>
        color3f inputs:base_color.connect = </M/X.outputs:out>"""
    node = 'string inputs:color_space = "Raw"'
    scene, loaded = load(tmp_path, arnold(inputs, node))
    uses = scene.material_of("Q")["textures"]
    assert uses["roughness"]["channel"] == "r"
    assert uses["base_color"]["scale"][:3] == pytest.approx((0.5, 0.25, 1))
    assert not any(one["srgb"] for one in scene.textures if one["pixels"].shape[0] == 2)
    assert not loaded.report.unsupported


@needs("MaterialX")
def test_normal_maps_of_arnold(tmp_path):
    scene, loaded = load(tmp_path, arnold("vector3f inputs:normal.connect = </M/N.outputs:out>"))
    found = scene.material_of("Q")
    use = found["textures"].get("normal")
    assert use is not None or found["graph"] is not None
    if use is not None:
        assert use["scale"][:3] == pytest.approx((1, 1, 2))
    assert not loaded.report.unsupported


@needs("MaterialX")
def test_nodes_of_arnold_that_are_not_known_are_listed(tmp_path):
    text = arnold("color3f inputs:base_color.connect = </M/X.outputs:out>")
    text = text.replace("arnold:multiply", "arnold:cell_noise")
    scene, loaded = load(tmp_path, text)
    assert "not supported: node arnold:cell_noise (its input input1 in its place)" in said(loaded)
    assert "base_color" in scene.material_of("Q")["textures"]


@pytest.mark.parametrize(
    ("output", "shader", "words"),
    [
        ("ri:surface", 'uniform token info:id = "PxrSurface"', "PxrSurface of outputs:ri:surface"),
        ("kma:surface", 'uniform token info:id = "kma_sky"', "kma_sky of outputs:kma:surface"),
        (
            "mdl:surface",
            'uniform token info:implementationSource = "sourceAsset"\n'
            "uniform asset info:mdl:sourceAsset = @OmniPBR.mdl@\n"
            'uniform token info:mdl:sourceAsset:subIdentifier = "OmniPBR"',
            "OmniPBR of outputs:mdl:surface",
        ),
        ("surface", 'uniform token info:id = "toon"', "toon of outputs:surface"),
    ],
)
def test_other_terminals_are_named_and_drawn_in_display_colours(tmp_path, output, shader, words):
    meshes = {
        "Red": "color3f[] primvars:displayColor = [(1, 0, 0)]",
        "Clear": "color3f[] primvars:displayColor = [(0, 1, 0)]\n"
        "float[] primvars:displayOpacity = [0.25]",
        "Bare": "",
    }
    scene, loaded = load(tmp_path, material(output, shader, meshes=meshes).replace("NODE", ""))
    what = f"not supported: surface shader {words} (displayColor in its place): /M"
    assert said(loaded).count(what) == 1
    assert scene.material_of("Red")["base_color"] == (1, 0, 0)
    assert scene.material_of("Clear")["opacity"] == 0.25
    assert scene.material_of("Bare")["base_color"] == (0.5, 0.5, 0.5)


def test_subsets_and_instances_of_what_cannot_be_drawn(tmp_path):
    text = material("ri:surface", 'uniform token info:id = "PxrSurface"').replace("NODE", "")
    text += f"""class Xform "Proto" {{ def Mesh "P" {BIND} {{ {QUAD}
            rel material:binding = </M>
        }} }}
        def Xform "A" (instanceable = true
            references = </Proto>) {{
            color3f[] primvars:displayColor = [(0, 0, 1)]
        }}
        def Mesh "Halves" {BIND} {{
            point3f[] points = [(0,0,0), (1,0,0), (1,1,0), (0,1,0)]
            int[] faceVertexCounts = [3, 3]
            int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]
            uniform token subdivisionScheme = "none"
            color3f[] primvars:displayColor = [(0, 1, 0)]
            def GeomSubset "S" {BIND} {{
                uniform token elementType = "face"
                uniform token familyName = "materialBind"
                int[] indices = [1]
                rel material:binding = </M>
            }}
        }}"""
    scene, _ = load(tmp_path, text)
    colours = [m["base_color"] for m in scene.materials]
    assert (0, 0, 1) in colours and scene.material_of("/P")["base_color"] == (0, 0, 1)
    faces = scene.mesh("Halves")["face_materials"]
    used = np.unique(scene.mesh("Halves")["material"]) if faces is None else np.unique(faces)
    assert {scene.materials[i]["base_color"] for i in used} == {(0, 1, 0)}
