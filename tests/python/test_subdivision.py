# SPDX-License-Identifier: Apache-2.0
"""Tests subdivision surfaces against closed forms and masks that this file computes."""

import json
import weakref

import numpy as np
import pytest
from click.testing import CliRunner
from usd_recorder import load, said, write

from wavecomb import _core
from wavecomb.cli import main
from wavecomb.errors import WavecombError
from wavecomb.usd.geometry import subdivision

FACE_VARYING = ("none", "cornersOnly", "cornersPlus1", "cornersPlus2", "boundaries", "all")


def surface(points, faces, level=2, **rules):
    """Returns a refined mesh of ``SceneBuilder.make_surfaces``."""
    description = {
        "level": level,
        "points": np.ascontiguousarray(points, np.float32),
        "counts": np.array([len(face) for face in faces], np.int32),
        "indices": np.concatenate(faces).astype(np.int32),
        "scheme": "catmullClark",
        "boundary": "edgeAndCorner",
        "face_varying": "cornersPlus1",
        "smooth_triangles": False,
        "left_handed": False,
        **rules,
    }
    (made,) = _core.SceneBuilder(1).make_surfaces([description], 1)
    return made


def grid(width, height, z=None):
    """Returns points ((width + 1) (height + 1), 3) with integer coordinates, and quads."""
    x, y = np.meshgrid(np.arange(width + 1.0), np.arange(height + 1.0))
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size) if z is None else z], axis=1)
    row = width + 1
    corner = [r * row + c for r in range(height) for c in range(width)]
    return points, [[i, i + 1, i + row + 1, i + row] for i in corner]


CUBE = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], float)
CUBE_FACES = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]


def nearest(made, point):
    """Returns the distance of a point to the nearest point of a refined mesh."""
    return float(np.linalg.norm(made["positions"] - np.asarray(point), axis=1).min())


def neighbours(faces, v):
    """Returns the points that share an edge with v, and the points opposite v in its quads."""
    edges, across = set(), []
    for face in faces:
        if v in face:
            at = face.index(v)
            edges |= {face[at - 1], face[(at + 1) % len(face)]}
            if len(face) == 4:
                across.append(face[(at + 2) % 4])
    return sorted(edges), across


def bspline(control, u):
    """Evaluates a uniform cubic B-spline of 4 values at u in [0, 1], and its derivative."""
    b = (
        np.array([(1 - u) ** 3, 3 * u**3 - 6 * u**2 + 4, -3 * u**3 + 3 * u**2 + 3 * u + 1, u**3])
        / 6
    )
    d = np.array([-((1 - u) ** 2), 3 * u**2 - 4 * u, -3 * u**2 + 2 * u + 1, u**2]) / 2
    return b @ control, d @ control


def test_a_regular_patch_is_a_bicubic_b_spline():
    z = np.random.default_rng(3).random(16)
    points, faces = grid(3, 3, z)
    made = surface(points, faces, level=3, boundary="none")
    assert len(made["positions"]) == 81 and set(made["faces"].tolist()) == {4}
    table = z.reshape(4, 4)
    for p, n in zip(made["positions"], made["normals"], strict=True):
        u, v = p[0] - 1.0, p[1] - 1.0
        rows, slopes = zip(*(bspline(row, u) for row in table), strict=True)
        value, along_v = bspline(np.array(rows), v)
        along_u = bspline(np.array(slopes), v)[0]
        assert p[2] == pytest.approx(value, abs=1e-6)
        exact = np.array([-along_u, -along_v, 1.0])
        assert n == pytest.approx(exact / np.linalg.norm(exact), abs=1e-5)


def fan(count):
    """Returns a double pyramid of quads: closed, with two points of valence ``count``."""
    angle = np.arange(2 * count) * np.pi / count
    ring = np.stack([np.cos(angle), np.sin(angle), 0.1 * np.cos(3 * angle)], axis=1)
    points = np.concatenate([[[0, 0.1, 1.0]], ring, [[0.1, 0, -0.8]]])
    top = [[0, 1 + 2 * i, 2 + 2 * i, 1 + (2 * i + 2) % (2 * count)] for i in range(count)]
    low = [[2 * count + 1, *reversed(face[1:])] for face in top]
    return points, top + low


@pytest.mark.parametrize("count", [3, 5, 7])
def test_an_extraordinary_point_of_catmull_clark_goes_to_its_limit(count):
    points, faces = fan(count)
    edges, across = neighbours(faces, 0)
    n = len(edges)
    assert n == count
    # Halstead, Kass, DeRose 1993, equation 1.
    limit = n * n * points[0] + 4 * points[edges].sum(0) + points[across].sum(0)
    limit /= n * (n + 5)
    for level in (1, 3):
        assert nearest(surface(points, faces, level), limit) < 1e-6


OCTAHEDRON = np.array(
    [[1, 0, 0], [0, 1.2, 0], [-1, 0, 0.1], [0, -1, 0], [0, 0, 1.5], [0, 0.2, -1]], float
)
OCTAHEDRON_FACES = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4],
                    [1, 0, 5], [2, 1, 5], [3, 2, 5], [0, 3, 5]]  # fmt: skip


def test_points_of_loop_go_to_their_limits():
    made = surface(OCTAHEDRON, OCTAHEDRON_FACES, 3, scheme="loop")
    assert len(made["triangles"]) == 8 * 64
    for v in range(6):
        edges, _ = neighbours(OCTAHEDRON_FACES, v)
        n = len(edges)
        beta = (5 / 8 - (3 / 8 + np.cos(2 * np.pi / n) / 4) ** 2) / n
        weight = 3 / (8 * beta)
        limit = (weight * OCTAHEDRON[v] + OCTAHEDRON[edges].sum(0)) / (weight + n)
        assert nearest(made, limit) < 1e-6


def test_bilinear_keeps_the_cage_and_its_edges():
    made = surface(CUBE, CUBE_FACES, 2, scheme="bilinear")
    assert np.abs(made["positions"]).max(axis=1) == pytest.approx(1.0)
    for corner in CUBE:
        assert nearest(made, corner) == 0.0
    assert np.sort(np.abs(made["normals"]), axis=1) == pytest.approx(
        np.tile([0.0, 0.0, 1.0], (len(made["normals"]), 1))
    )


def test_normals_point_outward_and_turn_with_the_cage():
    made = surface(CUBE, CUBE_FACES, 3)
    dots = np.einsum("ij,ij->i", made["positions"], made["normals"])
    assert (dots > 0.5).all()
    matrix = np.diag([-1.0, 2.0, 1.0, 1.0])
    turned = surface(CUBE, [face[::-1] for face in CUBE_FACES], 3, left_handed=True, matrix=matrix)
    for mesh in (made, turned):
        p = mesh["positions"][mesh["triangles"]].astype(float)
        flat = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        assert (np.einsum("ij,ij->i", flat, p.mean(axis=1)) > 0).all()
        assert (np.einsum("ij,ij->i", flat, mesh["normals"][mesh["triangles"][:, 0]]) > 0).all()


def test_a_sharp_crease_is_a_b_spline_curve_with_two_normals():
    rng = np.random.default_rng(5)
    points, faces = grid(4, 4, rng.random(25))
    middle = np.array([2, 7, 12, 17, 22])
    made = surface(
        points, faces, 3,
        crease_edges=np.stack([middle[:-1], middle[1:]], axis=1).astype(np.int32),
        crease_sharpness=np.full(4, 10, np.float32),
    )  # fmt: skip
    z = points[middle, 2]
    on = made["positions"][np.abs(made["positions"][:, 0] - 2.0) < 1e-6]
    inner = on[(on[:, 1] > 0.999) & (on[:, 1] < 3.001)]
    places, counts = np.unique(inner, axis=0, return_counts=True)
    assert len(places) == 17 and (counts == 2).all()
    for p in places:
        span = min(int(p[1] + 1e-6), 2) - 1
        assert p[2] == pytest.approx(bspline(z[span : span + 4], p[1] - span - 1)[0], abs=1e-6)


def test_a_crease_that_fades_lies_between_sharp_and_smooth():
    def height(sharpness):
        edges = np.array([[4, 5], [5, 7], [7, 6], [6, 4]], np.int32)
        made = surface(
            CUBE, CUBE_FACES, 4, crease_edges=edges,
            crease_sharpness=np.full(4, sharpness, np.float32),
        )  # fmt: skip
        # The creased edge is at x = z = 1.
        return made["positions"][:, [0, 2]].sum(axis=1).max()

    heights = [height(s) for s in (0.0, 1.0, 2.0, 10.0)]
    assert heights == sorted(heights) and len(set(heights)) == 4
    # The crease is a closed B-spline: (1 + 23 + 23 + 1) / 48 of its points at the middle of an
    # edge.
    assert heights[-1] == pytest.approx(1 + 46 / 48 - 2 / 48, abs=1e-6)


def test_sharp_corners_stay():
    made = surface(
        CUBE, CUBE_FACES, 3, corner_vertices=np.array([7], np.int32),
        corner_sharpness=np.array([10], np.float32),
    )  # fmt: skip
    assert nearest(made, CUBE[7]) == 0.0
    assert nearest(made, CUBE[0]) > 0.1


def test_holes_are_left_out_but_shape_the_rest():
    whole = surface(CUBE, CUBE_FACES, 2)
    cut = surface(CUBE, CUBE_FACES, 2, holes=np.array([1], np.int32))
    assert 1 not in cut["faces"] and len(cut["triangles"]) == len(whole["triangles"]) * 5 // 6
    kept = {tuple(p) for p in whole["positions"].tolist()}
    assert {tuple(p) for p in cut["positions"].tolist()} <= kept


QUAD = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)


@pytest.mark.parametrize(
    ("rule", "corner"), [("edgeOnly", [1 / 6, 1 / 6, 0]), ("edgeAndCorner", [0, 0, 0])]
)
def test_boundaries_of_one_quad(rule, corner):
    made = surface(QUAD, [[0, 1, 2, 3]], 3, boundary=rule)
    assert nearest(made, corner) < 1e-6
    # The boundary is a B-spline: (1 + 23 + 23 + 1) / 48 of its points at the middle of an edge.
    lowest = 1 / 48 + 1 / 48 if rule == "edgeOnly" else 0.0
    assert nearest(made, [0.5, lowest, 0]) < 1e-6


def test_without_boundary_interpolation_the_outer_faces_go():
    points, faces = grid(4, 3)
    assert set(surface(points, faces, 1, boundary="none")["faces"].tolist()) == {5, 6}
    assert surface(QUAD, [[0, 1, 2, 3]], 1, boundary="none") == "no faces"


def smoothed(*values):
    """Returns the limit position of a crease point, which is the second of three values."""
    a, b, c = (np.asarray(value, float) for value in values)
    return (a + 4 * b + c) / 6


# Texture coordinates on 2 x 2 quads around point 4: point i at (i % 3, i // 3), two displaced.
BENT = np.array([(i % 3, i // 3) for i in range(9)], float)
BENT[4] = (1.3, 1.2)
BENT[1] = (0.9, -0.2)
_, GRID_FACES = grid(2, 2)
REGIONS = {"joined": [0, 0, 0, 0], "three": [0, 1, 2, 1], "concave": [1, 0, 0, 0]}
"""Index of the texture chart of each quad."""


def charted(regions):
    """Returns face-varying texture coordinates with charts 10 apart along u."""
    keys = [(regions[f], v) for f, face in enumerate(GRID_FACES) for v in face]
    unique = sorted(set(keys))
    values = np.array([BENT[v] + (10 * r, 0) for r, v in unique], np.float32)
    index = np.array([unique.index(key) for key in keys], np.int32)
    return {"interpolation": "faceVarying", "values": values, "width": 2, "indices": index}


INTERIOR = (16 * BENT[4] + 4 * BENT[[1, 3, 5, 7]].sum(0) + BENT[[0, 2, 6, 8]].sum(0)) / 36
MIDDLE = smoothed(BENT[1], BENT[4], BENT[7])
CONCAVE = smoothed(BENT[1], BENT[4], BENT[3])


@pytest.mark.parametrize("rule", FACE_VARYING)
def test_face_varying_linear_interpolation(rule):
    rank = FACE_VARYING.index(rule)
    sharp_from = {"corner": 1, "junction": 2, "concave": 3, "edge": 4, "inside": 5}

    def expect(what, smooth, point):
        return BENT[point] if rank >= sharp_from[what] else smooth

    def uvs_at(regions, region, where):
        points, faces = grid(2, 2)
        made = surface(
            points, faces, 3, boundary="edgeOnly", face_varying=rule,
            uvs=charted(REGIONS[regions]),
        )  # fmt: skip
        uvs = made["uvs"] - np.array([10 * region, 0])
        near = np.abs(uvs - where).sum(axis=1).min()
        return near

    checks = [
        ("joined", 0, expect("corner", smoothed(BENT[1], BENT[0], BENT[3]), 0)),
        ("joined", 0, expect("edge", smoothed(BENT[0], BENT[1], BENT[2]), 1)),
        ("joined", 0, expect("inside", INTERIOR, 4)),
        ("three", 1, expect("junction", MIDDLE, 4)),
        ("concave", 0, expect("concave", CONCAVE, 4)),
    ]
    for regions, region, where in checks:
        assert uvs_at(regions, region, where) < 2e-6, (regions, where)


def test_values_that_agree_are_joined_and_others_are_not():
    corners = np.array([0, 1, 2, 1, 0, 3], np.int32)
    values = np.array([[0], [1], [2], [1], [5], [3]], np.float32)
    index, table = _core.weld_corners(corners, 4, values)
    assert index.tolist() == [0, 1, 2, 1, 3, 4] and table[:, 0].tolist() == [0, 1, 2, 5, 3]


def mesh(points, faces, rest="", name="M"):
    """Returns a mesh prim as text."""
    at = ", ".join(f"({x!r}, {y!r}, {z!r})" for x, y, z in np.asarray(points, float).tolist())
    corners = [str(i) for face in faces for i in face]
    return f"""def Mesh "{name}" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
        point3f[] points = [{at}]
        int[] faceVertexCounts = [{", ".join(str(len(face)) for face in faces)}]
        int[] faceVertexIndices = [{", ".join(corners)}]
        {rest}
    }}"""


def pairs(values):
    return "[" + ", ".join(f"({a!r}, {b!r})" for a, b in np.asarray(values, float).tolist()) + "]"


PREVIEW = """
def Material "Mat" {{
    token outputs:surface.connect = </Mat/S.outputs:surface>
    token outputs:displacement.connect = </Mat/S.outputs:displacement>
    def Shader "S" {{
        uniform token info:id = "UsdPreviewSurface"
        {displacement}
        token outputs:surface
        token outputs:displacement
    }}
    def Shader "T" {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @{file}@
        float2 inputs:st.connect = </Mat/X.outputs:result>
        float4 inputs:scale = (1, 0.5, 1, 1)
        float4 inputs:bias = (0, -0.125, 0, 0)
        token inputs:sourceColorSpace = "raw"
        token inputs:wrapS = "{wrap}"
        token inputs:wrapT = "{wrap}"
        float outputs:g
        float3 outputs:rgb
    }}
    def Shader "X" {{
        uniform token info:id = "UsdTransform2d"
        float2 inputs:in.connect = </Mat/R.outputs:result>
        float2 inputs:scale = (0.5, 0.5)
        float2 inputs:translation = (0.25, 0.125)
        float2 outputs:result
    }}
    def Shader "R" {{
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }}
}}
"""
CONSTANT = "float inputs:displacement = 0.25"
TEXTURED = "float inputs:displacement.connect = </Mat/T.outputs:g>"
BIND = "rel material:binding = </Mat>"


def preview(displacement, file="none.png", wrap="clamp"):
    return PREVIEW.format(displacement=displacement, file=file, wrap=wrap)


def ramp(folder, pixels):
    import OpenImageIO as oiio

    height, width, channels = pixels.shape
    out = oiio.ImageOutput.create(str(folder / "map.exr"))
    out.open(str(folder / "map.exr"), oiio.ImageSpec(width, height, channels, "float"))
    out.write_image(pixels.astype(np.float32))
    out.close()
    return "map.exr"


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("vertex", pairs(BENT)),
        ("varying", pairs(BENT)),
        ("uniform", pairs([(0, 0), (1, 0), (0, 1), (1, 1)])),
        ("constant", pairs([(0.5, 0.25)])),
        ("faceVarying", pairs(BENT[np.concatenate(GRID_FACES)])),
    ],
)
def test_texture_coordinates_in_every_interpolation(tmp_path, kind, text):
    points, faces = grid(2, 2)
    rest = f'{BIND}; texCoord2f[] primvars:st = {text} (interpolation = "{kind}")'
    stage = mesh(points, faces, rest) + preview(TEXTURED, ramp(tmp_path, np.zeros((2, 2, 3))))
    recorder, _ = load(tmp_path, stage, subdivision=2)
    made = recorder.mesh("/M")
    middle = np.abs(made["positions"][:, :2] - (1, 1)).sum(axis=1) < 1e-6
    uvs = np.unique(made["uvs"][middle], axis=0)
    if kind == "uniform":
        assert uvs.tolist() == [[0, 0], [0, 1], [1, 0], [1, 1]]
    else:
        smooth = {"vertex": INTERIOR, "varying": BENT[4], "constant": (0.5, 0.25)}
        assert uvs == pytest.approx(np.array([smooth.get(kind, INTERIOR)]), abs=1e-6)


def test_colours_follow_the_refined_faces(tmp_path):
    points, faces = grid(2, 1)
    colours = 'color3f[] primvars:displayColor = [(1,0,0), (0,0,1)] (interpolation = "uniform")'
    recorder, _ = load(tmp_path, mesh(points, faces, colours), subdivision=2)
    made = recorder.mesh("/M")
    rate, values = made["attributes"]["displayColor"]
    assert rate == "primitive" and len(values) == len(made["indices"]) == 2 * 2 * 16
    x = made["positions"][made["indices"]].mean(axis=1)[:, 0]
    assert ((values[:, 2] == 1) == (x > 1)).all()


@pytest.mark.parametrize("kind", ["vertex", "varying", "faceVarying"])
def test_primvars_are_refined_as_texture_coordinates_are(tmp_path, kind):
    """A primvar with the values of the texture coordinates is refined to the same values."""
    points, faces = grid(2, 2)
    values = BENT[np.concatenate(faces)] if kind == "faceVarying" else BENT
    if kind == "faceVarying":
        values[:4] += 0.25  # adds a seam
    rest = f"{BIND}; texCoord2f[] primvars:st = {pairs(values)} (interpolation = "
    rest += f'"{kind}"); color3f[] primvars:tint = ['
    rest += ", ".join(f"({u}, {v}, 0.5)" for u, v in values) + f'] (interpolation = "{kind}")'
    reader = """
        color3f inputs:diffuseColor.connect = </Mat/S/Tint.outputs:result>
        def Shader "Tint" { uniform token info:id = "UsdPrimvarReader_float3"
            string inputs:varname = "tint"
            float3 outputs:result }"""
    text = preview(TEXTURED + reader, ramp(tmp_path, np.zeros((2, 2, 3))))
    recorder, _ = load(tmp_path, mesh(points, faces, rest) + text, subdivision=2)
    made = recorder.mesh("/M")
    rate, tint = made["attributes"]["tint"]
    assert rate == "vertex" and tint[:, :2] == pytest.approx(made["uvs"], abs=1e-6)
    assert tint[:, 2] == pytest.approx(0.5) and np.ptp(tint[:, 0]) > 0.5


def test_subsets_name_refined_faces(tmp_path):
    subset = """def GeomSubset "Top" (prepend apiSchemas = ["MaterialBindingAPI"]) {
        uniform token elementType = "face"
        uniform token familyName = "materialBind"
        int[] indices = [1]
        rel material:binding = </Mat>
    }"""
    recorder, _ = load(tmp_path, mesh(CUBE, CUBE_FACES, subset) + preview(""), subdivision=2)
    made = recorder.mesh("/M")
    top = np.array([recorder.materials[i]["name"] == "/Mat" for i in made["face_materials"]])
    centre = made["positions"][made["indices"]].mean(axis=1)
    assert top.sum() * 6 == len(top)
    assert (centre[top].argmax(axis=1) == 2).all() and (centre[top][:, 2] > 0).all()


def test_a_plane_displaced_by_a_constant_and_by_a_texture(tmp_path):
    points, faces = grid(2, 2)
    st = f"{BIND}; texCoord2f[] primvars:st = {pairs(points[:, :2] / 2)}"
    st += ' (interpolation = "vertex")'
    recorder, _ = load(tmp_path, mesh(points, faces, st) + preview(CONSTANT), subdivision=2)
    made = recorder.mesh("/M")
    assert made["positions"][:, 2] == pytest.approx(0.25)
    # Green is linear in u and v, and so is bilinear filtering between texel centres.
    rows, columns = np.indices((8, 8))
    pixels = np.zeros((8, 8, 3))
    pixels[..., 1] = columns + 2 * (7 - rows)
    text = mesh(points, faces, st) + preview(TEXTURED, ramp(tmp_path, pixels))
    recorder, _ = load(tmp_path, text, subdivision=3)
    made = recorder.mesh("/M")
    u, v = 0.5 * made["uvs"].T + np.array([[0.25], [0.125]])
    inside = v > 1 / 16
    texel = (8 * u - 0.5) + 2 * (8 * v - 0.5)
    expected = texel * 0.5 - 0.125
    flat = made["positions"][:, 2]
    assert inside.sum() > 60 and flat[inside] == pytest.approx(expected[inside], abs=1e-5)
    assert made["normals"][:, 0].max() < 0


def test_a_constant_displacement_is_an_offset_along_the_normals(tmp_path):
    plain, _ = load(tmp_path, mesh(CUBE, CUBE_FACES), subdivision=4)
    moved, _ = load(tmp_path, mesh(CUBE, CUBE_FACES, BIND) + preview(CONSTANT), subdivision=4)
    a, b = plain.mesh("/M"), moved.mesh("/M")
    assert b["positions"] == pytest.approx(a["positions"] + 0.25 * a["normals"], abs=1e-6)
    # An offset surface has the normals of the original surface.
    assert np.einsum("ij,ij->i", a["normals"], b["normals"]).min() > 0.995


def test_displaced_seams_do_not_open(tmp_path):
    pixels = np.random.default_rng(2).random((16, 16, 3))
    st = np.tile([(0, 0), (1, 0), (1, 1), (0, 1)], (6, 1))
    rest = f'{BIND}; texCoord2f[] primvars:st = {pairs(st)} (interpolation = "faceVarying")'
    rest += """
        int[] creaseIndices = [0, 1, 3]
        int[] creaseLengths = [3]
        float[] creaseSharpnesses = [10]"""
    text = mesh(CUBE, CUBE_FACES, rest) + preview(TEXTURED, ramp(tmp_path, pixels))
    recorder, _ = load(tmp_path, text, subdivision=3)
    made = recorder.mesh("/M")
    _, index = np.unique(made["positions"], axis=0, return_inverse=True)
    triangles = index.reshape(-1)[made["indices"]]
    assert len(made["positions"]) > index.max() + 1
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    assert (edges[:, 0] != edges[:, 1]).all()
    there = {tuple(edge) for edge in edges.tolist()}
    assert len(there) == len(edges) and all((b, a) in there for a, b in there)


def test_polygons_are_displaced_where_their_points_are(tmp_path):
    rest = f'{BIND}; uniform token subdivisionScheme = "none"'
    recorder, _ = load(tmp_path, mesh(QUAD, [[0, 1, 2, 3]], rest) + preview(CONSTANT))
    made = recorder.mesh("/M")
    assert (
        made["positions"] == pytest.approx(QUAD + np.array([0, 0, 0.25]))
        and made["normals"] is None
    )


def test_displacement_needs_the_materials_output(tmp_path):
    text = preview(CONSTANT).replace("token outputs:displacement.connect", "token unused:d.connect")
    recorder, loaded = load(tmp_path, mesh(QUAD, [[0, 1, 2, 3]], BIND) + text)
    assert recorder.mesh("/M")["positions"][:, 2].max() == 0
    assert "displacement output does not lead to" in said(loaded)


def test_authored_normals_count_for_polygons_only(tmp_path):
    normals = 'normal3f[] normals = [(1,0,0), (1,0,0), (1,0,0), (1,0,0)] (interpolation = "vertex")'
    text = mesh(QUAD, [[0, 1, 2, 3]], normals)
    for level, z in (("off", 0.0), (0, 1.0), (1, 1.0), ("auto", 1.0)):
        recorder, _ = load(tmp_path, text, subdivision=level)
        assert recorder.mesh("/M")["normals"][:, 2] == pytest.approx(z)
    text = mesh(QUAD, [[0, 1, 2, 3]], normals + '; uniform token subdivisionScheme = "none"')
    recorder, _ = load(tmp_path, text, subdivision=3)
    made = recorder.mesh("/M")
    assert len(made["positions"]) == 4 and made["normals"][:, 0] == pytest.approx(1.0)


def level_of(loaded):
    """Returns the only refinement level in the report."""
    (line,) = [line for line in loaded.report.lines() if "refined" in line]
    return int(line.rsplit(" ", 1)[1])


CAMERA = """def Camera "C" {
    float focalLength = 20
    float horizontalAperture = 20
    float verticalAperture = 20
    double3 xformOp:translate = (0.5, 0.5, 4)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""


def test_automatic_levels_follow_the_size_in_the_picture(tmp_path):
    # A quad of edge length 1 at distance 4 covers a quarter of the image width: 50, 100 ... pixels,
    # or slightly less, since the distance to its corners is larger.
    text = CAMERA + mesh(QUAD, [[0, 1, 2, 3]])
    levels = []
    for width in (200, 400, 800):
        _, loaded = load(tmp_path, text, subdivision="auto", size=(width, width))
        levels.append(level_of(loaded))
    assert levels == [5, 6, 7]
    _, loaded = load(tmp_path, text, subdivision="auto", size=(60000, 60000))
    assert level_of(loaded) == subdivision.AUTO_LEVEL
    far = CAMERA.replace("(0.5, 0.5, 4)", "(0.5, 0.5, 400)") + mesh(QUAD, [[0, 1, 2, 3]])
    recorder, loaded = load(tmp_path, far, subdivision="auto", size=(200, 200))
    assert level_of(loaded) == 0 and len(recorder.mesh("/M")["positions"]) == 4


def test_the_largest_instance_counts(tmp_path):
    text = (
        CAMERA
        + f"""
    def PointInstancer "I" {{
        rel prototypes = </I/P>
        int[] protoIndices = [{", ".join(["0"] * 40)}]
        point3f[] positions = [(0, 0, 0), {", ".join(f"(0, 0, {-100 - i})" for i in range(39))}]
        def Xform "P" {{ {mesh(QUAD, [[0, 1, 2, 3]])} }}
    }}"""
    )
    _, loaded = load(tmp_path, text, subdivision="auto", size=(200, 200))
    assert level_of(loaded) == 5
    behind = text.replace("(0, 0, 0), ", "(0, 0, 8), ")
    _, loaded = load(tmp_path, behind, subdivision="auto", size=(200, 200))
    assert level_of(loaded) == 2


def test_memory_bounds_automatic_levels(tmp_path, monkeypatch):
    monkeypatch.setattr(subdivision, "AUTO_TRIANGLES", 1000)
    text = CAMERA + mesh(QUAD, [[0, 1, 2, 3]]) + mesh(QUAD, [[0, 1, 2, 3]], name="N")
    recorder, loaded = load(tmp_path, text, subdivision="auto", size=(800, 800))
    assert 0 < sum(len(mesh["indices"]) for mesh in recorder.meshes) <= 1000
    assert "less than the image needs" in said(loaded)


def test_a_level_beyond_memory_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(subdivision, "machine_limit", lambda: 1 << 30)
    with pytest.raises(WavecombError, match=r"subdivision 10: .* choose a lower level"):
        load(tmp_path, mesh(*grid(4, 4)), subdivision=10)


BROKEN = {
    "Loop subdivision needs triangles": 'uniform token subdivisionScheme = "loop"',
    "a crease refers to a point that does not exist": (
        "int[] creaseIndices = [0, 9]; int[] creaseLengths = [2]; float[] creaseSharpnesses = [5]"
    ),
    "a sharp corner refers to": "int[] cornerIndices = [-3]; float[] cornerSharpnesses = [5]",
}


@pytest.mark.parametrize("words", BROKEN)
def test_broken_rules_give_polygons_and_one_line(tmp_path, words):
    text = mesh(QUAD, [[0, 1, 2, 3]], BROKEN[words])
    recorder, loaded = load(tmp_path, text, subdivision=2)
    assert len(recorder.mesh("/M")["positions"]) == 4
    (line,) = [line for line in loaded.report.lines() if line.startswith("warning")]
    assert words in line and "/M" in line and "drawn as polygons" in line


@pytest.mark.parametrize(
    ("rest", "words"),
    [
        ("int[] creaseIndices = [0, 1]; int[] creaseLengths = [3]", "creases whose lengths"),
        ("int[] cornerIndices = [0, 1]; float[] cornerSharpnesses = [2]", "without a sharpness"),
        ('uniform token interpolateBoundary = "odd"', "interpolateBoundary 'odd'"),
        ('uniform token faceVaryingLinearInterpolation = "odd"', "'odd' is none of"),
        ('uniform token triangleSubdivisionRule = "odd"', "triangleSubdivisionRule"),
        ('uniform token subdivisionScheme = "odd"', "subdivisionScheme 'odd'"),
    ],
)
def test_rules_that_make_no_sense_are_left_out(tmp_path, rest, words):
    recorder, loaded = load(tmp_path, mesh(QUAD, [[0, 1, 2, 3]], rest), subdivision=1)
    assert words in said(loaded)
    assert len(recorder.mesh("/M")["positions"]) == (4 if "Scheme" in rest else 9)


def test_degenerate_faces_and_shapes_that_are_no_manifolds(tmp_path):
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, -1, 0],
                       [1, -1, 0]], float)  # fmt: skip
    twice = mesh(points, [[0, 1, 2, 2]])
    recorder, loaded = load(tmp_path, twice, subdivision=2)
    assert "a face uses a point twice: drawn as polygons" in said(loaded)
    line = mesh(points, [[0, 1], [0, 1, 2, 3]])
    recorder, loaded = load(tmp_path, line, subdivision=2)
    assert "fewer than three corners: drawn as polygons" in said(loaded)
    book = mesh(points, [[0, 1, 2, 3], [1, 0, 4, 5], [0, 1, 7, 6]])
    recorder, loaded = load(tmp_path, book, subdivision=3)
    assert "not manifold: sharp there" in said(loaded)
    made = recorder.mesh("/M")
    assert len(made["indices"]) == 3 * 2 * 64
    lengths = np.linalg.norm(made["normals"], axis=1)
    assert lengths == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("level", ["high", "-1", "11", "1.5", ""])
def test_levels_that_are_none(tmp_path, level):
    with pytest.raises(WavecombError, match="must be off, auto or a level from 0 to 10"):
        load(tmp_path, mesh(QUAD, [[0, 1, 2, 3]]), subdivision=level)


@pytest.mark.parametrize("command", ["render", "info"])
def test_the_option_of_the_command_line(tmp_path, command):
    stage = write(tmp_path, CAMERA + mesh(QUAD, [[0, 1, 2, 3]]))
    output = ["-o", str(tmp_path / "a.exr"), "--spp", "1"] if command == "render" else ["--json"]
    bad = CliRunner().invoke(main, [command, str(stage), *output, "--subdivision", "11"])
    assert bad.exit_code == 2 and "must be off, auto or a level from 0 to 10" in bad.stderr
    assert not (tmp_path / "a.exr").exists()
    if command == "info":
        for level, triangles in (("off", 2), ("0", 2), ("3", 128)):
            told = CliRunner().invoke(main, ["info", str(stage), "--json", "--subdivision", level])
            assert json.loads(told.stdout)["triangles"]["unique"] == triangles


def test_threads_change_nothing(tmp_path):
    text = "".join(mesh(CUBE + i, CUBE_FACES, name=f"M{i}") for i in range(8))
    one, _ = load(tmp_path, text, subdivision=3, threads=1)
    two, _ = load(tmp_path, text, subdivision=3, threads=2)
    for a, b in zip(one.meshes, two.meshes, strict=True):
        assert all(np.array_equal(a[key], b[key]) for key in ("positions", "normals", "indices"))


def test_cages_go_as_soon_as_they_are_refined(tmp_path, monkeypatch):
    body = """
    point3f[] points = [(0,0,0), (1,0,0), (1,1,0), (0,1,0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0,1,2,3]
"""
    cages, alive = [], []
    add, refine = subdivision.SubdivisionSurfaces.add, subdivision.SubdivisionSurfaces._refine

    def noted_add(self, group, number, draw, mesh, worn):
        cages.append(weakref.ref(mesh.cage))
        add(self, group, number, draw, mesh, worn)

    def noted_refine(self, batch):
        alive.append(sum(cage() is not None for cage in cages))
        refine(self, batch)

    monkeypatch.setattr(subdivision.SubdivisionSurfaces, "add", noted_add)
    monkeypatch.setattr(subdivision.SubdivisionSurfaces, "_refine", noted_refine)
    monkeypatch.setattr(subdivision, "_BATCH_TRIANGLES", 1)
    text = "".join(f'def Mesh "M{k}" {{ {body} }}\n' for k in range(4))
    load(tmp_path, text, subdivision=1)
    assert alive == [4, 3, 2, 1]
