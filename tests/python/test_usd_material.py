# SPDX-License-Identifier: Apache-2.0
"""Tests materials: networks, textures, bindings, programs, MaterialX, display colours."""

import zipfile

import numpy as np
import OpenImageIO as oiio
import pytest
from usd_recorder import QUAD, Recorder, load, said, write

import wavecomb
from wavecomb.usd import load_stage

BIND = '(prepend apiSchemas = ["MaterialBindingAPI"])'
ST = 'texCoord2f[] primvars:st = [(0,0),(1,0),(1,1),(0,1)] (interpolation = "vertex")'


def write_image(path, pixels, kind):
    pixels = np.ascontiguousarray(pixels)
    height, width, channels = pixels.shape
    out = oiio.ImageOutput.create(str(path))
    spec = oiio.ImageSpec(width, height, channels, kind)
    spec.attribute("oiio:UnassociatedAlpha", 1)
    assert out.open(str(path), spec) and out.write_image(pixels)
    out.close()


def surface(inputs, extra="", material=""):
    return f"""def Material "Mat" {{
        token outputs:surface.connect = </Mat/S.outputs:surface>
        {material}
        def Shader "S" {{
            uniform token info:id = "UsdPreviewSurface"
            {inputs}
            token outputs:surface
        }}
        {extra}
    }}
    def Mesh "M" {BIND} {{
        {QUAD}
        {ST}
        rel material:binding = </Mat>
    }}"""


def texture(inputs, output="rgb", st="</Mat/R.outputs:result>"):
    return f"""def Shader "T" {{
        uniform token info:id = "UsdUVTexture"
        {inputs}
        float2 inputs:st.connect = {st}
        float3 outputs:rgb
        float outputs:r
        float outputs:g
        float outputs:a
    }}
    def Shader "R" {{
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }}"""


def test_constants(tmp_path):
    scene, _ = load(
        tmp_path,
        surface(
            """color3f inputs:diffuseColor = (1, 0.5, 0.25)
            color3f inputs:emissiveColor = (3, 2, 1)
            float inputs:roughness = 0.25
            float inputs:metallic = 2
            float inputs:ior = 1.25
            float inputs:opacityThreshold = 0.5
            token inputs:opacityMode = "presence"
            int inputs:useSpecularWorkflow = 1"""
        ),
    )
    got = scene.material_of("M")
    assert got["program"] == "principled" and got["name"] == "/Mat"
    assert got["base_color"] == (1, 0.5, 0.25) and got["emission"] == (3, 2, 1)
    assert got["roughness"] == 0.25 and got["metallic"] == 1 and got["ior"] == 1.25
    assert got["opacity_threshold"] == 0.5 and got["presence"] and got["specular_workflow"]


def test_interface_inputs_through_node_graphs(tmp_path):
    scene, _ = load(
        tmp_path,
        surface(
            "color3f inputs:diffuseColor.connect = </Mat/G.outputs:out>\n"
            "float inputs:roughness.connect = </Mat.inputs:rough>",
            'def NodeGraph "G" { color3f inputs:tint.connect = </Mat.inputs:colour>\n'
            "color3f outputs:out.connect = </Mat/G.inputs:tint> }",
            "color3f inputs:colour = (0.5, 0.25, 1)\nfloat inputs:rough = 0.75",
        ),
    )
    got = scene.material_of("M")
    assert got["base_color"] == (0.5, 0.25, 1) and got["roughness"] == 0.75


def test_texture_with_transform_scale_bias_and_wraps(tmp_path):
    write_image(tmp_path / "a.png", np.full((2, 4, 3), 128, np.uint8), "uint8")
    extra = texture(
        """asset inputs:file = @a.png@
        token inputs:wrapS = "repeat"
        token inputs:wrapT = "mirror"
        float4 inputs:scale = (2, 3, 4, 5)
        float4 inputs:bias = (0.5, 0, 0, 1)""",
        st="</Mat/X.outputs:result>",
    )
    extra += """def Shader "X" {
        uniform token info:id = "UsdTransform2d"
        float2 inputs:in.connect = </Mat/R.outputs:result>
        float inputs:rotation = 90
        float2 inputs:scale = (2, 4)
        float2 inputs:translation = (0.5, 0.25)
        float2 outputs:result }"""
    scene, _ = load(
        tmp_path, surface("color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>", extra)
    )
    use = scene.material_of("M")["textures"]["base_color"]
    assert use["channel"] == "rgb" and use["scale"] == (2, 3, 4, 5) and use["bias"][3] == 1
    assert use["uv"] == pytest.approx((0, -4, 0.5, 2, 0, 0.25))
    image = scene.textures[use["texture"]]
    assert image["pixels"].shape == (2, 4, 3) and image["srgb"]
    assert image["wrap"] == ("repeat", "mirror")
    assert scene.mesh("M")["uvs"].shape == (4, 2)


@pytest.mark.parametrize(
    ("channels", "kind", "space", "srgb", "dtype"),
    [
        (3, "uint8", None, True, np.uint8),
        (4, "uint8", "auto", True, np.uint8),
        (1, "uint8", "auto", False, np.uint8),
        (3, "uint8", "raw", False, np.uint8),
        (1, "uint8", "sRGB", True, np.uint8),
        (3, "uint16", "auto", False, np.float16),
        (3, "uint16", "sRGB", True, np.float16),
    ],
)
def test_colour_spaces(tmp_path, channels, kind, space, srgb, dtype):
    top = 255 if kind == "uint8" else 65535
    pixels = np.full((2, 2, channels), top // 2, kind)
    write_image(tmp_path / "a.png", pixels, kind)
    token = f'token inputs:sourceColorSpace = "{space}"' if space else ""
    scene, _ = load(
        tmp_path,
        surface(
            "color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>",
            texture(f"asset inputs:file = @a.png@\n{token}"),
        ),
    )
    image = scene.textures[0]
    assert image["pixels"].dtype == dtype and image["srgb"] == srgb
    if dtype == np.float16:
        assert image["pixels"][0, 0, 0] == pytest.approx(0.2140 if srgb else 0.5, abs=1e-3)
    assert scene.material_of("M")["textures"]["base_color"]["channel"] == "rgb"


def test_alpha_is_not_multiplied_in_and_channels_are_picked(tmp_path):
    write_image(tmp_path / "a.png", np.full((2, 2, 4), (200, 100, 50, 10), np.uint8), "uint8")
    scene, _ = load(
        tmp_path,
        surface(
            "color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>\n"
            "float inputs:opacity.connect = </Mat/T.outputs:a>\n"
            "float inputs:roughness.connect = </Mat/T.outputs:g>",
            texture("asset inputs:file = @a.png@"),
        ),
    )
    assert scene.textures[0]["pixels"][0, 0].tolist() == [200, 100, 50, 10]
    assert sum(t["pixels"].shape == (2, 2, 4) for t in scene.textures) == 1  # added once
    uses = scene.material_of("M")["textures"]
    assert {slot: use["channel"] for slot, use in uses.items()} == {
        "base_color": "rgb",
        "opacity": "a",
        "roughness": "g",
    }


def test_alpha_of_an_image_without_is_one(tmp_path):
    write_image(tmp_path / "a.png", np.zeros((2, 2, 3), np.uint8), "uint8")
    scene, _ = load(
        tmp_path,
        surface(
            "float inputs:opacity.connect = </Mat/T.outputs:a>",
            texture("asset inputs:file = @a.png@"),
        ),
    )
    assert scene.material_of("M")["opacity"] == 1


def test_missing_textures_show(tmp_path):
    (tmp_path / "broken.png").write_bytes(b"no image")
    base = "color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>"
    for name in ("gone.png", "broken.png"):
        scene, loaded = load(tmp_path, surface(base, texture(f"asset inputs:file = @./{name}@")))
        pixels = scene.textures[scene.material_of("M")["textures"]["base_color"]["texture"]]
        assert (pixels["pixels"][0, 0] == (255, 0, 255)).all()
        assert name in said(loaded) and "/Mat/T" in said(loaded)
    scene, _ = load(
        tmp_path,
        surface(
            base,
            texture("asset inputs:file = @gone.png@\nfloat4 inputs:fallback = (0.5, 1, 0, 1)"),
        ),
    )
    assert scene.material_of("M")["base_color"] == (0.5, 1, 0)


def test_udim_tiles_are_one_texture(tmp_path):
    write_image(tmp_path / "a.1001.png", np.full((2, 2, 3), 255, np.uint8), "uint8")
    write_image(tmp_path / "a.1012.png", np.zeros((4, 2, 3), np.uint8), "uint8")
    (tmp_path / "a.1013.png").write_bytes(b"no image")
    text = surface(
        "color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>",
        texture("asset inputs:file = @./a.<UDIM>.png@\nfloat4 inputs:fallback = (0, 0.5, 1, 1)"),
    )
    scene, loaded = load(tmp_path, text)
    use = scene.material_of("M")["textures"]["base_color"]
    tiled = scene.textures[use["texture"]]
    assert tiled["missing"] == (0, 0.5, 1, 1)
    heights = {n: scene.textures[i]["pixels"].shape[0] for n, i in tiled["tiles"].items()}
    assert heights == {1001: 2, 1012: 4} and "a.1013.png" in said(loaded)
    assert all(scene.textures[i]["wrap"] == ("clamp", "clamp") for i in tiled["tiles"].values())


def test_udim_names_start_at_the_layer_that_has_the_value(tmp_path):
    """A stronger layer may author metadata of the same attribute."""
    folder = tmp_path / "asset"
    folder.mkdir()
    write_image(folder / "a.1001.png", np.full((2, 2, 3), 255, np.uint8), "uint8")
    text = surface(
        "color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>",
        texture("asset inputs:file = @./a.<UDIM>.png@"),
    )
    write(folder, text)
    scene, loaded = load(
        tmp_path,
        """#usda 1.0
        ( subLayers = [@./asset/stage.usda@] )
        over "Mat" { over "T" { asset inputs:file ( colorSpace = "raw" )
        } }""",
    )
    (tiled,) = [one for one in scene.textures if "tiles" in one]
    assert tiled["name"] == str(folder / "a.<UDIM>.png") and not loaded.report.warnings


def test_udim_tiles_lie_side_by_side_in_the_picture(tmp_path):
    colours = {1001: (255, 0, 0), 1002: (0, 255, 0), 1011: (0, 0, 255)}
    for number, colour in colours.items():
        pixels = np.full((4, 4, 3), colour, np.uint8)
        write_image(tmp_path / f"a.{number}.png", pixels, "uint8")
    text = surface(
        "color3f inputs:emissiveColor.connect = </Mat/T.outputs:rgb>",
        texture("asset inputs:file = @./a.<UDIM>.png@\nfloat4 inputs:fallback = (0.5, 1, 0, 1)"),
        'custom token wavecomb:program = "emissive"',
    ).replace(ST, ST.replace("1", "2").replace("prim2", "prim1"))
    text += """def Camera "C" { float focalLength = 10
        float horizontalAperture = 10
        float verticalAperture = 10
        double3 xformOp:translate = (0.5, 0.5, 1)
        uniform token[] xformOpOrder = ["xformOp:translate"] }"""
    picture = wavecomb.render(write(tmp_path, text), size=(8, 8), spp=2).beauty
    # 1001 is at the lower left; 1012 is missing.
    assert picture[6, 1].tolist() == [1, 0, 0] and picture[6, 6].tolist() == [0, 1, 0]
    assert picture[1, 1].tolist() == [0, 0, 1] and picture[1, 6].tolist() == [0.5, 1, 0]


def test_udim_without_tiles_is_missing(tmp_path):
    scene, loaded = load(
        tmp_path,
        surface(
            "color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>",
            texture("asset inputs:file = @./gone.<UDIM>.png@"),
        ),
    )
    pixels = scene.textures[scene.material_of("M")["textures"]["base_color"]["texture"]]["pixels"]
    assert (pixels[0, 0] == (255, 0, 255)).all() and "gone.<UDIM>.png" in said(loaded)


def test_texture_in_a_package(tmp_path):
    write_image(tmp_path / "a.png", np.full((2, 2, 3), 7, np.uint8), "uint8")
    stage = write(
        tmp_path,
        surface(
            "color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>",
            texture("asset inputs:file = @a.png@"),
        ),
    )
    from pxr import Sdf

    with Sdf.ZipFileWriter.CreateNew(str(tmp_path / "p.usdz")) as package:
        package.AddFile(str(stage), "stage.usda")
        package.AddFile(str(tmp_path / "a.png"), "a.png")
    assert zipfile.is_zipfile(tmp_path / "p.usdz")
    (tmp_path / "a.png").unlink()
    scene = load_stage(tmp_path / "p.usdz", builder_factory=Recorder).scene
    assert scene.textures[0]["pixels"][0, 0].tolist() == [7, 7, 7]


def test_unconnected_coordinates_are_constant(tmp_path):
    write_image(tmp_path / "a.png", np.zeros((2, 2, 3), np.uint8), "uint8")
    extra = texture("asset inputs:file = @a.png@").replace(
        "float2 inputs:st.connect = </Mat/R.outputs:result>", ""
    )
    scene, _ = load(
        tmp_path, surface("color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>", extra)
    )
    use = scene.material_of("M")["textures"]["base_color"]
    assert use["uv"] == (0, 0, 0, 0, 0, 0)
    assert scene.textures[use["texture"]]["wrap"] == ("clamp", "clamp")


@pytest.mark.parametrize(
    "program", ["diffuse", "metal", "dielectric", "plastic", "emissive", "principled"]
)
def test_programs(tmp_path, program):
    scene, loaded = load(
        tmp_path,
        surface(
            "color3f inputs:emissiveColor = (2, 2, 2)\nfloat inputs:roughness = 0.25\n"
            "float inputs:ior = 1.25\ncolor3f inputs:specularColor = (0.5, 0.5, 0.5)",
            material=f'custom string wavecomb:program = "{program}"',
        ),
    )
    got = scene.material_of("M")
    assert got["program"] == program and not loaded.report.warnings
    assert ("emission" in got) == (program in ("emissive", "principled"))
    assert ("roughness" in got) == (program not in ("diffuse", "emissive"))
    assert ("ior" in got) == (program in ("dielectric", "plastic", "principled"))
    assert ("specular_color" in got) == (program in ("metal", "principled"))
    if program == "dielectric":
        assert got["base_color"] == (1, 1, 1)


def test_unknown_program(tmp_path):
    scene, loaded = load(tmp_path, surface("", material='custom string wavecomb:program = "glas"'))
    assert scene.material_of("M")["program"] == "principled"
    assert "'glas' is none of diffuse" in said(loaded)


def test_lamps_need_no_dome_and_glow_does(tmp_path):
    dark, _ = load(tmp_path, surface("color3f inputs:emissiveColor = (0.5, 0.5, 0.5)"))
    assert dark.lights
    bright, loaded = load(tmp_path, surface("color3f inputs:emissiveColor = (9, 9, 9)"))
    assert not bright.lights and "emissive" in said(loaded)


def looks(*names):
    return "".join(
        f"""def Material "{name}" {{
            token outputs:surface.connect = </{name}/S.outputs:surface>
            def Shader "S" {{ uniform token info:id = "UsdPreviewSurface"
                float inputs:roughness = {(k + 1) / 16}
                token outputs:surface }} }}
        """
        for k, name in enumerate(names)
    )


def bound_names(scene):
    return {mesh["name"]: scene.materials[mesh["material"]]["name"] for mesh in scene.meshes}


def test_inheritance_strength_purpose_and_collections(tmp_path):
    scene, _ = load(
        tmp_path,
        looks("A", "B", "C")
        + f"""
        def Xform "Weak" {BIND} {{ rel material:binding = </A>
            def Mesh "Own" {BIND} {{ {QUAD} rel material:binding = </B> }}
            def Mesh "Not" {{ {QUAD} }} }}
        def Xform "Strong" {BIND} {{
            rel material:binding = </A> (bindMaterialAs = "strongerThanDescendants")
            def Mesh "Own" {BIND} {{ {QUAD} rel material:binding = </B> }} }}
        def Mesh "Full" {BIND} {{ {QUAD}
            rel material:binding = </A>
            rel material:binding:full = </B>
            rel material:binding:preview = </C> }}
        def Mesh "Preview" {BIND} {{ {QUAD} rel material:binding:preview = </C> }}
        def Xform "Set" (prepend apiSchemas = ["MaterialBindingAPI", "CollectionAPI:few"]) {{
            rel collection:few:includes = </Set/In>
            rel material:binding:collection:few = [</Set.collection:few>, </C>]
            def Mesh "In" {{ {QUAD} }}
            def Mesh "Out" {{ {QUAD} }} }}
        """,
    )
    assert bound_names(scene) == {
        "/Weak/Own": "/B",
        "/Weak/Not": "/A",
        "/Strong/Own": "/A",
        "/Full": "/B",
        "/Preview": "/C",
        "/Set/In": "/C",
        "/Set/Out": "displayColor",
    }


def test_subsets(tmp_path):
    scene, _ = load(
        tmp_path,
        looks("A", "B")
        + f"""def Mesh "M" {BIND} {{
            point3f[] points = [(0,0,0), (1,0,0), (1,1,0), (0,1,0), (2,0,0), (2,1,0)]
            int[] faceVertexCounts = [4, 4]
            int[] faceVertexIndices = [0,1,2,3, 1,4,5,2]
            rel material:binding = </A>
            def GeomSubset "S" {BIND} {{
                uniform token elementType = "face"
                uniform token familyName = "materialBind"
                int[] indices = [1]
                rel material:binding = </B> }}
            def GeomSubset "Other" {{
                uniform token familyName = "else"
                int[] indices = [0] }} }}""",
    )
    faces = scene.mesh("M")["face_materials"]
    assert [scene.materials[i]["name"] for i in faces] == ["/A", "/A", "/B", "/B"]


def test_equal_materials_are_added_once(tmp_path):
    text = looks("A").replace('"A"', '"{n}"').replace("</A", "</{n}")
    both = "".join(text.replace("{n}", name) for name in ("A", "B"))
    scene, _ = load(
        tmp_path,
        both
        + f"""def Mesh "M" {BIND} {{ {QUAD} rel material:binding = </A> }}
        def Mesh "N" {BIND} {{ {QUAD} rel material:binding = </B> }}""",
    )
    assert len(scene.materials) == 1


def test_display_colours(tmp_path):
    scene, loaded = load(
        tmp_path,
        f"""
        def Mesh "Plain" {{ {QUAD} color3f[] primvars:displayColor = [(1, 0.5, 0.25)] }}
        def Mesh "Veil" {{ {QUAD} color3f[] primvars:displayColor = [(1, 0.5, 0.25)]
            float[] primvars:displayOpacity = [0.5] }}
        def Xform "Up" {{ color3f[] primvars:displayColor = [(0, 1, 0)]
            def Mesh "Below" {{ {QUAD} }} }}
        def Mesh "Points" {{ {QUAD}
            color3f[] primvars:displayColor = [(1,0,0), (1,0,0), (1,0,0), (0,0,1)] (
                interpolation = "vertex") }}
        def Mesh "None" {{ {QUAD} }}
        """,
    )
    assert scene.material_of("Plain")["base_color"] == (1, 0.5, 0.25)
    assert scene.material_of("Plain")["program"] == "diffuse"
    assert scene.material_of("Veil")["opacity"] == 0.5
    assert scene.material_of("Below")["base_color"] == (0, 1, 0)
    assert scene.material_of("None")["base_color"] == (0.5, 0.5, 0.5)
    rate, colours = scene.mesh("Points")["attributes"]["displayColor"]
    assert rate == "vertex" and colours.tolist() == [[1, 0, 0], [1, 0, 0], [1, 0, 0], [0, 0, 1]]
    assert scene.mesh("Plain")["attributes"] == {} and "displayColor" not in said(loaded)


def test_many_colours_become_few_materials(tmp_path):
    from wavecomb.usd.instances.instance_materials import MAX_COLOURS, quantise

    colours = np.random.default_rng(1).random((5000, 3))
    palette, index = quantise(colours)
    assert len(palette) <= MAX_COLOURS
    assert np.abs(palette[index] - colours).mean() < 0.12
    few = colours[:100]
    palette, index = quantise(few)
    assert palette[index] == pytest.approx(few)


def test_primvar_readers(tmp_path):
    reader = """def Shader "P" { uniform token info:id = "UsdPrimvarReader_float3"
        string inputs:varname = "tint"
        float3 inputs:fallback = (0.25, 0.25, 0.25)
        float3 outputs:result }"""
    text = surface("color3f inputs:diffuseColor.connect = </Mat/P.outputs:result>", reader)
    scene, _ = load(
        tmp_path,
        text
        + f"""def Mesh "Own" {BIND} {{ {QUAD} rel material:binding = </Mat>
            color3f[] primvars:tint = [(1, 0, 0.5)] }}""",
    )
    assert scene.material_of("/M")["base_color"] == (0.25, 0.25, 0.25)
    assert scene.material_of("/Own")["base_color"] == (1, 0, 0.5)


@pytest.mark.parametrize(
    ("identifier", "inputs", "program", "expected"),
    [
        (
            "ND_standard_surface_surfaceshader",
            "color3f inputs:base_color = (1, 0.5, 0)\nfloat inputs:base = 0.5\n"
            "float inputs:metalness = 1\nfloat inputs:specular_roughness = 0.25",
            "openpbr",
            {"base_color": (0.5, 0.25, 0), "metallic": 1, "roughness": 0.25},
        ),
        (
            "ND_open_pbr_surface_surfaceshader",
            "float inputs:transmission_weight = 1\nfloat inputs:specular_ior = 1.25\n"
            "float inputs:specular_roughness = 0\n"
            "color3f inputs:transmission_color = (0.5, 1, 1)",
            "openpbr",
            {
                "ior": 1.25,
                "roughness": 0,
                "openpbr": {"transmission_weight": 1, "transmission_color": (0.5, 1, 1)},
            },
        ),
        (
            "ND_gltf_pbr_surfaceshader",
            "color3f inputs:base_color = (1, 0.5, 0)\nfloat inputs:metallic = 0\n"
            "float inputs:roughness = 0.5\nfloat inputs:clearcoat = 0.5",
            "openpbr",
            {"base_color": (1, 0.5, 0), "metallic": 0, "roughness": 0.5, "clearcoat": 0.5},
        ),
        (
            "ND_UsdPreviewSurface_surfaceshader",
            "color3f inputs:diffuseColor = (1, 0.5, 0)",
            "principled",
            {"base_color": (1, 0.5, 0)},
        ),
    ],
)
def test_materialx_constants(tmp_path, identifier, inputs, program, expected):
    text = surface(inputs).replace("UsdPreviewSurface", identifier)
    if identifier == "ND_UsdPreviewSurface_surfaceshader":
        text = surface(inputs).replace('"UsdPreviewSurface"', f'"{identifier}"')
    text = text.replace("token outputs:surface.connect", "token outputs:mtlx:surface.connect")
    scene, loaded = load(tmp_path, text)
    got = scene.material_of("M")
    assert got["program"] == program
    for key, value in expected.items():
        if key == "openpbr":
            for layer, number in value.items():
                assert got[key][layer] == pytest.approx(number), layer
        else:
            assert got[key] == pytest.approx(value), key
    assert "MaterialX" not in said(loaded)


def test_materialx_metal_without_specular(tmp_path):
    """The specular weight of Standard Surface affects the edge tint of metal, not the metal."""
    text = surface("float inputs:metalness = 1\nfloat inputs:specular = 0")
    text = text.replace("UsdPreviewSurface", "ND_standard_surface_surfaceshader")
    scene, _ = load(tmp_path, text)
    assert scene.material_of("M")["openpbr"]["specular_weight"] == 1.0
    scene, _ = load(tmp_path, text.replace("metalness = 1", "metalness = 0"))
    assert scene.material_of("M")["openpbr"]["specular_weight"] == 0.0


@pytest.mark.parametrize(("anisotropy", "brushed"), [(0.5, True), (0.0, False)])
def test_brushed_metal_has_a_direction_without_a_texture(tmp_path, anisotropy, brushed):
    text = surface(f"float inputs:specular_anisotropy = {anisotropy}")
    scene, _ = load(
        tmp_path, text.replace("UsdPreviewSurface", "ND_standard_surface_surfaceshader")
    )
    assert (scene.mesh("M")["uvs"] is not None) == brushed


def test_materialx_layers(tmp_path):
    """Standard Surface inputs follow its published translation to OpenPBR or are reported."""
    text = surface(
        """float inputs:sheen = 0.5
        float inputs:thin_film_thickness = 300
        float inputs:coat_affect_color = 0.25
        float inputs:specular_anisotropy = 0.5
        float inputs:subsurface = 0.75
        bool inputs:thin_walled = true
        float inputs:transmission_dispersion = 20
        float inputs:diffuse_roughness.connect = </Mat/I.outputs:out>""",
        """def Shader "I" { uniform token info:id = "ND_image_float"
        float inputs:default = 0.125
        float outputs:out }""",
    ).replace("UsdPreviewSurface", "ND_standard_surface_surfaceshader")
    scene, loaded = load(tmp_path, text)
    layers = scene.material_of("M")["openpbr"]
    assert layers["fuzz_weight"] == 0.5 and layers["fuzz_roughness"] == pytest.approx(0.3)
    assert layers["film_weight"] == 1 and layers["film_thickness"] == 300
    assert layers["coat_darkening"] == 0.25 and layers["anisotropy"] == 0.5
    assert layers["thin_walled"] is True
    assert layers["diffuse_roughness"] == 0.125
    told = said(loaded)
    assert layers["subsurface_radius"] == (1, 1, 1)
    assert "/Mat" in told
    assert "transmission_dispersion (ignored)" in told
    assert "diffuse_roughness" not in told


def test_gltf_glass_is_a_wall_or_absorbs(tmp_path):
    glass = """float inputs:transmission = 1
        color3f inputs:attenuation_color = (0.5, 1, 0.5)
        float inputs:attenuation_distance = 2
        float inputs:thickness = {}"""
    found = []
    for thickness in (0, 1):
        text = surface(glass.format(thickness))
        text = text.replace("UsdPreviewSurface", "ND_gltf_pbr_surfaceshader")
        scene, _ = load(tmp_path, text)
        found.append(scene.material_of("M")["openpbr"])
    wall, solid = found
    assert wall["thin_walled"] and wall["transmission_depth"] == 0
    assert not solid["thin_walled"] and solid["transmission_depth"] == 2
    assert solid["transmission_color"] == pytest.approx((0.5, 1, 0.5))


def test_materialx_image(tmp_path):
    write_image(tmp_path / "a.png", np.zeros((2, 2, 3), np.uint8), "uint8")
    text = surface(
        "color3f inputs:base_color.connect = </Mat/I.outputs:out>",
        """def Shader "I" { uniform token info:id = "ND_tiledimage_color3"
        asset inputs:file = @a.png@
        float2 inputs:uvtiling = (2, 3)
        color3f outputs:out }""",
    ).replace("UsdPreviewSurface", "ND_standard_surface_surfaceshader")
    scene, _ = load(tmp_path, text)
    use = scene.material_of("M")["textures"]["base_color"]
    assert use["uv"] == (2, 0, 0, 0, 3, 0)
    assert scene.textures[use["texture"]]["srgb"]


def test_foreign_surfaces_are_grey_and_listed(tmp_path):
    text = surface("").replace('"UsdPreviewSurface"', '"PxrSurface"')
    scene, loaded = load(tmp_path, text)
    assert scene.material_of("M")["base_color"] == (0.5, 0.5, 0.5)
    assert "PxrSurface" in said(loaded)


def test_alpha_of_two_channels_is_the_second_and_tints_stay(tmp_path):
    write_image(tmp_path / "a.png", np.full((2, 2, 2), (200, 10), np.uint8), "uint8")
    scene, _ = load(
        tmp_path,
        surface(
            "color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>\n"
            "float inputs:opacity.connect = </Mat/T.outputs:a>",
            texture("asset inputs:file = @a.png@\nfloat4 inputs:scale = (1, 0.5, 0, 1)"),
        ),
    )
    uses = scene.material_of("M")["textures"]
    # One channel is stored for rgb and a second for alpha (see TextureDesc).
    assert uses["opacity"]["channel"] == "a" and uses["base_color"]["channel"] == "rgb"
    assert uses["base_color"]["scale"] == (1, 0.5, 0, 1)


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        ('token inputs:sourceColorSpace = "sRGB"', "sourceColorSpace is sRGB"),
        ("float4 inputs:bias = (-1, 1, -1, 0)", "sourceColorSpace is not raw"),
        ('token inputs:sourceColorSpace = "raw"', ""),
    ],
)
def test_normal_maps_are_never_srgb(tmp_path, extra, words):
    write_image(tmp_path / "n.png", np.full((2, 2, 3), (128, 128, 255), np.uint8), "uint8")
    scene, loaded = load(
        tmp_path,
        surface(
            "normal3f inputs:normal.connect = </Mat/T.outputs:rgb>",
            texture(f"asset inputs:file = @n.png@\n{extra}\nfloat4 inputs:scale = (2, -2, 2, 1)"),
        ),
    )
    use = scene.material_of("M")["textures"]["normal"]
    assert not scene.textures[use["texture"]]["srgb"]
    assert use["scale"] == (2, -2, 2, 1)
    assert use["bias"] == ((-1, 1, -1, 0) if "bias" in extra else (0, 0, 0, 0))
    assert words in said(loaded) and (words or "normal map" not in said(loaded))


def test_constant_normal_is_a_map_of_one_texel(tmp_path):
    scene, _ = load(tmp_path, surface("normal3f inputs:normal = (0.6, 0, 0.8)"))
    use = scene.material_of("M")["textures"]["normal"]
    assert scene.textures[use["texture"]]["pixels"][0, 0].tolist() == pytest.approx([0.6, 0, 0.8])
    assert use["scale"] == (1, 1, 1, 1) and use["bias"] == (0, 0, 0, 0)
    scene, _ = load(tmp_path, surface("normal3f inputs:normal = (0, 0, 1)"))
    assert scene.material_of("M")["textures"] == {}


@pytest.mark.parametrize(
    ("attributes", "inputs", "wraps"),
    [
        ({}, "", ("black", "black")),
        ({"wrapS": "repeat", "wrapT": "mirror"}, "", ("repeat", "mirror")),
        (
            {"wrapmodes": "periodic,clamp"},
            'token inputs:wrapS = "useMetadata"',
            ("repeat", "clamp"),
        ),
        ({"wrapS": "repeat"}, 'token inputs:wrapS = "clamp"', ("clamp", "black")),
        ({"wrapS": "repeat"}, 'token inputs:wrapS = "tiled"', ("repeat", "black")),
    ],
)
def test_wraps_of_the_file(tmp_path, attributes, inputs, wraps):
    out = oiio.ImageOutput.create(str(tmp_path / "a.exr"))
    spec = oiio.ImageSpec(2, 2, 3, "half")
    for name, value in attributes.items():
        spec.attribute(name, value)
    assert out.open(str(tmp_path / "a.exr"), spec)
    assert out.write_image(np.zeros((2, 2, 3), np.float32))
    out.close()
    scene, loaded = load(
        tmp_path,
        surface(
            "color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>",
            texture(f"asset inputs:file = @a.exr@\n{inputs}"),
        ),
    )
    assert scene.textures[0]["wrap"] == wraps
    assert ("no wrap mode" in said(loaded)) == ("tiled" in inputs)


def test_auto_asks_the_file(tmp_path):
    def one(kind, colour_space, name):
        out = oiio.ImageOutput.create(str(tmp_path / name))
        spec = oiio.ImageSpec(2, 2, 3, kind)
        spec.attribute("oiio:ColorSpace", colour_space)
        assert out.open(str(tmp_path / name), spec)
        assert out.write_image(np.full((2, 2, 3), 0.5, np.float32))
        out.close()
        scene, _ = load(
            tmp_path,
            surface(
                "color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>",
                texture(f"asset inputs:file = @{name}@"),
            ),
        )
        return scene.textures[0]

    tagged = one("uint16", "srgb_rec709_scene", "a.tif")  # writes Exif:ColorSpace
    assert tagged["srgb"] and tagged["pixels"][0, 0, 0] == pytest.approx(0.2140, abs=1e-3)
    assert not one("uint8", "lin_rec709_scene", "a.png")["srgb"]


def test_files_with_the_same_bytes_are_one_texture(tmp_path):
    write_image(tmp_path / "a.png", np.full((2, 2, 3), 9, np.uint8), "uint8")
    (tmp_path / "b.png").write_bytes((tmp_path / "a.png").read_bytes())
    other = texture("asset inputs:file = @b.png@").replace('"T"', '"U"').split('def Shader "R"')[0]
    scene, _ = load(
        tmp_path,
        surface(
            "color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>\n"
            "color3f inputs:emissiveColor.connect = </Mat/U.outputs:rgb>",
            texture("asset inputs:file = @a.png@") + other,
        ),
    )
    uses = scene.material_of("M")["textures"]
    images = [one for one in scene.textures if one["pixels"].dtype == np.uint8]
    assert len(images) == 1
    assert uses["base_color"]["texture"] == uses["emission"]["texture"] == 0


@pytest.mark.parametrize(
    ("space", "stored", "linear"),
    [
        # Computed from the primaries of each space with the published matrices to Rec.709 (D65).
        ("acescg", (255, 0, 0), (1.70505, -0.13026, -0.02400)),
        ("lin_p3d65_scene", (255, 0, 0), (1.22494, -0.04206, -0.01964)),
        ("g22_rec709_scene", (128, 255, 0), ((128 / 255) ** 2.2, 1, 0)),
        ("lin_rec709_scene", (51, 255, 0), (0.2, 1, 0)),
    ],
)
def test_colour_spaces_of_files_and_values(tmp_path, space, stored, linear):
    write_image(tmp_path / "a.png", np.full((2, 2, 3), stored, np.uint8), "uint8")
    value = tuple(v / 255 for v in stored)
    scene, _ = load(
        tmp_path,
        surface(
            "color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>\n"
            f'color3f inputs:emissiveColor = {value} (colorSpace = "{space}")',
            texture(f'asset inputs:file = @a.png@ (colorSpace = "{space}")'),
        ),
    )
    image = scene.textures[0]
    pixels = image["pixels"].astype(np.float32)
    if image["pixels"].dtype == np.uint8:
        pixels /= 255
    assert pixels[0, 0].tolist() == pytest.approx(linear, abs=2e-3) and not image["srgb"]
    assert scene.material_of("M")["emission"] == pytest.approx(linear, abs=1e-4)


def test_unknown_colour_space_is_named(tmp_path):
    _, loaded = load(
        tmp_path, surface('color3f inputs:diffuseColor = (1, 0, 0) (colorSpace = "my_film")')
    )
    assert "colour space my_film" in said(loaded)
