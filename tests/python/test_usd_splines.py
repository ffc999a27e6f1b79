# SPDX-License-Identifier: Apache-2.0
"""Tests NURBS, Hermite curves and tetrahedra against formulas, and unsupported cases."""

from itertools import pairwise

import numpy as np
import pytest
from usd_recorder import load, said

H = np.sqrt(0.5)
CIRCLE = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)]
ROUND = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]


def listed(values):
    """Returns numbers or tuples in USD's text syntax."""
    return (
        "["
        + ", ".join(
            "(" + ", ".join(repr(float(x)) for x in v) + ")" if np.ndim(v) else repr(float(v))
            for v in values
        )
        + "]"
    )


def cox_de_boor(i, order, t, knots):
    """Evaluates a B-spline basis function by its definition. ``t`` must not be a knot."""
    if order == 1:
        return float(knots[i] <= t < knots[i + 1])
    total = 0.0
    for j, sign in ((i, 1), (i + 1, -1)):
        width = knots[j + order - 1] - knots[j]
        if width > 0:
            share = (t - knots[j]) / width
            total += (share if sign > 0 else 1 - share) * cox_de_boor(j, order - 1, t, knots)
    return total


def on_segments(mesh, u):
    """Evaluates all Bezier segments at u."""
    first = mesh["segments"] & 0x3FFFFFFF
    a, b, c, d = (mesh["positions"][first + k].astype(float) for k in range(4))
    v = 1 - u
    return v**3 * a + 3 * v * v * u * b + 3 * v * u * u * c + u**3 * d


def nurbs(points, knots, order, more=""):
    return f"""def NurbsCurves "C" {{
        int[] curveVertexCounts = [{len(points)}]
        point3f[] points = {listed(points)}
        double[] knots = {listed(knots)}
        int[] order = [{order}]
        {more} }}"""


@pytest.mark.parametrize("order", [2, 3, 4])
def test_polynomial_nurbs_curves_are_exact(tmp_path, order):
    rng = np.random.default_rng(order)
    count = 9
    points = rng.random((count, 3))
    knots = np.sort(rng.random(count + order))
    if order > 2:
        knots[order + 1] = knots[order + 2]  # one empty segment
    scene, loaded = load(tmp_path, nurbs(points, knots, order))
    mesh = scene.mesh("C")
    assert not loaded.report.warnings and mesh["kind"] == "cubic-tube"
    ends = knots[order - 1 : count + 1]
    pieces = [(a, b) for a, b in pairwise(ends) if b > a]
    assert len(mesh["segments"]) == len(pieces) == count - order + (order == 2)
    for u in (0.1, 0.5, 0.8):
        wanted = [
            sum(cox_de_boor(i, order, a + u * (b - a), knots) * points[i] for i in range(count))
            for a, b in pieces
        ]
        assert np.allclose(on_segments(mesh, u), wanted, atol=2e-6)


def test_a_rational_circle_is_round(tmp_path):
    points = [(x, y, 0) for x, y in CIRCLE]
    more = f"double[] pointWeights = {listed([1, H] * 4 + [1])}"
    scene, loaded = load(tmp_path, nurbs(points, ROUND, 3, more))
    mesh = scene.mesh("C")
    assert not loaded.report.warnings and len(mesh["segments"]) == 32
    radius = [np.linalg.norm(on_segments(mesh, u), axis=1) for u in (0, 0.3, 0.5, 1)]
    assert np.allclose(radius[0], 1, atol=1e-7) and np.abs(np.array(radius) - 1).max() < 2e-5


def test_ranges_and_widths_of_nurbs_curves(tmp_path):
    points = [(k, 0, 0) for k in range(6)]
    more = """double2[] ranges = [(1, 2.5)]
        float[] widths = [1, 2, 3, 4, 5, 6] ( interpolation = "vertex" )"""
    scene, loaded = load(tmp_path, nurbs(points, np.arange(-3, 7), 4, more))
    mesh = scene.mesh("C")
    assert not loaded.report.warnings
    (begin, *_), (*_, end) = on_segments(mesh, 0), on_segments(mesh, 1)
    assert np.allclose(begin, (2, 0, 0), atol=1e-6) and np.allclose(end, (3.5, 0, 0), atol=1e-6)
    assert np.allclose(2 * mesh["radii"], mesh["positions"][:, 0] + 1, atol=1e-5)


def test_hermite_curves_follow_their_tangents(tmp_path):
    rng = np.random.default_rng(3)
    points, tangents = rng.random((5, 3)), rng.random((5, 3))
    text = f"""def HermiteCurves "C" {{
        int[] curveVertexCounts = [2, 3]
        point3f[] points = {listed(points)}
        vector3f[] tangents = {listed(tangents)}
        float[] widths = [1, 2, 3, 4, 5] ( interpolation = "vertex" ) }}"""
    scene, loaded = load(tmp_path, text)
    mesh = scene.mesh("C")
    assert not loaded.report.warnings and len(mesh["segments"]) == 3
    u, first = 0.3, np.array([0, 2, 3])
    wanted = (
        (2 * u**3 - 3 * u**2 + 1) * points[first]
        + (u**3 - 2 * u**2 + u) * tangents[first]
        + (3 * u**2 - 2 * u**3) * points[first + 1]
        + (u**3 - u**2) * tangents[first + 1]
    )
    assert np.allclose(on_segments(mesh, u), wanted, atol=1e-6)
    assert np.allclose(mesh["radii"][[0, 3, 4, 7, 10]], [0.5, 1, 1.5, 2, 2.5])


def sphere(more="", points=None):
    """Returns a half circle, v from pole to pole, rotated about z by u."""
    arc = [(0, -1), (1, -1), (1, 0), (1, 1), (0, 1)]
    if points is None:
        points = [(r * x, r * y, z) for r, z in arc for x, y in CIRCLE]
    weights = np.outer([1, H, 1, H, 1], [1, H] * 4 + [1]).ravel()
    return f"""def NurbsPatch "P" {{
        int uVertexCount = 9
        int vVertexCount = 5
        int uOrder = 3
        int vOrder = 3
        double[] uKnots = {listed(ROUND)}
        double[] vKnots = [0, 0, 0, 1, 1, 2, 2, 2]
        token uForm = "closed"
        point3f[] points = {listed(points)}
        double[] pointWeights = {listed(weights)}
        {more} }}"""


@pytest.mark.parametrize("way", ["rightHanded", "leftHanded"])
def test_a_rational_sphere_is_round(tmp_path, way):
    more = f'uniform token orientation = "{way}"\ndouble3 xformOp:scale = (-2, 2, 2)\n'
    more += 'uniform token[] xformOpOrder = ["xformOp:scale"]'
    scene, loaded = load(tmp_path, sphere(more))
    mesh = scene.mesh("P")
    out = 1.0 if way == "rightHanded" else -1.0
    assert not loaded.report.warnings
    points, normals = mesh["positions"], mesh["normals"]
    assert np.allclose(np.linalg.norm(points, axis=1), 2, atol=1e-6)
    poles = np.abs(points[:, 2]) > 1.999
    assert np.allclose(normals[~poles], out * points[~poles] / 2, atol=1e-5)
    assert np.allclose(normals[poles], out * points[poles] / 2, atol=1e-3)
    a, b, c = points[mesh["indices"]].transpose(1, 0, 2)
    volume = np.einsum("ij,ij->i", np.cross(a, b), c).sum() / 6
    assert out * volume == pytest.approx(4 / 3 * np.pi * 8, rel=0.02)


def test_a_patch_with_a_bend_has_an_edge_and_no_gap(tmp_path):
    text = """def NurbsPatch "P" {
        int uVertexCount = 3
        int vVertexCount = 2
        int uOrder = 2
        int vOrder = 2
        double[] uKnots = [0, 0, 1, 2, 2]
        double[] vKnots = [0, 0, 1, 1]
        point3f[] points = [(0,0,0), (1,0,1), (2,0,0), (0,1,0), (1,1,1), (2,1,0)]
        float[] primvars:odd = [1, 2]
        int[] trimCurve:counts = [1] }"""
    scene, loaded = load(tmp_path, text)
    mesh = scene.mesh("P")
    at = np.isclose(mesh["positions"][:, 0], 1)
    assert len(np.unique(mesh["normals"][at].round(5), axis=0)) == 2
    assert len(np.unique(mesh["positions"][at], axis=0)) == at.sum() // 2 == 9
    assert "not supported: trim curves of NURBS patches (drawn whole): /P" in said(loaded)
    assert "not supported: primvars over NURBS patches, but texture" in said(loaded)
    low, high = mesh["uvs"].min(axis=0), mesh["uvs"].max(axis=0)
    assert np.allclose([low, high], [(0, 0), (1, 1)])


def test_patches_that_change_are_blurred(tmp_path):
    points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)]
    text = f"""def NurbsPatch "P" {{
        int uVertexCount = 2
        int vVertexCount = 2
        int uOrder = 2
        int vOrder = 2
        double[] uKnots = [0, 0, 1, 1]
        double[] vKnots = [0, 0, 1, 1]
        point3f[] points.timeSamples = {{
            0: {listed(points)}, 1: {listed([(x, y, 2) for x, y, _ in points])} }} }}"""
    scene, loaded = load(tmp_path, text, frame=0, shutter=(0, 1))
    shape = scene.mesh("P")["positions"]
    assert shape.shape == (2, 81, 3) and not loaded.report.warnings
    assert np.allclose(shape[1, :, 2] - shape[0, :, 2], 2)


TETS = """point3f[] points = [(0,0,0), (1,0,0), (0,1,0), (0,0,1), (1,1,1)]
    int4[] tetVertexIndices = [(0, 1, 2, 3), (1, 4, 2, 3)]"""


@pytest.mark.parametrize(
    ("more", "faces", "volume"),
    [
        ("", 6, 1 / 6 + 1 / 3),
        ('uniform token orientation = "leftHanded"', 6, -1 / 6 - 1 / 3),
        ("int3[] surfaceFaceVertexIndices = [(0, 2, 1), (0, 1, 3)]", 2, 0),
    ],
)
def test_tetrahedra_are_drawn_by_their_surface(tmp_path, more, faces, volume):
    scene, loaded = load(
        tmp_path,
        f"""def TetMesh "T" {{ {TETS}
            color3f[] primvars:displayColor = [(1,0,0), (0,1,0), (0,0,1), (1,1,0), (0,1,1)] (
                interpolation = "vertex" )
            {more} }}""",
        subdivision="auto",
    )
    mesh = scene.mesh("T")
    assert len(mesh["indices"]) == faces and not loaded.report.warnings
    a, b, c = mesh["positions"][mesh["indices"]].transpose(1, 0, 2)
    assert np.einsum("ij,ij->i", np.cross(a, b), c).sum() / 6 == pytest.approx(volume, abs=1e-6)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (nurbs([(0, 0, 0)] * 4, [0, 1], 4), "need 8 knots, and there are 2"),
        (nurbs([(0, 0, 0)] * 4, [0, 0, 0, 0, 1, 1, 1, 0], 4), "knots are not in order"),
        (nurbs([(0, 0, 0)] * 4, [0] * 8, 4), "its range is empty"),
        (nurbs([(0, 0, 0)] * 4, range(9), 5), "order 5 with 4 control points"),
        (nurbs([(0, 0, 0)] * 4, [0, 0, 1, 2, 3, 3], 2, "double[] pointWeights = [0, 0, 0, 0]"),
         "add up to 0"),
        ('def HermiteCurves "C" {\n int[] curveVertexCounts = [2]\n'
         "point3f[] points = [(0, 0, 0), (1, 0, 0)] }", "as many tangents"),
        (sphere(points=[(0, 0, 0)]), "9 x 5 control points, and there are 1"),
        ('def TetMesh "T" {\n point3f[] points = [(0, 0, 0)]\n'
         "int4[] tetVertexIndices = [(0, 1, 2, 3)] }", "points that do not exist"),
    ],
)  # fmt: skip
def test_what_cannot_be_drawn_is_left_out(tmp_path, text, says):
    scene, loaded = load(tmp_path, text)
    assert not scene.meshes
    (warning,) = loaded.report.warnings
    assert "left out" in warning.what and says in warning.what


def two_nurbs(knots="0, 0, 0, 0, 1, 1, 1, 1", point="0, 1, 0", more=""):
    """Returns two cubic curves of one segment each. The arguments apply to the second curve."""
    return f"""def NurbsCurves "C" {{
        int[] curveVertexCounts = [4, 4]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0),
                            (0, 1, 0), (1, 1, 0), (2, 1, 0), ({point})]
        double[] knots = [0, 0, 0, 0, 1, 1, 1, 1, {knots}]
        int[] order = [4, 4]
        float[] widths = [1, 2] ( interpolation = "uniform" )
        {more} }}"""


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (two_nurbs(knots="0, 0, 0, nan, 1, 1, 1, 1"), "knots are not in order"),
        (two_nurbs(point="nan, 1, 0"), "not finite"),
        (two_nurbs(more="double[] pointWeights = [1, 1, 1, 1, nan, 1, 1, 1]"), "add up to 0"),
        ('def HermiteCurves "C" {\n int[] curveVertexCounts = [2, 2]\n'
         "point3f[] points = [(0, 0, 0), (3, 0, 0), (0, 1, 0), (3, 1, 0)]\n"
         "vector3f[] tangents = [(1, 0, 0), (1, 0, 0), (nan, 0, 0), (1, 0, 0)] }", "not finite"),
    ],
)  # fmt: skip
def test_one_bad_curve_is_left_out_alone(tmp_path, text, says):
    scene, loaded = load(tmp_path, text)
    mesh = scene.mesh("C")
    assert np.all(mesh["positions"][:, 1] == 0) and np.isfinite(mesh["positions"]).all()
    assert mesh["positions"][:, 0].max() == 3
    (warning,) = loaded.report.warnings
    assert "1 of 2 curves left out" in warning.what and says in warning.what


def test_parts_of_many_nurbs_curves(tmp_path, monkeypatch):
    """Evaluating many segments in blocks gives the same points as evaluating them at once."""
    text = two_nurbs()
    whole = load(tmp_path, text)[0].mesh("C")["positions"]
    monkeypatch.setattr("wavecomb.usd.geometry.strands._AT_ONCE", 1)
    assert np.array_equal(load(tmp_path, text)[0].mesh("C")["positions"], whole)
