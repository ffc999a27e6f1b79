# SPDX-License-Identifier: Apache-2.0
"""Tests that faces that use points that are not finite are left out with a warning."""

import numpy as np
import pytest
from usd_recorder import load, said

import wavecomb
from wavecomb.usd.geometry.mesh_arrays import replace_invalid_steps

NAN = float("nan")


def grid(n, bad, kind="none", extra="", faces=4):
    """Returns n x n faces in [0, n]^2 whose point ``bad`` is not finite."""
    points = [(x, y, 0) for y in range(n + 1) for x in range(n + 1)]
    if bad is not None:
        points[bad] = ("nan", 0, 0)
    corners = [y * (n + 1) + x for y in range(n) for x in range(n)]
    quads = [(a, a + 1, a + n + 2, a + n + 1) for a in corners]
    if faces == 3:
        quads = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    text = ", ".join("({}, {}, {})".format(*p) for p in points)
    indices = ", ".join(str(i) for face in quads for i in face)
    return f"""def Mesh "M" {{
        point3f[] points = [{text}]
        int[] faceVertexCounts = [{", ".join(str(len(q)) for q in quads)}]
        int[] faceVertexIndices = [{indices}]
        uniform token subdivisionScheme = "{kind}"
        {extra}
    }}"""


@pytest.mark.parametrize(
    ("faces", "lost", "whole"), [(4, 4, 9), (3, 6, 18)], ids=["quads", "triangles"]
)
def test_faces_that_use_a_bad_point_are_left_out(tmp_path, faces, lost, whole):
    scene, loaded = load(tmp_path, grid(3, 5, faces=faces))
    what = f"warning: mesh without {lost} of {whole} faces: they have points that are not finite"
    assert said(loaded).count(what) == 1 and said(loaded).count("/M") == 1
    mesh = scene.mesh("M")
    triangles_of_a_face = faces - 2
    assert len(mesh["indices"]) == (whole - lost) * triangles_of_a_face
    assert 5 not in mesh["indices"]


def test_points_far_away_once_they_are_placed(tmp_path):
    """Points that a transform moves too far away are left out; all other points are kept."""
    text = grid(3, 5).replace("nan", "1e17")
    order = 'uniform token[] xformOpOrder = ["xformOp:scale"]'
    scale = f"double3 xformOp:scale = (100, 100, 100)\n{order}"
    scene, loaded = load(tmp_path, text.replace("{", f"{{ {scale}\n", 1))
    assert "mesh without 4 of 9 faces" in said(loaded) and len(scene.meshes) == 1
    scene, loaded = load(tmp_path, text)
    assert not loaded.report.warnings and len(scene.mesh("M")["indices"]) == 18


def test_a_bad_point_that_no_face_uses_costs_nothing(tmp_path):
    text = grid(2, None).replace("point3f[] points = [", "point3f[] points = [(nan, 0, 0), ")
    before = text.index("faceVertexIndices")
    head, tail = text[:before], text[before:]
    indices = tail[tail.index("[") + 1 : tail.index("]")]
    shifted = ", ".join(str(int(i) + 1) for i in indices.split(","))
    scene, loaded = load(tmp_path, head + tail.replace(indices, shifted))
    assert not loaded.report.warnings and len(scene.mesh("M")["indices"]) == 8


def test_a_mesh_of_bad_faces_alone_is_left_out(tmp_path):
    scene, loaded = load(tmp_path, grid(2, 4))
    assert "mesh left out: its points are not finite or too far away: /M" in said(loaded)
    assert not scene.meshes


def test_values_of_faces_stay_with_them(tmp_path):
    colours = ", ".join(f"({i / 10}, 0, 0)" for i in range(9))
    extra = f'color3f[] primvars:displayColor = [{colours}] (\ninterpolation = "uniform"\n)'
    scene, _ = load(tmp_path, grid(3, 5, extra=extra + "\nint[] holeIndices = [8]"))
    mesh = scene.mesh("M")
    rate, values = mesh["attributes"]["displayColor"]
    # Faces 0, 1, 3 and 4 use point 5, and face 8 is a hole.
    assert rate == "primitive"
    assert values[::2, 0] == pytest.approx([0.2, 0.5, 0.6, 0.7], abs=1e-6)


def test_subdivision_leaves_them_out_too(tmp_path):
    scene, loaded = load(tmp_path, grid(3, 5, "catmullClark"), subdivision="2")
    assert "mesh without 4 of 9 faces" in said(loaded)
    mesh = scene.mesh("M")
    used = mesh["positions"][mesh["indices"].ravel()]
    assert len(mesh["indices"]) == 5 * 16 * 2
    # The point that replaces the bad one lies among its neighbours, so the grid stays flat.
    assert np.abs(used[:, 2]).max() == 0 and used.min() > -0.1 and used.max() < 3.1
    assert not ((used[:, :2] < 1.6).all(axis=1)).any()


def test_curves_that_use_a_bad_point_are_left_out(tmp_path):
    points = [(x, y, 0) for x in range(3) for y in range(4)]
    points[5] = ("inf", 0, 0)
    text = ", ".join("({}, {}, {})".format(*p) for p in points)
    scene, loaded = load(
        tmp_path,
        f"""def BasisCurves "C" {{ point3f[] points = [{text}]
            int[] curveVertexCounts = [4, 4, 4]
            float[] widths = [0.1]
            uniform token type = "linear"
        }}""",
    )
    assert "warning: 1 of 3 curves left out: they have points that are not finite" in said(loaded)
    (curves,) = scene.meshes
    assert len(curves["segments"]) == 6 and set(curves["positions"][:, 0]) == {0, 2}


def test_bad_points_of_particles_are_left_out(tmp_path):
    scene, loaded = load(
        tmp_path,
        """def Points "P" { point3f[] points = [(nan, 0, 0), (1, 2, 3), (0, 0, 1e30)]
            float[] widths = [2]
            int64[] ids = [7, 8, 9]
        }""",
    )
    what = "warning: 2 of 3 points left out: they are not finite or too far away: /P"
    assert what in said(loaded)
    (points,) = scene.meshes
    assert points["radii"].tolist() == [0, 1, 0]
    assert points["positions"].tolist() == [[1, 2, 3]] * 3


def test_points_that_are_bad_at_a_step_of_the_shutter():
    first, last = np.zeros((3, 3), np.float32), np.ones((3, 3), np.float32)
    middle = np.full((3, 3), 0.5, np.float32)
    first[1, 0] = middle[1, 1] = np.nan
    last[2] = first[2] = middle[2] = np.inf
    found = replace_invalid_steps([first, middle, last])
    assert [shape[1].tolist() for shape in found] == [[1, 1, 1]] * 3
    assert [shape[2].tolist() for shape in found] == [[0] * 3, [0.5] * 3, [1] * 3]
    same = [np.zeros((2, 3), np.float32)] * 2
    assert replace_invalid_steps(same)[0] is same[0]


def test_the_picture_has_the_other_faces(tmp_path):
    stage = tmp_path / "s.usda"
    camera = """def Camera "C" { token projection = "orthographic"
        float horizontalAperture = 30
        float verticalAperture = 30
        double3 xformOp:translate = (1.5, 1.5, 5)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def DomeLight "L" { }
    """
    text = (camera + grid(3, 5)).replace("{", "{\n").replace("}", "\n}\n")
    stage.write_text("#usda 1.0\n" + text)
    depth = wavecomb.render(stage, size=(6, 6), spp=4, aovs=["depth"]).depth
    there = np.isfinite(np.squeeze(depth))[::2, ::2]
    assert there.tolist() == [[True] * 3, [False, False, True], [False, False, True]]
