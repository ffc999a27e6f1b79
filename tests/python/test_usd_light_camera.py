# SPDX-License-Identifier: Apache-2.0
"""Tests lights and cameras, and their defaults."""

import numpy as np
import OpenImageIO as oiio
import pytest
from pxr import Sdf, Usd
from usd_recorder import QUAD, Recorder, load, said

from wavecomb.usd import load_stage
from wavecomb.usd.lights.light import blackbody


def light(tmp_path, text, header=""):
    scene, loaded = load(tmp_path, (f"#usda 1.0\n({header})\n" if header else "") + text)
    (found,) = scene.lights
    return found, loaded


def test_colour_intensity_exposure_temperature(tmp_path):
    found, _ = light(
        tmp_path,
        """def RectLight "L" { float inputs:intensity = 3
        float inputs:exposure = 2
        color3f inputs:color = (1, 0.5, 0.25)
        bool inputs:enableColorTemperature = true
        float inputs:colorTemperature = 3000
        float inputs:width = 4
        float inputs:height = 5
        bool inputs:normalize = true }""",
    )
    warm = np.array(blackbody(3000))
    assert found["color"] == pytest.approx(12 * warm * (1, 0.5, 0.25))
    assert (found["kind"], found["width"], found["height"]) == ("rect", 4, 5)
    assert found["normalize"] and found["texture"] is None


@pytest.mark.parametrize("kelvin", [4000, 5000, 6500, 8750, 10000, 11000, 13000, 15000])
def test_colour_temperatures_are_those_of_black_bodies(kelvin):
    """Planckian locus from Kim's cubic splines for 4000 K and more, also above 10,000 K."""
    x = np.polyval([-3.0258469e9, 2.1070379e6, 0.2226347e3, 0.240390], 1 / kelvin)
    y = np.polyval([3.0817580, -5.87338670, 3.75112997, -0.37001483], x)
    from_xyz = np.linalg.inv(
        [[0.412391, 0.357584, 0.180481], [0.212639, 0.715169, 0.072192],
         [0.019331, 0.119195, 0.950532]]
    )  # fmt: skip
    expected = from_xyz @ (x / y, 1.0, (1 - x - y) / y)
    assert blackbody(kelvin) == pytest.approx(expected, rel=3e-3)


def test_colour_temperatures_agree_with_usdlux():
    """The colour agrees with UsdLux's table within 0.3 % of the largest channel."""
    from pxr import UsdLux

    for kelvin in range(2000, 10001, 250):
        table = np.array(UsdLux.BlackbodyTemperatureAsRgb(kelvin))
        assert np.abs(blackbody(kelvin) - table).max() < 3e-3 * table.max(), kelvin
    assert blackbody(500) == blackbody(1000)
    assert blackbody(40000) == blackbody(15000)


def test_schema_defaults(tmp_path):
    scene, _ = load(
        tmp_path,
        'def DistantLight "A" {} def DiskLight "B" {} def SphereLight "C" {} def DomeLight "D" {}',
    )
    a, b, c, d = scene.lights
    assert a["angle"] == pytest.approx(0.53) and a["color"] == (50000, 50000, 50000)
    assert b["radius"] == 0.5 and c["radius"] == 0.5
    assert d["kind"] == "dome" and d["color"] == (1, 1, 1)


def test_point_lights_keep_the_spheres_intensity(tmp_path):
    text = """def SphereLight "L" { float inputs:radius = 2
        bool treatAsPoint = true
        NORMALIZE
        float3 xformOp:scale = (3, 3, 3)
        uniform token[] xformOpOrder = ["xformOp:scale"] }"""
    found, _ = light(tmp_path, text.replace("NORMALIZE", ""))
    assert found["radius"] == 0 and found["color"][0] == pytest.approx(np.pi * 36)
    assert not found["normalize"]
    found, _ = light(tmp_path, text.replace("NORMALIZE", "bool inputs:normalize = true"))
    assert found["color"][0] == pytest.approx(0.25) and not found["normalize"]


def pole(found):
    return (np.array([0, 1, 0, 0]) @ found["transform"])[:3].round(6).tolist()


@pytest.mark.parametrize(
    ("up", "prim", "axis", "expected"),
    [
        ("Y", "DomeLight", None, [0, 1, 0]),
        ("Z", "DomeLight", None, [0, 1, 0]),
        ("Y", "DomeLight_1", None, [0, 1, 0]),
        ("Z", "DomeLight_1", None, [0, 0, 1]),
        ("Y", "DomeLight_1", "Z", [0, 0, 1]),
        ("Z", "DomeLight_1", "Y", [0, 1, 0]),
    ],
)
def test_dome_poles(tmp_path, up, prim, axis, expected):
    body = f'uniform token poleAxis = "{axis}"' if axis else ""
    found, _ = light(tmp_path, f'def {prim} "L" {{ {body} }}', f'upAxis = "{up}"')
    assert pole(found) == expected


def test_oriented_dome_is_where_usd_puts_it(tmp_path):
    found, _ = light(
        tmp_path,
        """def DomeLight "L" { double xformOp:rotateX:orientToStageUpAxis = 90
        uniform token[] xformOpOrder = ["xformOp:rotateX:orientToStageUpAxis"] }""",
        'upAxis = "Z"',
    )
    from wavecomb.usd.lights.dome import Y_TO_Z

    assert found["transform"] == pytest.approx(Y_TO_Z)


def test_dome_texture(tmp_path):
    out = oiio.ImageOutput.create(str(tmp_path / "sky.exr"))
    out.open(str(tmp_path / "sky.exr"), oiio.ImageSpec(4, 2, 3, "half"))
    out.write_image(np.full((2, 4, 3), 7, np.float32))
    out.close()
    scene, _ = load(tmp_path, 'def DomeLight "L" { asset inputs:texture:file = @sky.exr@ }')
    image = scene.textures[scene.lights[0]["texture"]]
    assert image["pixels"].dtype == np.float16 and not image["srgb"]
    scene, loaded = load(tmp_path, 'def DomeLight "L" { asset inputs:texture:file = @no.exr@ }')
    assert scene.lights[0]["texture"] is None and "no.exr" in said(loaded)


def test_hidden_lights_stay_off(tmp_path):
    scene, loaded = load(tmp_path, 'def DomeLight "L" { token visibility = "invisible" }')
    assert not scene.lights and "no visible light" in said(loaded)


def test_what_lights_ask_for_and_do_not_get(tmp_path):
    scene, loaded = load(
        tmp_path,
        """def PortalLight "Window" {}
        def BasisCurves "Glow" (prepend apiSchemas = ["LightAPI"]) {
            uniform token type = "linear"
            point3f[] points = [(0, 0, 0), (1, 0, 0)]
            int[] curveVertexCounts = [2]
            float[] widths = [0.1, 0.1] }
        def DomeLight "Sky" (prepend apiSchemas = ["ShapingAPI"]) {
            float inputs:shaping:focus = 2
            rel portals = [</Window>, </Glow>] }
        def RectLight "Spot" (prepend apiSchemas = ["ShadowAPI"]) {
            rel light:filters = </Window>
            color3f inputs:shadow:color = (1, 0, 0) }""",
    )
    listed = [finding.what for finding in loaded.report.unsupported]
    assert listed == [
        "shaping of DomeLights",
        "light filter PortalLight",
        "curves as lights (only their materials emit)",
    ]
    assert len(scene.lights) == 2 and "/Glow is not a PortalLight" in said(loaded)
    assert scene.lights[0]["portals"].shape == (1, 4, 4)


def test_portals_are_placed_by_their_own_transforms(tmp_path):
    scene, _ = load(
        tmp_path,
        """#usda 1.0
        (upAxis = "Z")
        def Xform "Room" {
            double3 xformOp:translate = (1, 2, 3)
            uniform token[] xformOpOrder = ["xformOp:translate"]
            def PortalLight "Window" { float inputs:width = 4
                float inputs:height = 5 } }
        def DomeLight_1 "Sky" { rel portals = </Room/Window>
            float xformOp:rotateX = 40
            uniform token[] xformOpOrder = ["xformOp:rotateX"] }""",
    )
    expected = np.diag((4.0, 5, 1, 1))
    expected[3, :3] = (1, 2, 3)
    assert np.allclose(scene.lights[0]["portals"], expected[None])


def test_mesh_lights(tmp_path):
    scene, loaded = load(
        tmp_path,
        f"""def Mesh "Glow" (prepend apiSchemas = ["MeshLightAPI"]) {{ {QUAD}
            float inputs:intensity = 3
            bool inputs:normalize = true
            rel collection:lightLink:excludes = </World/Floor>
            double3 xformOp:translate = (1, 2, 3)
            uniform token[] xformOpOrder = ["xformOp:translate"] }}
        def Mesh "Alone" (prepend apiSchemas = ["LightAPI"]) {{ {QUAD} }}
        def Mesh "Odd" (prepend apiSchemas = ["MeshLightAPI"]) {{ {QUAD}
            uniform token light:materialSyncMode = "loud" }}
        def Mesh "Plain" {{ {QUAD} }}""",
    )
    glow, alone, odd = scene.mesh_lights
    assert glow["sync"] == "materialGlowTintsLight" and glow["normalize"]
    assert glow["color"] == (3, 3, 3) and glow["name"] == "/Glow"
    assert scene.sets[glow["light_link"]] == {"/": "expand", "/World/Floor": "exclude"}
    assert np.array_equal(glow["transform"][3], (1, 2, 3, 1))
    assert alone["sync"] == odd["sync"] == "noMaterialResponse"
    assert [scene.mesh(name)["mesh_light"] for name in ("Glow", "Alone", "Plain")] == [0, 1, None]
    assert scene.material_of("Alone")["emission"] == (1, 1, 1)
    assert "unknown light:materialSyncMode loud" in said(loaded)
    # Mesh lights count as lights, so no default dome is added.
    assert not scene.lights and loaded.report.counts["mesh lights"] == 3


def test_shadows_may_be_off(tmp_path):
    found, loaded = light(
        tmp_path,
        """def RectLight "L" (prepend apiSchemas = ["ShadowAPI"]) {
            bool inputs:shadow:enable = false }""",
    )
    scene, _ = load(tmp_path, 'def RectLight "L" (prepend apiSchemas = ["ShadowAPI"]) {}')
    assert found["shadow_link"] == 0 and "shadow_link" not in scene.lights[0]
    assert not loaded.report.unsupported


def test_linking(tmp_path):
    scene, loaded = load(
        tmp_path,
        """def SphereLight "A" {
            uniform bool collection:lightLink:includeRoot = false
            rel collection:lightLink:includes = [</World/Ball>, </World/Box>]
            rel collection:lightLink:excludes = </World/Box/Lid>
            rel collection:shadowLink:excludes = </World/Floor>
        }
        def SphereLight "B" { rel collection:shadowLink:excludes = </World/Floor>
        }
        def SphereLight "C" { rel collection:lightLink:includes = </World/Floor>
        }""",
    )
    a, b, c = scene.lights
    assert scene.sets[a["light_link"]] == {
        "/World/Ball": "expand",
        "/World/Box": "expand",
        "/World/Box/Lid": "exclude",
    }
    assert scene.sets[a["shadow_link"]] == {"/": "expand", "/World/Floor": "exclude"}
    assert b["shadow_link"] == a["shadow_link"] and "light_link" not in b
    assert "light_link" not in c
    assert not loaded.report.unsupported


_EXPRESSIONS = """def DistantLight "A" {
    uniform bool collection:lightLink:includeRoot = 0
    pathExpression collection:lightLink:membershipExpression = "//hero* - //*Rim"
    uniform bool collection:shadowLink:includeRoot = 0
    pathExpression collection:shadowLink:membershipExpression = "//"
}
def DistantLight "B" {
    uniform bool collection:lightLink:includeRoot = 0
    pathExpression collection:lightLink:membershipExpression = "%/A:lightLink + //Ball"
}
def Xform "Set" {
    def Cube "heroBox" { def Cube "Inner" { }
        def Cube "BoxRim" { }
    }
    def Sphere "Ball" { }
    def Xform "One" ( instanceable = true
        references = </Model> ) { }
}
class Xform "Model" { def Cube "heroPart" { } }
def PointInstancer "heroes" {
    rel prototypes = </heroes/Leaf>
    int[] protoIndices = [0]
    point3f[] positions = [(0, 0, 0)]
    def Cube "Leaf" { }
}
"""


def test_links_by_membership_expression(tmp_path):
    scene, loaded = load(tmp_path, _EXPRESSIONS)
    a, b = scene.lights
    hero = {
        "/Set/heroBox": "expand",
        "/Set/heroBox/Inner": "exclude",
        "/Set/heroBox/BoxRim": "exclude",
        "/Set/One/heroPart": "expand",
        "/heroes": "expand",
    }
    assert scene.sets[a["light_link"]] == hero
    assert "shadow_link" not in a
    assert scene.sets[b["light_link"]] == {**hero, "/Set/Ball": "expand"}
    assert not loaded.report.warnings


def test_expressions_without_effect_are_told(tmp_path):
    found, loaded = light(
        tmp_path,
        """def SphereLight "L" {
            pathExpression collection:lightLink:membershipExpression = "/Box"
        }""",
    )
    assert "lightLink: its membershipExpression has no effect beside" in said(loaded)
    assert "/L" in said(loaded) and "light_link" not in found  # includeRoot is true


@pytest.mark.parametrize(
    ("predicate", "rules", "words"),
    [
        ("isa:Sphere", {"/Ball": "expand"}, ""),
        ("nothing:like", {}, "warning: lightLink: its membershipExpression cannot be evaluated"),
    ],
)
def test_predicates_of_expressions(tmp_path, predicate, rules, words):
    stage = Usd.Stage.CreateInMemory()
    stage.DefinePrim("/Ball", "Sphere")
    stage.DefinePrim("/Box", "Cube")
    prim = stage.DefinePrim("/L", "SphereLight")
    links = Usd.CollectionAPI(prim, "lightLink")
    links.CreateIncludeRootAttr(False)
    links.CreateMembershipExpressionAttr(Sdf.PathExpression(f"//{{{predicate}}}"))
    loaded = load_stage(stage, builder_factory=Recorder)
    scene = loaded.scene
    assert scene.sets[scene.lights[0]["light_link"]] == rules
    assert words in said(loaded) and ("warning" in said(loaded)) == bool(words)


def test_expressions_are_evaluated_at_so_many_prims(tmp_path, monkeypatch):
    """The number of visited prims is limited, since nested instances can make billions."""
    monkeypatch.setattr("wavecomb.usd.stage.collections.MAX_PRIMS", 5)
    scene, loaded = load(tmp_path, _EXPRESSIONS)
    assert "membershipExpression beyond 5 prims (cut there)" in said(loaded)
    first = {"/Set/heroBox", "/Set/heroBox/Inner"}
    assert set(scene.sets[scene.lights[0]["light_link"]]) == first


def test_expressions_behind_includes_are_told(tmp_path):
    found, loaded = light(
        tmp_path,
        """def Scope "S" (prepend apiSchemas = ["CollectionAPI:e"]) {
            pathExpression collection:e:membershipExpression = "/Box"
        }
        def SphereLight "L" {
            uniform bool collection:lightLink:includeRoot = 0
            rel collection:lightLink:includes = </S.collection:e>
        }""",
    )
    assert "lightLink includes /S.collection:e, which has a membershipExpression" in said(loaded)
    assert found["light_link"] == 0


def test_materials_by_membership_expression(tmp_path):
    scene, _ = load(
        tmp_path,
        """def Xform "Set" (prepend apiSchemas = ["MaterialBindingAPI", "CollectionAPI:red"]) {
            uniform bool collection:red:includeRoot = 0
            pathExpression collection:red:membershipExpression = ".//hero*"
            rel material:binding:collection:red = [</Set.collection:red>, </Red>]
            def Cube "hero" { }
            def Cube "other" { }
            def Xform "One" ( instanceable = true
                references = </Model> ) { }
        }
        class Xform "Model" { def Cube "heroPart" { } }
        def Material "Red" {
            token outputs:surface.connect = </Red/S.outputs:surface>
            def Shader "S" { uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor = (1, 0, 0)
                token outputs:surface
            }
        }""",
    )
    assert scene.material_of("/Set/hero")["base_color"] == (1, 0, 0)
    assert scene.material_of("/Set/other")["base_color"] != (1, 0, 0)
    assert scene.material_of("heroPart")["base_color"] == (1, 0, 0)


def test_cylinder_lights(tmp_path):
    text = """def CylinderLight "L" { float inputs:length = 3
        float inputs:radius = RADIUS
        bool inputs:normalize = NORMALIZE }"""
    found, loaded = light(tmp_path, text.replace("RADIUS", "0.2").replace("NORMALIZE", "false"))
    assert (found["kind"], found["length"], found["radius"]) == ("cylinder", 3, pytest.approx(0.2))
    assert not found["normalize"] and not loaded.report.unsupported
    found, loaded = light(tmp_path, text.replace("RADIUS", "0").replace("NORMALIZE", "false"))
    assert found["radius"] == pytest.approx(0.003) and found["normalize"]
    assert "radius 0" in said(loaded)


def test_shaping_and_multipliers(tmp_path):
    found, loaded = light(
        tmp_path,
        """def DiskLight "L" (prepend apiSchemas = ["ShapingAPI"]) {
        float inputs:shaping:focus = 2.5
        color3f inputs:shaping:focusTint = (1, 0.5, -1)
        float inputs:shaping:cone:angle = 35
        float inputs:shaping:cone:softness = 3
        float inputs:diffuse = 0.5
        float inputs:specular = 0 }""",
    )
    assert found["focus"] == 2.5 and found["focus_tint"] == (1, 0.5, 0)
    assert (found["cone_angle"], found["cone_softness"]) == (35, 1)
    assert (found["diffuse"], found["specular"]) == (0.5, 0)
    assert not loaded.report.unsupported


def test_cones_come_with_the_api_only(tmp_path):
    assert "cone_angle" not in light(tmp_path, 'def DiskLight "L" {}')[0]
    api = 'def DiskLight "L" (prepend apiSchemas = ["ShapingAPI"]) {}'
    assert light(tmp_path, api)[0]["cone_angle"] == 90


@pytest.mark.parametrize(("up", "axis"), [("Y", 1), ("Z", 2)])
def test_default_dome_and_camera_know_what_is_up(tmp_path, up, axis):
    box = QUAD.replace("(1,1,0)", "(1,1,5)")
    scene, loaded = load(tmp_path, f'#usda 1.0\n(upAxis = "{up}")\ndef Mesh "M" {{ {box} }}')
    assert pole(scene.lights[0])[axis] == 1
    frame = scene.camera["transform"]
    assert frame[1, axis] > 0.8
    assert np.linalg.det(frame[:3, :3]) == pytest.approx(1)
    # All corners are inside the image.
    points = np.append(scene.mesh("M")["positions"], np.ones((4, 1)), axis=1)
    seen = points @ np.linalg.inv(frame)
    assert (seen[:, 2] < 0).all()
    window = scene.camera["window"]
    x, y = seen[:, 0] / -seen[:, 2], seen[:, 1] / -seen[:, 2]
    assert window[0] < x.min() and x.max() < window[1]
    assert window[2] < y.min() and y.max() < window[3]
    assert loaded.camera_path is None


CAMERA = """def Camera "Cam" {
    float focalLength = 50
    float horizontalAperture = 20
    float verticalAperture = 10
    float horizontalApertureOffset = 5
    float fStop = 2
    float focusDistance = 7
    float2 clippingRange = (0.5, 100)
    float3 xformOp:scale = (2, 2, 2)
    double3 xformOp:translate = (1, 2, 3)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"] }
"""


def test_camera(tmp_path):
    scene, loaded = load(tmp_path, CAMERA)
    camera = scene.camera
    assert loaded.camera_path == "/Cam"
    assert camera["window"] == pytest.approx((-0.1, 0.3, -0.1, 0.1))
    # 50 tenths of a unit at f/2 give an aperture diameter of 2.5 units.
    assert camera["lens_radius"] == pytest.approx(1.25) and camera["focus_distance"] == 7
    assert (camera["near_clip"], camera["far_clip"]) == (0.5, 100)
    assert camera["transform"][:3, :3] == pytest.approx(np.eye(3))
    assert camera["transform"][3, :3] == pytest.approx([1, 2, 3])


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
@pytest.mark.parametrize(
    "odd",
    [
        "float horizontalApertureOffset = 1e30",
        "float verticalApertureOffset = -1e38",
        "float horizontalAperture = 1e-45",
    ],
)
def test_apertures_that_show_nothing(tmp_path, projection, odd):
    text = f"""def Camera "Cam" {{ token projection = "{projection}"
        {odd}
    }}
    def Sphere "Ball" {{ }}"""
    options = {"texture_limit": 1.0, "strand_pixels": 1.0}
    _, loaded = load(tmp_path, text, **options)
    what = "camera left out: its aperture is too small beside its offset and focal length: /Cam"
    assert said(loaded).count(what) == 1
    assert loaded.camera_path is None and "no camera: framed what is drawn" in said(loaded)


def test_which_camera(tmp_path):
    text = 'def Camera "First" {}\ndef Camera "Second" {}\n'
    assert load(tmp_path, text)[1].camera_path == "/First"
    assert load(tmp_path, text, camera="/Second")[1].camera_path == "/Second"
    assert load(tmp_path, text, camera="Second")[1].camera_path == "/Second"
    settings = '#usda 1.0\n(renderSettingsPrimPath = "/Render/S")\n' + text
    settings += 'def "Render" { def RenderSettings "S" { rel camera = </Second> } }'
    assert load(tmp_path, settings)[1].camera_path == "/Second"


def test_time(tmp_path):
    text = f"""#usda 1.0
    (startTimeCode = 1
    endTimeCode = 3)
    def Mesh "M" {{ {QUAD}
        double3 xformOp:translate.timeSamples = {{ 1: (1, 0, 0), 3: (3, 0, 0), }}
        uniform token[] xformOpOrder = ["xformOp:translate"] }}"""
    for frame, x in ((None, 1), (2, 2), (3, 3)):
        scene, _ = load(tmp_path, text, frame=frame)
        assert scene.mesh("M")["positions"][0, 0] == x


def test_variants(tmp_path):
    text = f"""#usda 1.0
    (defaultPrim = "A")
    def Xform "A" (variants = {{ string size = "small" }}
        prepend variantSets = "size") {{
        variantSet "size" = {{ "small" {{ def Mesh "S" {{ {QUAD} }} }}
            "large" {{ def Mesh "L" {{ {QUAD} }} }} }} }}"""
    assert load(tmp_path, text)[0].meshes[0]["name"] == "/A/S"
    for key in ("size", "/A{size}"):
        scene, _ = load(tmp_path, text, variants={key: "large"})
        assert scene.meshes[0]["name"] == "/A/L"


@pytest.mark.parametrize(
    ("authored", "x"), [("", 3.0), ("startTimeCode = 10\nendTimeCode = 20", 5.0)]
)
def test_without_a_frame_or_a_range_the_earliest_samples_count(tmp_path, authored, x):
    """As in usdrecord. Default values would put an animated camera at the origin."""
    path = tmp_path / "moving.usda"
    path.write_text(
        f"""#usda 1.0
        ({authored})
        def Camera "Cam" {{
            double3 xformOp:translate.timeSamples = {{ 2: (3, 0, 0), 10: (5, 0, 0) }}
            uniform token[] xformOpOrder = ["xformOp:translate"]
            double shutter:open = -0.5
            double shutter:close = 0.5
        }}"""
    )
    loaded = load_stage(path, builder_factory=Recorder)
    assert loaded.scene.camera["transform"][3, 0] == pytest.approx(x)
    assert loaded.frame == (10.0 if authored else None)
    assert (loaded.shutter is None) == (not authored)
