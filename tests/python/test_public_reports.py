# SPDX-License-Identifier: Apache-2.0
"""Tests bug reports of other USD programs with small stages (docs/testing.md)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from parts import needs

import wavecomb
from wavecomb.image.files.image import write_png, write_png_codes

pytestmark = needs("wavecomb._core")

RED, GREEN, BLUE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
BLACK, WHITE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
QUAD = """
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
"""
ST = 'texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] ( interpolation = "vertex" )'
RESET = '"!resetXformStack!"'
BOUND = 'prepend apiSchemas = ["MaterialBindingAPI"]'


def move(x: float, y: float = 0.0, z: float = 0.0) -> str:
    order = 'uniform token[] xformOpOrder = ["xformOp:translate"]'
    return f"double3 xformOp:translate = ({x}, {y}, {z})\n{order}"


def material(
    name: str, colour: tuple[float, float, float], inputs: str = "", nodes: str = ""
) -> str:
    """Returns a material that emits a colour and reflects nothing."""
    emission = "" if "emissiveColor" in inputs else f"color3f inputs:emissiveColor = {colour}"
    return f"""
    def Material "{name}" {{
        token outputs:surface.connect = </World/{name}/S.outputs:surface>
        def Shader "S" {{
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (0, 0, 0)
            int inputs:useSpecularWorkflow = 1
            color3f inputs:specularColor = (0, 0, 0)
            float inputs:roughness = 1
            {emission}
            {inputs}
            token outputs:surface
        }}
        {nodes}
    }}
    """


LOOKS = material("Red", RED) + material("Blue", BLUE) + material("Green", GREEN)


def shot(
    folder: Path,
    body: str,
    *,
    across: float = 4.0,
    size: tuple[int, int] = (16, 16),
    aovs: tuple[str, ...] = ("albedo", "normal", "depth", "alpha"),
    lights: str = 'def DomeLight "Dark" {\n float inputs:intensity = 0\n}',
    camera: str = "",
    **settings: Any,
) -> wavecomb.Picture:
    """Renders along -z a square of the given width. Each pixel has one colour."""
    high = across * size[1] / size[0]
    path = folder / "stage.usda"
    path.write_text(f"""#usda 1.0
(
    upAxis = "Y"
    metersPerUnit = 1
    defaultPrim = "World"
)
def Xform "World" {{
    def Camera "Camera" {{
        token projection = "orthographic"
        float horizontalAperture = {10 * across}
        float verticalAperture = {10 * high}
        float2 clippingRange = (0.01, 1000)
        {camera or move(0, 0, 50)}
    }}
    {lights}
    {body}
}}
""")
    plain: dict[str, Any] = {"spp": 16, "filter": "box", "max_depth": 4}
    return wavecomb.render(path, size=size, aovs=aovs, **(plain | settings))


def at(layer: Any, x: float, y: float, across: float = 4.0) -> Any:
    """Returns the pixel at a point of the plane z = 0."""
    height, width = layer.shape[:2]
    column = int((x / across + 0.5) * width)
    row = int((0.5 - y / (across * height / width)) * height)
    return layer[row, column]


def same(found: Any, colour: Any, tolerance: float = 0.02) -> None:
    assert np.asarray(found) == pytest.approx(np.asarray(colour), abs=tolerance)


def test_collections_bind_inside_instances(tmp_path: Path) -> None:
    """OpenUSD 3484: collection bindings inside instances."""
    body = f"""{LOOKS}
    class Xform "Shape" {{
        def Cube "Box" ( {BOUND} ) {{
            double size = 0.8
            rel material:binding = </World/Red>
        }}
    }}
    def Xform "One" ( instanceable = true
        references = </World/Shape> ) {{
        {move(-1)}
    }}
    def Xform "Two" ( instanceable = true
        references = </World/Shape>
        prepend apiSchemas = ["MaterialBindingAPI", "CollectionAPI:some"] ) {{
        {move(1)}
        uniform token collection:some:expansionRule = "expandPrims"
        rel collection:some:includes = </World/Two/Box>
        rel material:binding:collection:some = [</World/Two.collection:some>, </World/Blue>] (
            bindMaterialAs = "strongerThanDescendants"
        )
    }}"""
    beauty = shot(tmp_path, body).beauty
    same(at(beauty, -0.9, 0.1), RED)
    same(at(beauty, 0.9, 0.1), BLUE)


def test_primvars_of_instances_inside_a_point_instancer(tmp_path: Path) -> None:
    """OpenUSD 3388: primvars of instances inside a point instancer."""
    body = f"""
    class Xform "Shape" {{
        def Cube "Box" {{
            double size = 0.8
        }}
    }}
    def PointInstancer "Many" {{
        point3f[] positions = [(0, 0, 0)]
        int[] protoIndices = [0]
        rel prototypes = </World/Many/Both>
        def Xform "Both" {{
            def Xform "One" ( instanceable = true
                references = </World/Shape> ) {{
                color3f[] primvars:displayColor = [(1, 0, 0)]
                {move(-1)}
            }}
            def Xform "Two" ( instanceable = true
                references = </World/Shape> ) {{
                color3f[] primvars:displayColor = [(0, 0, 1)]
                {move(1)}
            }}
        }}
    }}"""
    albedo = shot(tmp_path, body).albedo
    same(at(albedo, -0.9, 0.1), RED)
    same(at(albedo, 0.9, 0.1), BLUE)


def test_materials_below_prototypes(tmp_path: Path) -> None:
    """OpenUSD 3483: materials below the scope of the prototypes; one prototype is not used."""
    look = material("Blue", BLUE).replace("/World/Blue", "/World/Many/Prototypes/Blue")
    ball = f"""( {BOUND} ) {{
                rel material:binding = </World/Many/Prototypes/Blue>
                def Sphere "Ball" {{
                }}
            }}"""
    body = f"""def PointInstancer "Many" {{
        point3f[] positions = [(0, 0, 0)]
        int[] protoIndices = [0]
        rel prototypes = [</World/Many/Prototypes/Used>]
        def Scope "Prototypes" {{
            def Xform "Used" {ball}
            def Xform "Unused" {ball}
            {look}
        }}
    }}"""
    same(at(shot(tmp_path, body).beauty, 0.2, 0.2), BLUE)


def test_primvars_of_several_prototypes(tmp_path: Path) -> None:
    """arnold-usd 759: primvar values belong to instances, not to positions within a prototype."""
    body = """def PointInstancer "Many" {
        point3f[] positions = [(-1, 1, 0), (1, 1, 0), (-1, -1, 0), (1, -1, 0)]
        int[] protoIndices = [1, 0, 0, 1]
        color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)] (
            interpolation = "vertex"
        )
        rel prototypes = [</World/Many/A>, </World/Many/B>]
        def Cube "A" {
            double size = 0.8
        }
        def Sphere "B" {
            double radius = 0.6
        }
    }"""
    albedo = shot(tmp_path, body).albedo
    for place, colour in (((-1, 1), RED), ((1, 1), GREEN), ((-1, -1), BLUE), ((1, -1), WHITE)):
        same(at(albedo, *(0.9 * np.array(place))), colour)


def bound(look: str, primvars: str = ST) -> str:
    """Returns a square with a material."""
    binding = f"rel material:binding = </World/{look}>"
    return f'def Mesh "Quad" ( {BOUND} ) {{ {QUAD}\n{primvars}\n{binding}\n}}'


@pytest.mark.parametrize("channels", [3, 4])
def test_opacity_of_an_image(channels: int, tmp_path: Path) -> None:
    """OpenUSD 1338: an image without alpha is opaque; otherwise its alpha applies."""
    alpha = np.ones((8, 8), np.float32)
    alpha[:, :4] = 0
    white = np.ones((8, 8, 3), np.float32)
    write_png(tmp_path / "a.png", white, alpha=alpha if channels == 4 else None)
    nodes = """
        def Shader "T" {
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @a.png@
            float2 inputs:st.connect = </World/Cut/R.outputs:result>
            float outputs:a
        }
        def Shader "R" {
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }"""
    inputs = "float inputs:opacity.connect = </World/Cut/T.outputs:a>\nfloat inputs:ior = 1"
    cut = material("Cut", RED, inputs + '\ntoken inputs:opacityMode = "presence"', nodes)
    body = cut + bound("Cut")
    beauty = shot(tmp_path, body).beauty
    same(at(beauty, 0.6, 0), RED)
    same(at(beauty, -0.6, 0), BLACK if channels == 4 else RED)


@pytest.mark.parametrize("kind", ["normal3d", "normal3f", "float3"])
def test_indexed_normals(kind: str, tmp_path: Path) -> None:
    """OpenUSD 2070, arnold-usd 1483: indexed normals of any type, with fewer values than points."""
    tilt = (0.6, 0.0, 0.8)
    for interpolation in ("vertex", "faceVarying"):
        body = f"""def Mesh "Quad" {{ {QUAD}
            {kind}[] primvars:normals = [(0, 0, 1), {tilt}] ( interpolation = "{interpolation}" )
            int[] primvars:normals:indices = [1, 1, 1, 1]
        }}"""
        same(at(shot(tmp_path, body).normal, 0.3, 0.3), tilt)


def test_the_primvar_goes_before_the_attribute(tmp_path: Path) -> None:
    """maya-usd 826: primvars:normals takes precedence over normals."""
    body = f"""def Mesh "Quad" {{ {QUAD}
        normal3f[] normals = [(0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1)]
        normal3f[] primvars:normals = [(0.6, 0, 0.8)] ( interpolation = "faceVarying" )
        int[] primvars:normals:indices = [0, 0, 0, 0]
    }}"""
    same(at(shot(tmp_path, body).normal, 0.3, 0.3), (0.6, 0, 0.8))


@pytest.mark.parametrize("rule", ["all", "none"])
def test_face_varying_coordinates_of_subdivided_meshes(rule: str, tmp_path: Path) -> None:
    """arnold-usd 632: the rule of a mesh determines the interpolation at the boundary of seams."""
    body = f"""def Mesh "Quads" {{
        int[] faceVertexCounts = [4, 4]
        int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4]
        point3f[] points = [(-1.5, -1.5, 0), (0, -1.5, 0), (1.5, -1.5, 0), (-1.5, 1.5, 0),
            (0, 1.5, 0), (1.5, 1.5, 0)]
        uniform token interpolateBoundary = "edgeAndCorner"
        uniform token faceVaryingLinearInterpolation = "{rule}"
        color3f[] primvars:displayColor = [(1, 0, 0), (0, 0, 1)] ( interpolation = "faceVarying" )
        int[] primvars:displayColor:indices = [0, 0, 0, 0, 1, 1, 1, 1]
    }}"""
    albedo = shot(tmp_path, body, size=(16, 16)).albedo
    # The values of each side are constant, so no rule may blend them across the seam.
    same(at(albedo, -0.3, 0), RED)
    same(at(albedo, 0.3, 0), BLUE)


@pytest.mark.parametrize("kind", ["quath[] orientations", "quatf[] orientationsf"])
def test_orientations_of_instances(kind: str, tmp_path: Path) -> None:
    """arnold-usd 1776: a bar rotated by a right angle about z."""
    half = float(np.sqrt(0.5))
    body = f"""def PointInstancer "Many" {{
        point3f[] positions = [(0, 0, 0)]
        int[] protoIndices = [0]
        {kind} = [({half}, 0, 0, {half})]
        rel prototypes = </World/Many/Bar>
        def Cube "Bar" {{
            double size = 1
            float3 xformOp:scale = (3, 0.5, 0.5)
            uniform token[] xformOpOrder = ["xformOp:scale"]
        }}
    }}"""
    hit = np.isfinite(shot(tmp_path, body).depth)
    assert at(hit, 0.1, 1.2) and at(hit, 0.1, -1.2) and not at(hit, 1.2, 0.1)


@pytest.mark.parametrize("specifier", ["over", "class", "def"])
def test_prototypes_are_not_drawn_beside_their_instances(specifier: str, tmp_path: Path) -> None:
    """arnold-usd 904: prims below the instancer are not drawn themselves."""
    body = f"""def PointInstancer "Many" {{
        point3f[] positions = [(1, 0, 0)]
        int[] protoIndices = [0]
        rel prototypes = </World/Many/Box>
        {specifier} Cube "Box" {{
            double size = 0.8
        }}
    }}"""
    hit = np.isfinite(shot(tmp_path, body).depth)
    assert at(hit, 1.1, 0.1) and not at(hit, 0.1, 0.1)


def test_display_colours_are_inherited(tmp_path: Path) -> None:
    """maya-usd 327: display colours are inherited."""
    body = """def Xform "Group" {
        color3f[] primvars:displayColor = [(0, 0, 1)] ( interpolation = "constant" )
        def Xform "Inner" {
            def Cube "Box" {
            }
        }
    }"""
    same(at(shot(tmp_path, body).albedo, 0.2, 0.2), BLUE)


def test_varying_primvars_of_meshes(tmp_path: Path) -> None:
    """RadeonProRenderUSD pull 343, maya-usd pull 2107: varying colours and a constant opacity."""
    body = f"""def Mesh "Quad" {{ {QUAD}
        color3f[] primvars:displayColor = [(1, 0, 0), (0, 0, 1), (0, 0, 1), (1, 0, 0)] (
            interpolation = "varying"
        )
        float[] primvars:displayOpacity = [1] ( interpolation = "constant" )
    }}"""
    albedo = shot(tmp_path, body, across=2.0).albedo
    same(at(albedo, -0.95, 0, 2.0), (0.96875, 0, 0.03125))
    same(at(albedo, 0.95, 0, 2.0), (0.03125, 0, 0.96875))


def test_opacity_of_faces(tmp_path: Path) -> None:
    """maya-usd 1687, 1537: one opacity for each face."""
    body = """def Mesh "Quads" {
        int[] faceVertexCounts = [4, 4]
        int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4]
        uniform token subdivisionScheme = "none"
        point3f[] points = [(-1, -1, 0), (0, -1, 0), (1, -1, 0), (-1, 1, 0), (0, 1, 0), (1, 1, 0)]
        color3f[] primvars:displayColor = [(1, 1, 1)]
        float[] primvars:displayOpacity = [1, 0.25] ( interpolation = "uniform" )
    }"""
    white = 'def DomeLight "Dome" {\n}'
    picture = shot(tmp_path, body, spp=512, alpha=True, lights=white)
    alpha = picture.aovs["alpha"]
    same(at(alpha, -0.6, 0.2), 1.0)
    same(at(alpha, 0.6, 0.2), 0.25, 0.06)


def test_opacity_of_points(tmp_path: Path) -> None:
    """maya-usd 2753: vertex opacities are interpolated."""
    body = f"""def Mesh "Quad" {{ {QUAD}
        float[] primvars:displayOpacity = [0.25, 0.5, 1, 0.75] ( interpolation = "vertex" )
    }}"""
    picture = shot(tmp_path, body, spp=512, alpha=True, lights='def DomeLight "Dome" {\n}')
    same(at(picture.aovs["alpha"], -0.6, -0.6), 0.25 + 0.25 * 0.125 + 0.5 * 0.125, 0.08)
    same(at(picture.aovs["alpha"], 0.8, 0.8), 0.9, 0.1)


def textured(inputs: str, primvars: str = ST) -> str:
    nodes = f"""
        def Shader "T" {{
            uniform token info:id = "UsdUVTexture"
            {inputs}
            float2 inputs:st.connect = </World/Map/R.outputs:result>
            float3 outputs:rgb
        }}
        def Shader "R" {{
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }}"""
    link = "color3f inputs:emissiveColor.connect = </World/Map/T.outputs:rgb>"
    look = material("Map", RED, link, nodes)
    return look + bound("Map", primvars)


def test_a_scale_of_zero(tmp_path: Path) -> None:
    """OpenUSD 988: a texture with a scale of 0."""
    write_png_codes(tmp_path / "a.png", np.full((4, 4, 3), 255, np.uint8))
    for scale, colour in ((0, BLACK), (1, WHITE)):
        body = textured(
            f"asset inputs:file = @a.png@\nfloat4 inputs:scale = ({scale}, {scale}, {scale}, 1)"
        )
        same(at(shot(tmp_path, body).beauty, 0.3, 0.3), colour)


def test_fallback_without_a_file(tmp_path: Path) -> None:
    """maya-usd pull 1689: the fallback of a texture without a file."""
    body = textured("float4 inputs:fallback = (0, 0, 1, 1)")
    same(at(shot(tmp_path, body).beauty, 0.3, 0.3), BLUE)


@pytest.mark.parametrize(
    ("ops", "order", "place"),
    [
        # OpenUSD issue 194: an inverse op without its partner.
        ("double3 xformOp:translate = (-1, 0, 0)", '"!invert!xformOp:translate"', (1, 0)),
        # LightUSD issue 27: a pivot and its inverse.
        (
            "double3 xformOp:translate = (1, 0, 0)\ndouble3 xformOp:translate:pivot = (5, 5, 0)",
            '"xformOp:translate", "xformOp:translate:pivot", "!invert!xformOp:translate:pivot"',
            (1, 0),
        ),
        # maya-usd pull request 1426: a rotation about a pivot.
        (
            "double3 xformOp:translate:pivot = (1, 0, 0)\nfloat xformOp:rotateZ = 180",
            '"xformOp:translate:pivot", "xformOp:rotateZ", "!invert!xformOp:translate:pivot"',
            (2, 0),
        ),
        # OpenUSD issue 311: a reset of the transform stack.
        ("double3 xformOp:translate = (1, 0, 0)", RESET + ', "xformOp:translate"', (1, 0)),
    ],
)  # fmt: skip
def test_transforms(ops: str, order: str, place: tuple[int, int], tmp_path: Path) -> None:
    shift = move(0, 2) if "reset" in order else ""
    body = f"""def Xform "Above" {{ {shift}
        def Cube "Box" {{
            double size = 0.8
            {ops}
            uniform token[] xformOpOrder = [{order}]
        }}
    }}"""
    hit = np.isfinite(shot(tmp_path, body, across=6.0, size=(24, 24)).depth)
    rows, columns = np.nonzero(hit)
    x = (columns.mean() + 0.5) / 24 * 6 - 3
    y = 3 - (rows.mean() + 0.5) / 24 * 6
    assert (x, y) == pytest.approx(place, abs=0.13)


@pytest.mark.parametrize("kind", ["Capsule_1", "Cylinder_1"])
def test_two_radii(kind: str, tmp_path: Path) -> None:
    """OpenUSD 3113: a capsule or cylinder of radius 1 at the bottom and 0.3 at the top."""
    body = f"""def {kind} "Shape" {{
        double height = 2
        double radiusBottom = 1
        double radiusTop = 0.3
        uniform token axis = "Y"
    }}"""
    hit = np.isfinite(shot(tmp_path, body, size=(32, 32)).depth)
    assert at(hit, 0.8, -0.8) and not at(hit, 0.8, 0.8) and at(hit, 0.15, 0.9)
    assert not at(hit, 0.55, 0.9)
    assert at(hit, 0.05, -1.3) == (kind == "Capsule_1")


def test_implicit_shapes_from_inside(tmp_path: Path) -> None:
    """OpenUSD 3686: a camera inside a single-sided cube sees the cube's wall."""
    for sided in (0, 1):
        body = f"""def Cube "Room" {{
            double size = 10
            uniform bool doubleSided = {sided}
        }}"""
        depth = shot(tmp_path, body, camera=move(0, 0, 0)).depth
        assert depth == pytest.approx(np.full(depth.shape, 5.0), rel=1e-3)


@pytest.mark.parametrize("kind", ["DiskLight", "DistantLight"])
def test_common_inputs_of_lights(kind: str, tmp_path: Path) -> None:
    """LightUSD 250, arnold-usd 1051: exposure, colour and temperature of each kind of light."""

    def lit(inputs: str) -> Any:
        light = f'def {kind} "Light" {{\n{inputs}\n{move(0, 0, 3)}\n}}'
        body = (
            f'def Mesh "Quad" {{ {QUAD}\n color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)]\n}}'
        )
        return shot(tmp_path, body, lights=light, spp=256).beauty[5:11, 5:11].mean(axis=(0, 1))

    base = lit("float inputs:intensity = 10")
    assert base.min() > 0
    exposed = lit("float inputs:intensity = 10\nfloat inputs:exposure = 2")
    assert exposed == pytest.approx(4 * base, rel=0.02)
    tinted = lit("float inputs:intensity = 10\ncolor3f inputs:color = (1, 0.5, 0.25)")
    assert tinted == pytest.approx(base * (1, 0.5, 0.25), rel=0.02)
    off = lit("float inputs:intensity = 10\nfloat inputs:colorTemperature = 2000")
    assert off == pytest.approx(base, rel=0.02)
    warm = lit(
        "float inputs:intensity = 10\nfloat inputs:colorTemperature = 2000\n"
        "bool inputs:enableColorTemperature = 1"
    )
    assert warm[0] > 1.5 * base[0] and warm[2] < 0.3 * base[2]


def test_subsets_bind_materials(tmp_path: Path) -> None:
    """OpenUSD 542: subsets bind materials."""
    body = f"""{LOOKS}
    def Mesh "Quads" ( {BOUND} ) {{
        int[] faceVertexCounts = [4, 4]
        int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4]
        uniform token subdivisionScheme = "none"
        point3f[] points = [(-1, -1, 0), (0, -1, 0), (1, -1, 0), (-1, 1, 0), (0, 1, 0), (1, 1, 0)]
        rel material:binding = </World/Green>
        def GeomSubset "Left" ( {BOUND} ) {{
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [0]
            rel material:binding = </World/Red>
        }}
    }}"""
    beauty = shot(tmp_path, body).beauty
    same(at(beauty, -0.6, 0.2), RED)
    same(at(beauty, 0.6, 0.2), GREEN)


def test_an_input_that_follows_another_shaders(tmp_path: Path) -> None:
    """OpenUSD 3957: an input connected to another shader's input is read, or reported."""
    nodes = """
        def Shader "Other" {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:emissiveColor = (0, 0, 1)
            token outputs:surface
        }"""
    link = "color3f inputs:emissiveColor.connect = </World/Map/Other.inputs:emissiveColor>"
    look = material("Map", RED, link, nodes)
    body = look + bound("Map")
    picture = shot(tmp_path, body)
    lines = wavecomb.load(tmp_path / "stage.usda").report.lines()
    found = at(picture.beauty, 0.3, 0.3)
    assert found == pytest.approx(BLUE, abs=0.02) or any("emissiveColor" in line for line in lines)


def test_a_path_of_an_image_in_a_primvar(tmp_path: Path) -> None:
    """OpenUSD 2518: an image path in a primvar is read, or the input is reported."""
    write_png_codes(tmp_path / "a.png", np.full((4, 4, 3), (0, 0, 255), np.uint8))
    body = textured("asset inputs:file.connect = </World/Map/F.outputs:result>")
    reader = """def Shader "F" {
            uniform token info:id = "UsdPrimvarReader_string"
            string inputs:varname = "picture"
            string outputs:result
        }
        def Shader "R" """
    body = body.replace('def Shader "R" ', reader, 1)
    body = body.replace(ST, ST + "\nasset primvars:picture = @a.png@")
    picture = shot(tmp_path, body)
    lines = wavecomb.load(tmp_path / "stage.usda").report.lines()
    found = at(picture.beauty, 0.3, 0.3)
    assert found == pytest.approx(BLUE, abs=0.02) or any("file" in line for line in lines)
