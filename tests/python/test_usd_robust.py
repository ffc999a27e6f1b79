# SPDX-License-Identifier: Apache-2.0
"""Tests that bad input causes one clear error line, never a crash or a wrong image."""

import subprocess
import sys

import pytest
from parts import ASSETS, needs_asset
from usd_recorder import QUAD, Recorder, load, said, write

from wavecomb.usd import WavecombError, load_stage


def fails(path, words, **options):
    with pytest.raises(WavecombError, match=words) as caught:
        load_stage(path, builder_factory=Recorder, **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_missing_file(tmp_path):
    assert "nowhere.usd" in fails(tmp_path / "nowhere.usd", "no such file")


def test_folder(tmp_path):
    fails(tmp_path, "folder")


def test_not_a_usd_file(tmp_path):
    path = tmp_path / "notes.txt"
    path.write_text("hello")
    fails(path, "not a USD file")


@pytest.mark.parametrize("content", [b"", b"hello", b"PXR-USDC" + bytes(40), b"#usda 1.0\ndef {"])
@pytest.mark.parametrize("suffix", ["usd", "usda", "usdc", "usdz"])
def test_broken_usd_files(tmp_path, content, suffix):
    path = tmp_path / f"broken.{suffix}"
    path.write_bytes(content)
    fails(path, f"broken.{suffix}: cannot be read as USD")


def test_unknown_options(tmp_path):
    path = write(
        tmp_path,
        'def Xform "A" (variantSets = "look") { variantSet "look" = { "red" {} "blue" {} } }\n'
        'def Camera "Cam" {}',
    )
    assert "/Cam" in fails(path, "no camera /Nope", camera="/Nope")
    fails(path, "no purpose 'rendr'", purposes=("rendr",))
    fails(path, "frame", frame=float("nan"))
    fails(path, "blue", variants={"/A{look}": "green"})
    fails(path, "look", variants={"/A{paint}": "green"})
    fails(path, "no prim /B", variants={"/B{look}": "red"})
    load_stage(path, builder_factory=Recorder, variants={"/A{look}": "red"}, camera="Cam")


def test_empty_stage_renders_the_environment(tmp_path):
    scene, loaded = load(tmp_path, "")
    assert [light["kind"] for light in scene.lights] == ["dome"]
    assert scene.camera is not None and loaded.camera_path is None
    for words in (
        "nothing to draw",
        "no camera: framed what is drawn",
        "no light: added a soft dome",
    ):
        assert words in said(loaded)


MESH = 'def Mesh "Good" {{ {quad} }}\ndef Mesh "Bad" {{ {bad} }}'


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        (QUAD.replace("(1,1,0)", "(nan,1,0)"), "not finite"),
        (QUAD.replace("(1,1,0)", "(inf,1,0)"), "not finite"),
        (QUAD.replace("(1,1,0)", "(1e30,1,0)"), "too far"),
        (QUAD.replace("[0,1,2,3]", "[0,1,2,7]"), "out of range"),
        (QUAD.replace("[0,1,2,3]", "[0,1,2,-1]"), "out of range"),
        (QUAD.replace("[0,1,2,3]", "[0,1,2]"), "add up"),
        (QUAD.replace("[4]", "[-4]"), "negative"),
        (QUAD.replace("[4]", "[2147483647, 2147483647]"), "add up"),
        (
            QUAD + 'float3 xformOp:scale = (1,0,1)\nuniform token[] xformOpOrder=["xformOp:scale"]',
            "no inverse",
        ),
        (
            QUAD + "double3 xformOp:translate = (nan,0,1)\n"
            'uniform token[] xformOpOrder=["xformOp:translate"]',
            "no inverse",
        ),
        (
            QUAD + "float3 xformOp:scale = (nan,1,1)\n"
            'uniform token[] xformOpOrder=["xformOp:scale"]',
            "no inverse",
        ),
    ],
)
def test_bad_meshes_are_left_out_and_named(tmp_path, bad, words):
    scene, loaded = load(tmp_path, MESH.format(quad=QUAD, bad=bad))
    assert [mesh["name"] for mesh in scene.meshes] == ["/Good"]
    (line,) = [f.line() for f in loaded.report.warnings]
    assert "/Bad" in line and words in line


def test_zero_area_faces_are_kept(tmp_path):
    scene, loaded = load(
        tmp_path,
        f'def Mesh "M" {{ {QUAD.replace("(1,1,0)", "(0,0,0)").replace("(0,1,0)", "(0,0,0)")} }}',
    )
    assert len(scene.mesh("M")["indices"]) == 2
    assert not loaded.report.warnings


def test_mesh_without_anything(tmp_path):
    scene, loaded = load(tmp_path, 'def Mesh "M" {}')
    assert not scene.meshes and "mesh without faces: /M" in said(loaded)


BIND = '(prepend apiSchemas = ["MaterialBindingAPI"])'


@pytest.mark.parametrize(
    "network",
    [
        # A shader connected to itself, a cycle of node graphs, and connections to nothing.
        """def Shader "S" { uniform token info:id = "UsdPreviewSurface"
           float inputs:roughness.connect = </Mat/T.outputs:r>; token outputs:surface }
           def Shader "T" { uniform token info:id = "UsdUVTexture"
           float2 inputs:st.connect = </Mat/X.outputs:result>; float outputs:r }
           def Shader "X" { uniform token info:id = "UsdTransform2d"
           float2 inputs:in.connect = </Mat/X.outputs:result>; float2 outputs:result }""",
        """def Shader "S" { uniform token info:id = "UsdPreviewSurface"
           float inputs:roughness.connect = </Mat/A.outputs:r>; token outputs:surface }
           def NodeGraph "A" { float outputs:r.connect = </Mat/B.outputs:r> }
           def NodeGraph "B" { float outputs:r.connect = </Mat/A.outputs:r> }""",
        """def Shader "S" { uniform token info:id = "UsdPreviewSurface"
           float inputs:roughness.connect = </Mat/Nowhere.outputs:r>; token outputs:surface }""",
        """def Shader "S" { token outputs:surface }""",
        "",
    ],
)
def test_cyclic_and_dangling_networks_end(tmp_path, network):
    scene, _ = load(
        tmp_path,
        f"""def Material "Mat" {{
            token outputs:surface.connect = </Mat/S.outputs:surface>
            {network} }}
        def Mesh "M" {BIND} {{ {QUAD} rel material:binding = </Mat> }}""",
    )
    assert len(scene.meshes) == 1 and len(scene.materials) == 1


def test_binding_to_nothing(tmp_path):
    scene, _ = load(tmp_path, f'def Mesh "M" {BIND} {{ {QUAD} rel material:binding = </Nope> }}')
    assert scene.material_of("M")["program"] == "diffuse"


@pytest.mark.parametrize(
    "stage",
    [
        """def PointInstancer "P" { rel prototypes = </P>
            int[] protoIndices = [0]; point3f[] positions = [(0,0,0)] }""",
        """def Xform "A" { def PointInstancer "P" { rel prototypes = </A>
            int[] protoIndices = [0]; point3f[] positions = [(0,0,0)] } }""",
        """def PointInstancer "P" { rel prototypes = </Q>
            int[] protoIndices = [0]; point3f[] positions = [(0,0,0)] }
           def PointInstancer "Q" { rel prototypes = </P>
            int[] protoIndices = [0]; point3f[] positions = [(0,0,0)] }""",
    ],
)
def test_prototypes_that_contain_themselves(tmp_path, stage):
    _, loaded = load(tmp_path, stage)
    assert "prototype contains itself" in said(loaded)


def test_point_instancers_that_do_not_fit(tmp_path):
    scene, loaded = load(
        tmp_path,
        """
        def PointInstancer "NoPositions" { rel prototypes = </P>; int[] protoIndices = [0] }
        def PointInstancer "Index" { rel prototypes = </P>; int[] protoIndices = [0, 4, -1]
            point3f[] positions = [(0,0,0), (1,0,0), (2,0,0)]; quath[] orientations = [(1,0,0,0)]
            float3[] scales = [(1,1,1)]; int64[] ids = [1, 2]; int64[] invisibleIds = [7] }
        def PointInstancer "Gone" { rel prototypes = </Gone2>; int[] protoIndices = [0]
            point3f[] positions = [(0,0,0)] }
        def PointInstancer "Flat" { rel prototypes = </P>; int[] protoIndices = [0, 0]
            point3f[] positions = [(0,0,0), (nan,0,0)]; float3[] scales = [(1,0,1), (1,1,1)] }
        class "P" { def Cube "C" {} }
        """,
    )
    assert sum(len(child[1]) for child in scene.groups[0]["children"]) == 1
    text = said(loaded)
    for words in (
        "positions",
        "out of range",
        "orientations",
        "scales",
        "ids",
        "/Gone2",
        "inverse",
    ):
        assert words in text


def test_text_that_is_not_utf_8(tmp_path):
    path = tmp_path / "s.usda"
    path.write_bytes(b'#usda 1.0\ndef Mesh \xa0"M" {}')
    fails(path, "UTF-8|cannot be read as USD")


@pytest.mark.parametrize(
    ("prim", "left"),
    [
        (
            'def Cylinder "M" {{ float3[] height = [(0,0,1)]\n asset axis = @x@ }}',
            1,
        ),
        ('def Sphere "M" {{ string radius = "large" }}', 1),
        ('def Mesh "M" {{ {quad}\n token[] visibility = ["invisible"]\n int[] purpose = [1] }}', 1),
        ('def Mesh "M" {{ {quad}\n int[] orientation = [1] }}', 1),
        ('def Mesh "M" {{ {quad}\n string[] creaseIndices = ["a"]\n int creaseLengths = 2 }}', 1),
        ('def Mesh "M" {{ {quad}\n string primvars:displayColor = "red" }}', 1),
        (
            'def Mesh "M" {{ {quad}\n def GeomSubset "S" {{ string[] indices = ["a"]\n'
            'token[] elementType = ["face"]\n uniform token familyName = "materialBind" }} }}',
            1,
        ),
        ('def Camera "C" {{ float clippingRange = 3\n string focalLength = "x" }}', 0),
        (
            'def RectLight "L" {{ string inputs:shaping:cone:angle = "wide" }}',
            0,
        ),
        (
            'def PointInstancer "P" {{ rel prototypes = </Q>\n int[] protoIndices = [0]\n'
            'point3f[] positions = [(0,0,0)]\n float invisibleIds = 2\n string[] ids = ["f"]\n'
            'float3[] scales = [(inf, 0, nan)] }}\n def Scope "Q" {{}}',
            0,
        ),
        (
            'def PointInstancer "P" {{ rel prototypes = </Q>\n float[] protoIndices = [0]\n'
            "float2[] positions = [(0,0)] }}",
            0,
        ),
    ],
)
@pytest.mark.filterwarnings("error")
def test_values_of_other_types_than_the_schema_says(tmp_path, prim, left):
    scene, _ = load(tmp_path, prim.format(quad=QUAD))
    assert len(scene.meshes) == left


def test_creases_that_name_no_points_are_said(tmp_path):
    creases = (
        "int[] creaseIndices = [0, -7]\nint[] creaseLengths = [2]\nfloat[] creaseSharpnesses = [9]"
    )
    smooth = QUAD.replace('subdivisionScheme = "none"', 'subdivisionScheme = "loop"')
    scene, loaded = load(tmp_path, f'def Mesh "M" {{ {smooth}\n{creases} }}')
    assert len(scene.meshes) == 1
    assert "creases that name no points of the mesh: ignored: /M" in said(loaded)


def test_instancers_in_instancers_without_end(tmp_path):
    depth = 400
    text = "".join(
        f'def PointInstancer "P{i}" {{ rel prototypes = </P{i + 1}>\nint[] protoIndices = [0]\n'
        "point3f[] positions = [(0,0,0)] }\n"
        for i in range(depth)
    )
    _, loaded = load(tmp_path, text + f'def Cube "P{depth}" {{}}')
    assert "instances in instances, more than 100 deep: left out: /P" in said(loaded)


def test_prims_in_prims_a_thousand_deep(tmp_path):
    inside = 'def Cube "C" {\n}\n' + 'def Xform "I" (instanceable = true\nreferences = </R>) {\n}\n'
    scene, _ = load(
        tmp_path,
        'class Xform "R" {\ndef Cube "C" {\n}\n}\n'
        + 'def Xform "A" {\n' * 1500
        + inside
        + "}\n" * 1500,
    )
    assert len(scene.meshes) == 2


@pytest.mark.slow
def test_instances_that_multiply_take_no_step_each(tmp_path):
    """Sixty nested prototypes contain 2^60 cameras and lights."""
    text = ""
    for i in range(60):
        inside = "".join(
            f'def "C{j}" (instanceable = true\nreferences = </P{i + 1}>) {{}}\n' for j in range(2)
        )
        text += f'{"def" if i == 0 else "class"} Xform "P{i}" {{\n{inside}}}\n'
    leaf = 'class Xform "P60" {\ndef Camera "Cam" {}\ndef SphereLight "Bulb" {}\n}\n'
    _, loaded = load(tmp_path, text + leaf)
    assert len(loaded.cameras) + len(loaded.lights) == 4096
    assert loaded.camera_path == "/P0" + "/C0" * 60 + "/Cam"
    assert "more than 4096 lights" in said(loaded)


def test_more_instances_than_memory_holds(tmp_path):
    pytest.importorskip("wavecomb._core")
    count = 12
    text = "".join(
        f'def PointInstancer "P{i}" {{ rel prototypes = </P{i + 1}>\n'
        f"int[] protoIndices = {[0] * count}\n"
        f"point3f[] positions = {[(j, 0, i) for j in range(count)]} }}\n"
        for i in range(12)
    )
    path = write(tmp_path, text + 'def Cube "P12" {}')
    with pytest.raises(WavecombError, match=r"more than \d+ million instances"):
        load_stage(path)


def test_material_networks_with_endless_ways(tmp_path):
    """Every node uses the next one twice: 2^30 paths."""
    nodes = "".join(
        f'def Shader "N{i}" {{ uniform token info:id = "ND_multiply_color3"\n'
        f"color3f inputs:in1.connect = </Mat/N{i + 1}.outputs:out>\n"
        f"color3f inputs:in2.connect = </Mat/N{i + 1}.outputs:out>\n color3f outputs:out }}\n"
        for i in range(30)
    )
    surface = (
        'def Shader "S" { uniform token info:id = "ND_standard_surface_surfaceshader"\n'
        "color3f inputs:base_color.connect = </Mat/N0.outputs:out>\n token outputs:out }\n"
    )
    scene, _ = load(
        tmp_path,
        f"""def Material "Mat" {{
            token outputs:mtlx:surface.connect = </Mat/S.outputs:out>
            {surface} {nodes} }}
        def Mesh "M" {BIND} {{ {QUAD}
            rel material:binding = </Mat> }}""",
    )
    assert scene.material_of("M")["program"] == "openpbr"


@pytest.mark.slow
def test_composition_errors_are_lines_and_not_spilt(tmp_path):
    path = write(
        tmp_path,
        'def Xform "A" (references = @gone.usda@) {}\n'
        'def Xform "B" (references = </B>) {}\n'
        'def Xform "C" (payload = @gone.usda@</X>) {}',
    )
    code = (
        "import sys; sys.path[:0] = sys.argv[2:]\n"
        "from usd_recorder import Recorder\n"
        "from wavecomb.usd import load_stage\n"
        "print(*load_stage(sys.argv[1], builder_factory=Recorder).report.lines(), sep='\\n')"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(path), *sys.path],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr == ""
    assert "gone.usda" in done.stdout


def test_bad_cameras_and_lights(tmp_path):
    scene, loaded = load(
        tmp_path,
        """
        def Camera "Cam" { float focalLength = 0 }
        def SphereLight "Flat" { float3 xformOp:scale = (1, 0, 1)
            uniform token[] xformOpOrder = ["xformOp:scale"] }
        def SphereLight "Dark" { float inputs:intensity = nan }
        def SphereLight "Huge" { float inputs:exposure = 1e30 }
        def DiskLight "Fine" {}
        """,
    )
    assert loaded.camera_path is None
    assert "camera left out" in said(loaded) and "light left out" in said(loaded)
    assert [light["name"] for light in scene.lights] == ["/Dark", "/Huge", "/Fine"]
    assert scene.lights[0]["color"] == (0, 0, 0)


@pytest.mark.slow
@needs_asset("usd/Teapot/Teapot.usd")
@pytest.mark.parametrize("step", [21, pytest.param(1, marks=pytest.mark.long)])
def test_every_asset_loads(capfd, step):
    """Every test asset loads, or every 21st in short tests."""
    stages = [p for p in sorted((ASSETS / "usd").rglob("*.usd*")) if p.is_file()][::step]
    assert stages
    refused = []
    for path in stages:
        try:
            loaded = load_stage(path, builder_factory=Recorder)
        except WavecombError as error:
            refused.append(path.name)
            assert "cannot be read as USD" in str(error)
        else:
            assert loaded.scene.camera is not None and loaded.report.as_dict()
    # A few assets are invalid on purpose, and USD refuses them.
    assert len(refused) <= 8, refused
    out, err = capfd.readouterr()
    assert out == "" and err == ""
