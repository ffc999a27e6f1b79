# SPDX-License-Identifier: Apache-2.0
"""Tests that stages render the same images far from the world origin as near it."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from parts import needs, only_where
from pxr import Gf, Sdf, Usd

import wavecomb
from wavecomb import vdb
from wavecomb.usd.geometry.mesh_arrays import IDENTITY
from wavecomb.usd.stage.context import (
    CELL,
    INSTANCED,
    NEAR,
    POSITIONS,
    STORED,
    WORLD,
    find_origin,
    to_scene_space,
    world_to_scene,
)

pytestmark = needs("wavecomb._core")

FAR = (5e8, 0.0, -5e8)
EXACT = (300 * CELL, 0.0, -50 * CELL)
"""Offset by a multiple of the grid spacing of scene origins, so that images are bit-identical."""

PARTS = """
def Camera "Camera" {
    float focalLength = 35
    float2 clippingRange = (0.1, 1000)
    double shutter:open = 0
    double shutter:close = 1
    double3 xformOp:translate.timeSamples = { 0: (0, 2, 9), 1: (0.5, 2, 9) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Mesh "Ground" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-9, 0, 9), (9, 0, 9), (9, 0, -9), (-9, 0, -9)]
    rel material:binding = </Geo/M>
}
def Mesh "Cage" {
    uniform token subdivisionScheme = "catmullClark"
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [0,1,3,2, 4,6,7,5, 0,4,5,1, 2,3,7,6, 0,2,6,4, 1,5,7,3]
    point3f[] points = [(-1,-1,-1), (-1,-1,1), (-1,1,-1), (-1,1,1), (1,-1,-1), (1,-1,1), (1,1,-1),
        (1,1,1)]
    double3 xformOp:translate.timeSamples = { 0: (-2.5, 1, 0), 1: (-2.5, 1.5, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def BasisCurves "Hair" {
    uniform token type = "cubic"
    uniform token basis = "bspline"
    int[] curveVertexCounts = [5]
    point3f[] points = [(0, 0, 0), (0, 0.5, 0), (0.3, 1, 0), (0, 1.5, 0), (0, 2, 0)]
    float[] widths = [0.3] ( interpolation = "constant" )
    double3 xformOp:translate = (0, 0.2, 1)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Points "Points" {
    point3f[] points = [(0, 0, 0), (0.6, 0.4, 0)]
    float[] widths = [0.4, 0.6] ( interpolation = "vertex" )
    double3 xformOp:translate = (1, 1.5, 2)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def PointInstancer "Many" {
    int[] protoIndices = [0, 0]
    point3f[] positions = [(2, 1, 0), (3.5, 1, -1)]
    vector3f[] velocities = [(0, 10, 0), (0, 0, 0)]
    rel prototypes = </Geo/Many/Box>
    def Cube "Box" {
        double size = 1
    }
}
class Xform "Shape" {
    def Sphere "Ball" {
        double radius = 0.4
        double3 xformOp:translate = (0, 0.5, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def SphereLight "Bulb" {
        float inputs:radius = 0.2
        float inputs:intensity = 20
        double3 xformOp:translate = (0, 1.5, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
def Xform "One" ( instanceable = true
    references = </Geo/Shape> ) {
    double3 xformOp:translate = (-1, 0, 3)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Xform "Two" ( instanceable = true
    references = </Geo/Shape> ) {
    double3 xformOp:translate = (1.5, 0, 3)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def DomeLight "Dome" {
    float inputs:intensity = 0.3
    rel portals = </Geo/Portal>
}
def PortalLight "Portal" {
    float inputs:width = 20
    float inputs:height = 20
    double3 xformOp:translate = (0, 8, 0)
    float xformOp:rotateX = -90
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
}
def RectLight "Key" {
    float inputs:width = 3
    float inputs:intensity = 3
    double3 xformOp:translate = (0, 4, 6)
    float xformOp:rotateX = -60
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
}
def Material "M" {
    token outputs:mtlx:surface.connect = </Geo/M/S.outputs:out>
    def Shader "S" {
        uniform token info:id = "ND_standard_surface_surfaceshader"
        color3f inputs:base_color.connect = </Geo/M/C.outputs:out>
        token outputs:out
    }
    def Shader "C" {
        uniform token info:id = "ND_convert_vector3_color3"
        float3 inputs:in.connect = </Geo/M/F.outputs:out>
        color3f outputs:out
    }
    def Shader "F" {
        uniform token info:id = "ND_fractal3d_vector3"
        float3 inputs:position.connect = </Geo/M/P.outputs:out>
        float3 outputs:out
    }
    def Shader "P" {
        uniform token info:id = "ND_position_vector3"
        string inputs:space = "object"
        float3 outputs:out
    }
}
"""
RESET = """
def Cube "Reset" {{
    double size = 1
    double3 xformOp:translate = ({}, 3, {})
    uniform token[] xformOpOrder = ["!resetXformStack!", "xformOp:translate"]
}}
"""


def stage(folder: Path, place: tuple[float, float, float], body: str = PARTS) -> Path:
    """Writes the stage with all of its prims moved."""
    path = folder / f"{len(list(folder.glob('*.usda')))}.usda"
    x, y, z = place
    path.write_text(f"""#usda 1.0
(
    upAxis = "Y"
    metersPerUnit = 1
    startTimeCode = 0
    endTimeCode = 1
)
def Xform "Geo" {{
    double3 xformOp:translate = ({x!r}, {y!r}, {z!r})
    uniform token[] xformOpOrder = ["xformOp:translate"]
{body}
{RESET.format(repr(x), repr(z))}
}}
""")
    return path


def render(source: Any, **options: Any) -> wavecomb.Picture:
    plain = {"size": (48, 32), "spp": 16, "aovs": ["position", "albedo", "depth"], "frame": 0}
    return wavecomb.render(source, **(plain | options))


def test_the_image_is_the_same(tmp_path: Path) -> None:
    near = render(stage(tmp_path, WORLD))
    assert near.stats["origin"] == [0, 0, 0]
    for place in (FAR, EXACT):
        far = render(stage(tmp_path, place))
        assert np.any(far.stats["origin"])
        if place == EXACT:
            assert (far.beauty == near.beauty).all()
            assert (far.depth == near.depth).all()
        error = np.abs(far.beauty - near.beauty).mean() / near.beauty.mean()
        assert error < 2e-3, place
        hit = near.aovs["position"].any(axis=2)
        moved = far.aovs["position"][hit] - near.aovs["position"][hit]
        assert moved == pytest.approx(np.broadcast_to(place, moved.shape), abs=33.0)
        # Pixels without a hit stay 0, as near the origin.
        assert (far.aovs["position"].any(axis=2) == hit).all()


def test_matrices_of_the_header_lead_from_the_world(tmp_path: Path) -> None:
    near, far = (render(stage(tmp_path, place)).metadata for place in (WORLD, EXACT))
    moved = np.eye(4)
    moved[3, :3] = EXACT
    assert moved @ far["worldToCamera"] == pytest.approx(near["worldToCamera"], abs=1e-6)
    point = np.array([1.0, 1.0, 1.0, 1.0])
    ours = point @ moved @ far["worldToNDC"]
    assert ours == pytest.approx(point @ near["worldToNDC"], abs=1e-3)


def test_without_a_camera(tmp_path: Path) -> None:
    body = PARTS[PARTS.index('def Mesh "Ground"') :]
    near, far = (render(stage(tmp_path, place, body)) for place in (WORLD, FAR))
    assert near.stats["origin"] == [0, 0, 0] and np.any(far.stats["origin"])
    assert np.abs(far.beauty - near.beauty).mean() < 5e-3 * near.beauty.mean()


def test_the_middle_of_what_is_drawn(tmp_path: Path) -> None:
    """The centre of a stage ignores hidden prims, lights and invalid extents."""
    box = """def Cube "{}" {{
        {}
        double3 xformOp:translate = ({}, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}"""
    usd = open_text(
        "\n".join(
            (
                box.format("A", "float3[] extent = [(-1, -1, -1), (1, 1, 1)]", 10 * CELL),
                box.format("B", "float3[] extent = [(0, 0, 0)]", 20 * CELL),
                box.format("Guide", 'uniform token purpose = "guide"', 500 * CELL),
                box.format("Light", "", 900 * CELL).replace("Cube", "SphereLight"),
            )
        )
    )
    assert find_origin(usd, Usd.TimeCode(0), None, ["default"]) == (15 * CELL, 0, 0)
    assert find_origin(usd, Usd.TimeCode(0), None, ["default", "guide"]) == (255 * CELL, 0, 0)
    assert find_origin(open_text(""), Usd.TimeCode(0), None, ["default"]) == WORLD


def test_parts_of_an_image(tmp_path: Path) -> None:
    path = stage(tmp_path, FAR)
    whole, part = render(path), render(path, region=(8, 8, 40, 24), crop=True)
    assert (whole.beauty[8:24, 8:40] == part.beauty).all()


def test_frames_are_what_they_are_alone(tmp_path: Path) -> None:
    """If the camera moves far away, the stage is read again with a new origin."""
    flight = f"0: ({CELL * 6}, 2, 9), 1: ({CELL * 6 + 1}, 2, 9), 2: ({CELL * 8}, 2, 9)"
    still = "{ 0: (0, 2, 9), 1: (0.5, 2, 9) }"
    assert still in PARTS
    body = PARTS.replace(still, f"{{ {flight} }}")
    body = body.replace("double shutter:close = 1", "double shutter:close = 0")
    for name, x in (("Near", CELL * 6), ("Next", CELL * 8)):
        body += f"""
        def Sphere "{name}" {{
            double3 xformOp:translate = ({x}, 2, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }}"""
    path = stage(tmp_path, (0.0, 0.0, 0.0), body)
    settings = {"size": (24, 16), "spp": 4}
    origins = []
    for frame, picture in wavecomb.render_frames(path, [0, 1, 2], **settings):
        alone = wavecomb.render(path, frame=frame, **settings)
        origins.append(picture.stats["origin"][0])
        assert (picture.beauty == alone.beauty).all()
        assert picture.stats["origin"] == alone.stats["origin"]
    assert origins == [CELL * 6, CELL * 6, CELL * 8]


@pytest.mark.parametrize(
    "seed", [*range(4), *(pytest.param(s, marks=pytest.mark.long) for s in range(4, 60))]
)
def test_random_stages(seed: int, tmp_path: Path) -> None:
    """Random stages of the naive integrator's suite, moved by a random number of cells."""
    sys.path.append(str(Path(__file__).resolve().parents[1] / "statistics"))
    from random_scenes import make_scene

    (tmp_path / "far").mkdir()
    scene = make_scene(seed, tmp_path, enclosure=True)
    cells = np.random.default_rng(seed).integers(-50_000, 50_000, 3)
    move = tuple((CELL * cells).tolist())
    text = scene.stage.read_text()
    order = 'uniform token[] xformOpOrder = ["xformOp:translate"]'
    op = f"\ndouble3 xformOp:translate = {move}\n{order}"
    far = tmp_path / "far.usda"
    far.write_text(text.replace('def Xform "World" {', f'def Xform "World" {{{op}', 1))
    settings: dict[str, Any] = {"spp": 16, "max_depth": scene.depth, "threads": 1}
    images = []
    for path in (scene.stage, far):
        loaded = wavecomb.load(path, **scene.load)
        images.append(wavecomb.render(loaded, size=(16, 16), **settings).beauty)
    assert loaded.origin == move
    # The moved transforms have a precision of 2^-24 in doubles, so a few floats round differently.
    error = np.abs(images[0] - images[1]).mean() / max(images[0].mean(), 1e-6)
    assert error < 5e-3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "options"),
    [
        pytest.param("smoke", {"voxels": 16}, marks=only_where(vdb.is_there(), "without OpenVDB")),
        ("splats", {"splats": 500}),
        ("candles", {}),
    ],
)
def test_volumes_splats_and_subsurface(name: str, options: dict[str, Any], tmp_path: Path) -> None:
    """Generated scenes, referenced by a moved prim."""
    from pxr import UsdGeom

    from wavecomb.scenes import write_scene

    write_scene(name, tmp_path / "scene.usdc", **options)
    up = UsdGeom.GetStageUpAxis(Usd.Stage.Open(str(tmp_path / "scene.usdc")))
    images = []
    for place in (WORLD, EXACT):
        (path := tmp_path / f"{len(images)}.usda").write_text(f"""#usda 1.0
(
    upAxis = "{up}"
    metersPerUnit = 1
)
def Xform "Far" {{
    double3 xformOp:translate = {place}
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def "Scene" ( references = @./scene.usdc@ ) {{
    }}
}}
""")
        loaded = wavecomb.load(path)
        assert loaded.origin == place
        images.append(wavecomb.render(loaded, size=(24, 16), spp=4, max_depth=3).beauty)
    assert images[0].any()
    assert np.abs(images[0] - images[1]).mean() < 1e-3 * images[0].mean()


def open_text(text: str) -> Usd.Stage:
    layer = Sdf.Layer.CreateAnonymous(".usda")
    assert layer.ImportFromString("#usda 1.0\n" + text)
    return Usd.Stage.Open(layer)


@pytest.mark.parametrize("x", [0.0, 100.0, NEAR - 1, -NEAR + 1, NEAR, 3 * NEAR + 5, -7e7])
def test_origins(x: float) -> None:
    usd = open_text(f"""def Camera "C" {{
        double3 xformOp:translate = ({x!r}, 5, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}""")
    found = find_origin(usd, Usd.TimeCode(0), usd.GetPrimAtPath("/C"), ["default"])
    if abs(x) < NEAR:
        assert found == WORLD and world_to_scene(found) is IDENTITY
        matrices = np.eye(4)
        assert to_scene_space(matrices, found) is matrices
    else:
        assert abs(found[0] - x) <= CELL / 2 and found[0] % CELL == 0 and found[1:] == (0, 0)
        moved = np.array(Gf.Matrix4d(1).SetTranslate((x, 5, 0)) * world_to_scene(found))
        assert moved[3, 0] == x - found[0]


def test_world_positions_of_graphs(tmp_path: Path) -> None:
    """A material that shows world-space x has the right brightness far from the origin."""
    body = """
    def Camera "Camera" {
        token projection = "orthographic"
        float horizontalAperture = 20
        float verticalAperture = 20
        double3 xformOp:translate = (0, 0, 5)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Cube "Cube" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {
        double size = 4
        rel material:binding = </Geo/M>
    }
    def Material "M" {
        token outputs:mtlx:surface.connect = </Geo/M/S.outputs:out>
        def Shader "S" {
            uniform token info:id = "ND_standard_surface_surfaceshader"
            float inputs:base = 0
            float inputs:specular = 0
            float inputs:emission = 1
            color3f inputs:emission_color.connect = </Geo/M/C.outputs:out>
            token outputs:out
        }
        def Shader "C" {
            uniform token info:id = "ND_convert_vector3_color3"
            float3 inputs:in.connect = </Geo/M/D.outputs:out>
            color3f outputs:out
        }
        def Shader "D" {
            uniform token info:id = "ND_divide_vector3FA"
            float3 inputs:in1.connect = </Geo/M/P.outputs:out>
            float inputs:in2 = 2e6
            float3 outputs:out
        }
        def Shader "P" {
            uniform token info:id = "ND_position_vector3"
            string inputs:space = "world"
            float3 outputs:out
        }
    }"""
    picture = wavecomb.render(stage(tmp_path, (1e6, 0.0, 0.0), body), size=(8, 8), spp=4)
    assert picture.beauty[..., 0] == pytest.approx(np.full((8, 8), 0.5), rel=1e-4)


FACES = """
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
"""


def points(x: float, size: float = 20.0) -> str:
    corners = [(x, 0, 0), (x + size, 0, 0), (x + size, size, 0), (x, size, 0)]
    return f"{FACES}\npoint3f[] points = {corners}"


@pytest.mark.parametrize(
    ("body", "warning", "prim"),
    [
        (f'def Mesh "Baked" {{ {points(3e7)} }}', STORED, "/Baked"),
        (f'def Mesh "Fine" {{ {points(3e4)} }}', None, ""),
        (f'def Mesh "Wide" {{ {points(3e7, 1e7)} }}', None, ""),
        (
            """def PointInstancer "Far" {
                int[] protoIndices = [0, 0]
                point3f[] positions = [(3e7, 0, 0), (30000020, 0, 0)]
                rel prototypes = </Far/Box>
                def Cube "Box" {
                }
            }""",
            POSITIONS,
            "/Far",
        ),
        (
            """class Xform "Shape" {
                def Cube "Box" {
                    double3 xformOp:translate = (1e7, 0, 0)
                    uniform token[] xformOpOrder = ["xformOp:translate"]
                }
            }
            def Xform "One" ( instanceable = true
                references = </Shape> ) {
            }
            def Xform "Two" ( instanceable = true
                references = </Shape> ) {
                double3 xformOp:translate = (0, 5, 0)
                uniform token[] xformOpOrder = ["xformOp:translate"]
            }""",
            INSTANCED,
            "/One/Box",
        ),
        (
            """def Cube "Moved" {
                double3 xformOp:translate = (5e8, 0, 0)
                uniform token[] xformOpOrder = ["xformOp:translate"]
            }""",
            None,
            "",
        ),
    ],
)  # fmt: skip
def test_what_floats_cannot_hold_is_said(
    body: str, warning: str | None, prim: str, tmp_path: Path
) -> None:
    path = tmp_path / "stage.usda"
    path.write_text("#usda 1.0\n" + re.sub(r" \}", "\n}", body))
    loaded = wavecomb.load(path)
    found = [one for one in loaded.report.warnings if "single precision" in one.what]
    if warning is None:
        assert not found
    else:
        assert [(one.what, one.places) for one in found] == [(warning, [prim])]
        assert len(found[0].line().splitlines()) == 1


def test_cameras_and_positions_of_the_window() -> None:
    """Camera poses in the window are in scene space; displayed positions are in world space."""
    from wavecomb.gui.viewport.navigate import Pose
    from wavecomb.gui.viewport.scene_lookup import camera_pose

    usd = open_text(f"""def Camera "C" {{
        double3 xformOp:translate = ({FAR[0]!r}, 5, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}""")
    origin = (FAR[0] - 10.0, 0.0, 0.0)
    pose = camera_pose(usd, "/C", None, origin)
    assert isinstance(pose, Pose) and pose.position == pytest.approx((10, 5, 0))
    other = pose.around(origin, (FAR[0], 0.0, 0.0))
    assert other.position == pytest.approx((0, 5, 0)) and other.path == pose.path
    assert pose.around(origin, origin) is pose
