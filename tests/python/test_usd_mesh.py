# SPDX-License-Identifier: Apache-2.0
"""Tests meshes: polygons, normals, primvars, subdivision and implicit shapes."""

import numpy as np
import pytest
from usd_recorder import QUAD, load, said

from wavecomb.usd.geometry.triangulate import MeshError, clip_ears, triangulate


def areas(points, triangles):
    p = np.asarray(points, float)[triangles]
    return 0.5 * np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])


def polygon(*corners):
    points = np.array([(*c, 0.0) for c in corners], np.float32)
    count = np.array([len(points)], np.int32)
    return points, triangulate(points, count, np.arange(len(points), dtype=np.int32))


def shoelace(points):
    x, y = points[:, 0], points[:, 1]
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


CONCAVE = [
    [(0, 0), (4, 0), (1, 1), (0, 4)],
    [(4, 0), (1, 1), (0, 4), (0, 0)],
    [(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)],
    [(0, 0), (5, 0), (5, 5), (2.5, 0.5), (0, 5)],
    [(0, 0), (1, 0), (2, 0), (2, 2), (1, 0.5), (0, 2)],
]


@pytest.mark.parametrize("corners", CONCAVE)
@pytest.mark.parametrize("turn", range(4))
def test_concave_polygons_are_covered_once(corners, turn):
    corners = corners[turn:] + corners[:turn]
    points, topology = polygon(*corners)
    assert topology.count == len(corners) - 2
    signed = areas(points, topology.triangles)[:, 2]
    assert (signed >= -1e-6).all()
    assert signed.sum() == pytest.approx(shoelace(points))


def test_ears_of_a_polygon_that_crosses_itself_end():
    rng = np.random.default_rng(1)
    points = np.zeros((40, 3))
    points[:, :2] = rng.random((40, 2))
    triangles, _ = clip_ears(points, np.array([0.0, 0.0, 1.0]))
    assert triangles.shape == (38, 3)


def test_random_star_polygons_are_covered_once():
    rng = np.random.default_rng(2)
    for _ in range(20):
        count = int(rng.integers(5, 40))
        angle = np.sort(rng.random(count)) * 2 * np.pi
        radius = 0.2 + rng.random(count)
        corners = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
        if np.diff(np.append(angle, angle[0] + 2 * np.pi)).max() > 3.0:
            continue
        points, topology = polygon(*corners)
        total = np.abs(areas(points, topology.triangles)[:, 2]).sum()
        assert total == pytest.approx(shoelace(points), rel=1e-4)


def test_faces_stay_in_order_and_holes_and_lines_go():
    points = np.random.default_rng(0).random((12, 3)).astype(np.float32)
    counts = np.array([4, 3, 2, 3, 5], np.int32)
    indices = np.arange(17, dtype=np.int32) % 12
    topology = triangulate(points, counts, indices, np.array([3], np.int32))
    assert topology.face_ids().tolist() == [0, 0, 1, 4, 4, 4]
    assert (topology.indices[topology.corner_ids()] == topology.triangles).all()


@pytest.mark.parametrize(
    ("counts", "indices", "words"),
    [
        ([3, -3], [0, 1, 2], "negative"),
        ([3, 4], [0, 1, 2], "add up to 7, but there are 3"),
        ([3], [0, 1, 9], "out of range"),
        ([3], [0, 1, -1], "out of range"),
        ([2], [0, 1], "no faces"),
    ],
)
def test_bad_topology_is_named(counts, indices, words):
    points = np.zeros((4, 3), np.float32)
    with pytest.raises(MeshError, match=words):
        triangulate(points, np.array(counts, np.int32), np.array(indices, np.int32))


def normal_of(mesh):
    return areas(mesh["positions"], mesh["indices"]).sum(axis=0)


def test_orientation_and_mirrors_turn_triangles(tmp_path):
    scene, _ = load(
        tmp_path,
        f"""
        def Mesh "Right" {{ {QUAD} }}
        def Mesh "Left" {{ {QUAD} uniform token orientation = "leftHanded" }}
        def Mesh "Mirror" {{ {QUAD}
            float3 xformOp:scale = (-1, 1, 1)
            uniform token[] xformOpOrder = ["xformOp:scale"] }}
        def Mesh "Stretch" {{ {QUAD}
            float3 xformOp:scale = (2, 1, 1)
            uniform token[] xformOpOrder = ["xformOp:scale"] }}
        """,
    )
    assert normal_of(scene.mesh("Right"))[2] == pytest.approx(1)
    assert normal_of(scene.mesh("Left"))[2] == pytest.approx(-1)
    # The orientation is kept: +z is not mirrored.
    assert normal_of(scene.mesh("Mirror"))[2] == pytest.approx(1)
    assert normal_of(scene.mesh("Stretch"))[2] == pytest.approx(2)


TWO = """
    point3f[] points = [(0,0,0), (1,0,0), (1,1,0), (0,1,0), (2,0,0), (2,1,0)]
    int[] faceVertexCounts = [4, 4]
    int[] faceVertexIndices = [0,1,2,3, 1,4,5,2]
    uniform token subdivisionScheme = "none"
"""
KINDS = {
    "constant": "[(1,0,0)]",
    "uniform": "[(1,0,0), (0,1,0)]",
    "varying": "[(1,0,0), (0,1,0), (0,0,1), (1,0,0), (0,1,0), (0,0,1)]",
    "vertex": "[(1,0,0), (0,1,0), (0,0,1), (1,0,0), (0,1,0), (0,0,1)]",
    "faceVarying": "[(1,0,0), (0,1,0), (0,0,1), (1,0,0), (0,1,0), (0,0,1), (1,0,0), (0,1,0)]",
}


def corner_values(mesh, values):
    return values if values.ndim == 3 else values[mesh["indices"]]


@pytest.mark.parametrize("kind", KINDS)
def test_normals_in_every_interpolation(tmp_path, kind):
    scene, loaded = load(
        tmp_path,
        f'def Mesh "M" {{ {TWO} normal3f[] normals = {KINDS[kind]} (interpolation = "{kind}") }}',
    )
    mesh = scene.mesh("M")
    got = corner_values(mesh, mesh["normals"])
    values = np.array(eval(KINDS[kind]), float)
    polygons = np.array([[0, 1, 2, 3], [1, 4, 5, 2]])
    corners = np.array([[0, 1, 2], [0, 2, 3]])
    for face in range(2):
        for t in range(2):
            for c in range(3):
                corner = corners[t][c]
                index = {
                    "constant": 0,
                    "uniform": face,
                    "varying": polygons[face][corner],
                    "vertex": polygons[face][corner],
                    "faceVarying": 4 * face + corner,
                }[kind]
                assert got[2 * face + t, c].tolist() == values[index].tolist()
    assert not loaded.report.warnings


def test_primvar_normals_go_first_and_transform_by_the_inverse_transpose(tmp_path):
    scene, _ = load(
        tmp_path,
        f"""def Mesh "M" {{ {QUAD}
            normal3f[] normals = [(0,0,1)] (interpolation = "constant")
            normal3f[] primvars:normals = [(1,0,1)] (interpolation = "constant")
            float3 xformOp:scale = (2, 1, 1)
            uniform token[] xformOpOrder = ["xformOp:scale"] }}""",
    )
    expected = np.array([0.5, 0, 1]) / np.hypot(0.5, 1)
    assert scene.mesh("M")["normals"][0] == pytest.approx(expected)


BOUND = """
def Material "Mat" {{
    token outputs:surface.connect = </Mat/S.outputs:surface>
    def Shader "S" {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </Mat/T.outputs:rgb>
        token outputs:surface
    }}
    def Shader "T" {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @missing.png@
        float2 inputs:st.connect = </Mat/R.outputs:result>
        float3 outputs:rgb
    }}
    def Shader "R" {{
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "{name}"
        float2 outputs:result
    }}
}}
"""


@pytest.mark.parametrize(
    ("kind", "values", "indices"),
    [
        ("constant", "[(0.5, 0.25)]", None),
        ("uniform", "[(0.5, 0.25), (0.75, 1)]", None),
        ("vertex", "[(0,0), (1,0), (1,1), (0,1), (2,0), (2,1)]", None),
        ("varying", "[(0,0), (1,0)]", "[0, 1, 0, 1, 0, 1]"),
        ("faceVarying", "[(0,0), (1,0), (1,1), (0,1)]", "[0,1,2,3,0,1,2,3]"),
    ],
)
def test_st_in_every_interpolation_and_indexed(tmp_path, kind, values, indices):
    indexed = f"int[] primvars:st:indices = {indices}" if indices else ""
    scene, loaded = load(
        tmp_path,
        BOUND.format(name="st")
        + f"""def Mesh "M" (prepend apiSchemas = ["MaterialBindingAPI"]) {{ {TWO}
            rel material:binding = </Mat>
            texCoord2f[] primvars:st = {values} (interpolation = "{kind}")
            {indexed} }}""",
    )
    flat = np.array(eval(values), float)
    if indices:
        flat = flat[eval(indices)]
    got = corner_values(scene.mesh("M"), scene.mesh("M")["uvs"])
    source = {
        "constant": lambda face, corner, point: 0,
        "uniform": lambda face, corner, point: face,
        "vertex": lambda face, corner, point: point,
        "varying": lambda face, corner, point: point,
        "faceVarying": lambda face, corner, point: 4 * face + corner,
    }[kind]
    assert got[1, 2].tolist() == flat[source(0, 3, 3)].tolist()
    assert got[2, 1].tolist() == flat[source(1, 1, 4)].tolist()
    assert "primvar" not in said(loaded)


def test_face_varying_values_that_agree_become_vertex_values(tmp_path):
    scene, _ = load(
        tmp_path,
        f"""def Mesh "M" {{ {TWO}
        normal3f[] normals = [(0,0,1),(0,0,1),(0,0,1),(0,0,1),(0,0,1),(0,0,1),(0,0,1),(0,0,1)] (
            interpolation = "faceVarying") }}""",
    )
    assert scene.mesh("M")["normals"].shape == (6, 3)


@pytest.mark.parametrize(
    ("attribute", "words"),
    [
        ('normal3f[] normals = [(0,0,1)] (interpolation = "vertex")', "wrong number"),
        (
            'normal3f[] primvars:normals = [(0,0,1)] (interpolation = "vertex")\n'
            "int[] primvars:normals:indices = [0, 5, 0, 0]",
            "out of range",
        ),
        ('normal3f[] normals = [(nan,0,1)] (interpolation = "constant")', "not finite"),
    ],
)
def test_normals_that_do_not_fit_are_ignored(tmp_path, attribute, words):
    scene, loaded = load(tmp_path, f'def Mesh "M" {{ {QUAD} {attribute} }}')
    assert scene.mesh("M")["normals"] is None
    assert words in said(loaded) and "/M" in said(loaded)


def test_st_that_does_not_fit_is_ignored(tmp_path):
    scene, loaded = load(
        tmp_path,
        BOUND.format(name="st")
        + f"""def Mesh "M" (prepend apiSchemas = ["MaterialBindingAPI"]) {{ {QUAD}
            rel material:binding = </Mat>
            texCoord2f[] primvars:st = [(0,0), (1,1)] (interpolation = "vertex") }}""",
    )
    assert scene.mesh("M")["uvs"] is None
    assert "primvar 'st' (vertex) has the wrong number of values, 2 where" in said(loaded)


def test_other_names_of_texture_coordinates(tmp_path):
    scene, _ = load(
        tmp_path,
        BOUND.format(name="UVMap")
        + f"""def Mesh "M" (prepend apiSchemas = ["MaterialBindingAPI"]) {{ {QUAD}
            rel material:binding = </Mat>
            texCoord2f[] primvars:UVMap = [(0,0), (1,0), (1,1), (0,1)] (
                interpolation = "vertex")
            texCoord2f[] primvars:st = [(9,9), (9,9), (9,9), (9,9)] (interpolation = "vertex")
        }}""",
    )
    assert scene.mesh("M")["uvs"].max() == 1


CUBE = """
    point3f[] points = [(-1,-1,-1), (1,-1,-1), (1,1,-1), (-1,1,-1),
                        (-1,-1,1), (1,-1,1), (1,1,1), (-1,1,1)]
    int[] faceVertexCounts = [4,4,4,4,4,4]
    int[] faceVertexIndices = [0,3,2,1, 4,5,6,7, 0,1,5,4, 2,3,7,6, 1,2,6,5, 0,4,7,3]
"""


def test_subdivision_meshes_that_are_not_refined_are_smooth(tmp_path):
    scene, _ = load(tmp_path, f'def Mesh "M" {{ {CUBE} }}')
    mesh = scene.mesh("M")
    unit = mesh["positions"] / np.sqrt(3)
    assert (mesh["normals"] * unit).sum(axis=1).min() > 0.9


def test_left_handed_subdivision_normals_point_where_the_triangles_do(tmp_path):
    scene, _ = load(tmp_path, f'def Mesh "M" {{ {CUBE} uniform token orientation="leftHanded" }}')
    mesh = scene.mesh("M")
    assert (mesh["normals"] * mesh["positions"]).sum(axis=1).max() < 0
    assert (areas(mesh["positions"], mesh["indices"]) * mesh["positions"][mesh["indices"][:, 0]]
            ).sum(axis=1).max() < 0  # fmt: skip


def test_sharp_creases_split_normals(tmp_path):
    top = "int[] creaseIndices = [4,5,6,7,4]\nint[] creaseLengths = [5]"
    scene, _ = load(tmp_path, f'def Mesh "M" {{ {CUBE} {top}; float[] creaseSharpnesses = [10] }}')
    mesh = scene.mesh("M")
    assert mesh["normals"].shape == (12, 3, 3)
    flat = areas(mesh["positions"], mesh["indices"])
    on_top = flat[:, 2] > 0
    assert mesh["normals"][on_top] == pytest.approx(np.tile([0, 0, 1], (2, 3, 1)))
    sides = mesh["normals"][np.abs(flat[:, 2]) < 1e-6]
    assert np.abs(sides[..., 0]).min() > 0.3


def test_bilinear_and_none_are_flat(tmp_path):
    scene, _ = load(
        tmp_path,
        f"""def Mesh "A" {{ {CUBE} uniform token subdivisionScheme = "none" }}
        def Mesh "B" {{ {CUBE} uniform token subdivisionScheme = "bilinear" }}""",
    )
    assert scene.mesh("A")["normals"] is None and scene.mesh("B")["normals"] is None


@pytest.mark.parametrize(
    "prim",
    [
        'Sphere "S" { double radius = 2 }',
        'Cube "S" { double size = 3 }',
        'Cylinder "S" { double radius = 0.5; double height = 3; uniform token axis = "X" }',
        'Cone "S" { double radius = 1.5; double height = 2; uniform token axis = "Y" }',
        'Capsule "S" { double radius = 0.5; double height = 2 }',
        'Plane "S" { double width = 2; double length = 4; uniform token axis = "X" }',
    ],
)
def test_shapes_face_outwards_and_fill_their_extent(tmp_path, prim):
    from pxr import Usd, UsdGeom

    scene, _ = load(tmp_path, f"def {prim}")
    mesh = scene.mesh("S")
    face = areas(mesh["positions"], mesh["indices"])
    corner = mesh["normals"][mesh["indices"]]
    assert (np.einsum("ti,tci->tc", face, corner) > 0).all()
    if "Plane" not in prim:
        centres = mesh["positions"][mesh["indices"]].mean(axis=1)
        assert (np.einsum("ti,ti->t", face, centres) > 0).all()
    stage = Usd.Stage.Open(str(tmp_path / "stage.usda"))
    gprim = UsdGeom.Boundable(stage.GetPrimAtPath("/S"))
    extent = np.array(UsdGeom.Boundable.ComputeExtentFromPlugins(gprim, Usd.TimeCode.Default()))
    assert mesh["positions"].min(axis=0) == pytest.approx(extent[0], abs=1e-5)
    assert mesh["positions"].max(axis=0) == pytest.approx(extent[1], abs=1e-5)


def test_points_that_need_no_transform_are_not_copied(tmp_path):
    scene, _ = load(tmp_path, f'def Mesh "M" {{ {QUAD} }}')
    assert not scene.mesh("M")["positions"].flags.owndata
