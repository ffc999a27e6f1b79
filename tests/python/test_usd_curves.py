# SPDX-License-Identifier: Apache-2.0
"""Tests curves and points: bases, wrap modes, widths, normals, colours and broken input."""

import itertools
import time

import numpy as np
import OpenImageIO
import pytest
from usd_recorder import INHERIT, Recorder, load, said

from wavecomb.usd import load_stage

MATRICES = {
    "bezier": [[-1, 3, -3, 1], [3, -6, 3, 0], [-3, 3, 0, 0], [1, 0, 0, 0]],
    "bspline": [[-1 / 6, 0.5, -0.5, 1 / 6], [0.5, -1, 0.5, 0], [-0.5, 0, 0.5, 0],
                [1 / 6, 4 / 6, 1 / 6, 0]],
    "catmullRom": [[-0.5, 1.5, -1.5, 0.5], [1, -2.5, 2, -0.5], [-0.5, 0, 0.5, 0], [0, 1, 0, 0]],
}  # fmt: skip
BEFORE, AFTER, FIRST = 0x80000000, 0x40000000, 0x3FFFFFFF


def triples(values):
    return "[" + ", ".join("(" + ", ".join(repr(float(x)) for x in v) + ")" for v in values) + "]"


def numbers(values):
    return "[" + ", ".join(repr(float(x)) for x in values) + "]"


def curves(points, counts, more="", basis="bspline", wrap="nonperiodic", name="C"):
    kind = "linear" if basis == "linear" else "cubic"
    basis = "bezier" if basis == "linear" else basis
    return f"""def BasisCurves "{name}" {{
        uniform token type = "{kind}"
        uniform token basis = "{basis}"
        uniform token wrap = "{wrap}"
        int[] curveVertexCounts = [{", ".join(map(str, counts))}]
        point3f[] points = {triples(points)}
        {more}
    }}"""


def widths(values, interpolation):
    return f'float[] widths = {numbers(values)} (\n interpolation = "{interpolation}"\n)\n'


def segment_values(points, basis, wrap, u):
    """Evaluates every segment of one curve at u with the basis matrices."""
    points = np.asarray(points, float)
    n = len(points)
    if basis == "linear":
        last = n if wrap == "periodic" else n - 1
        return np.array([(1 - u) * points[k] + u * points[(k + 1) % n] for k in range(last)])
    step = 3 if basis == "bezier" else 1
    if wrap == "pinned" and step == 1:
        first, last = 2 * points[0] - points[1], 2 * points[-1] - points[-2]
        points = np.concatenate([[first], points, [last]])
        n += 2
    count = n // step if wrap == "periodic" else (n - 4) // step + 1
    powers = np.array([u**3, u**2, u, 1.0])
    weights = powers @ np.array(MATRICES[basis])
    return np.array(
        [sum(w * points[(step * k + j) % n] for j, w in enumerate(weights)) for k in range(count)]
    )


def bezier_values(mesh, values, u):
    """Evaluates the converted Bezier segments at u."""
    first = (mesh["segments"] & FIRST).astype(int)
    if mesh["kind"].startswith("linear"):
        return (1 - u) * values[first] + u * values[first + 1]
    w = 1 - u
    weights = (w**3, 3 * w * w * u, 3 * w * u * u, u**3)
    return sum(x * values[first + k] for k, x in enumerate(weights))


CASES = [
    (basis, wrap, counts)
    for basis in ("linear", "bezier", "bspline", "catmullRom")
    for wrap in ("nonperiodic", "periodic", "pinned")
    for counts in ([[4, 7, 10]] if (basis, wrap) != ("bezier", "periodic") else [[3, 6, 9]])
]


@pytest.mark.parametrize(("basis", "wrap", "counts"), CASES)
def test_every_basis_and_wrap_goes_through_the_same_points(tmp_path, basis, wrap, counts):
    points = np.random.default_rng(1).random((sum(counts), 3))
    text = curves(points, counts, widths([0.5], "constant"), basis, wrap)
    scene, loaded = load(tmp_path, text)
    (mesh,) = scene.meshes
    assert mesh["kind"] == ("linear-tube" if basis == "linear" else "cubic-tube")
    assert (mesh["radii"] == np.float32(0.25)).all()
    starts = np.cumsum([0, *counts])
    for u in (0.0, 0.3, 1.0):
        parts = [segment_values(points[a:b], basis, wrap, u) for a, b in itertools.pairwise(starts)]
        found = bezier_values(mesh, mesh["positions"], u)
        assert np.allclose(found, np.concatenate(parts), atol=1e-6)
    # Neighbouring segments share a point, and flags mark segments that have a neighbour.
    words = mesh["segments"]
    sizes = [len(part) for part in parts]
    inner = np.concatenate([np.arange(size) for size in sizes])
    last = np.concatenate([np.arange(size)[::-1] for size in sizes])
    closed = wrap == "periodic"
    assert (((words & BEFORE) > 0) == ((inner > 0) | closed)).all()
    assert (((words & AFTER) > 0) == ((last > 0) | closed)).all()
    first, step = (words & FIRST).astype(int), 1 if basis == "linear" else 3
    assert (np.diff(first)[inner[1:] > 0] == step).all()
    # In a closed curve, the point beyond one end is a point of the segment at the other end.
    positions = mesh["positions"]
    for k in np.flatnonzero((inner == 0) & closed):
        end = k + sizes[int(np.sum(inner[: k + 1] == 0)) - 1] - 1
        assert (positions[first[k] - 1] == positions[first[end] + step - 1]).all()
        assert (positions[first[end] + step + 1] == positions[first[k] + 1]).all()
        assert (positions[first[end] + step] == positions[first[k]]).all()
    assert loaded.report.counts["curves"] == 1


@pytest.mark.parametrize(("basis", "wrap", "counts"), CASES)
@pytest.mark.parametrize("kind", ["constant", "uniform", "varying", "vertex"])
def test_widths_of_every_interpolation(tmp_path, basis, wrap, counts, kind):
    rng = np.random.default_rng(2)
    points = rng.random((sum(counts), 3))
    segments = [len(segment_values(np.zeros((n, 3)), basis, wrap, 0.0)) for n in counts]
    ends = [s if wrap == "periodic" else s + 1 for s in segments]
    size = {"constant": 1, "uniform": 3, "varying": sum(ends), "vertex": sum(counts)}[kind]
    values = 0.5 + rng.random(size)
    scene, _ = load(tmp_path, curves(points, counts, widths(values, kind), basis, wrap))
    (mesh,) = scene.meshes
    for u in (0.0, 0.4, 1.0):
        want = []
        for c, _n in enumerate(counts):
            if kind == "constant":
                want += [values[0]] * segments[c]
            elif kind == "uniform":
                want += [values[c]] * segments[c]
            elif kind == "varying":
                own = values[sum(ends[:c]) : sum(ends[: c + 1])]
                for k in range(segments[c]):
                    want.append((1 - u) * own[k] + u * own[(k + 1) % len(own)])
            else:
                own = values[sum(counts[:c]) : sum(counts[: c + 1])]
                want += list(segment_values(own[:, None], basis, wrap, u)[:, 0])
        found = bezier_values(mesh, mesh["radii"], u)
        assert np.allclose(found, 0.5 * np.array(want), atol=1e-6)


def test_normals_make_ribbons_and_turn_with_the_prim(tmp_path):
    points = np.random.default_rng(3).random((5, 3))
    normals = 'normal3f[] normals = [(0,0,1), (0,1,1), (0,0,1), (1,0,1), (0,0,1)] (\n' \
        ' interpolation = "vertex"\n)\n'  # fmt: skip
    turn = 'double3 xformOp:rotateXYZ = (90, 0, 0)\nuniform token[] xformOpOrder = [' \
        '"xformOp:rotateXYZ"]\n'  # fmt: skip
    text = curves(points, [5], widths([0.1], "constant") + normals + turn, "linear")
    scene, _ = load(tmp_path, text)
    (mesh,) = scene.meshes
    assert mesh["kind"] == "linear-ribbon"
    x, y, z = points.T
    assert np.allclose(mesh["positions"], np.stack([x, -z, y], 1), atol=1e-6)
    assert np.allclose(mesh["normals"][0], (0, -1, 0), atol=1e-6)
    bad = text.replace("(0,1,1)", "(0,0,0)")
    scene, loaded = load(tmp_path, bad)
    assert scene.meshes[0]["kind"] == "linear-tube" and "drawn as tubes" in said(loaded)


def test_scales_reach_widths_and_uneven_ones_become_a_group(tmp_path):
    points = np.random.default_rng(4).random((4, 3))
    scale = 'float3 xformOp:scale = (2, 2, 2)\nuniform token[] xformOpOrder = ["xformOp:scale"]\n'
    more = widths([0.5], "constant") + scale
    scene, _ = load(tmp_path, curves(points, [4], more))
    assert np.allclose(scene.meshes[0]["radii"], 0.5)
    scene, _ = load(tmp_path, curves(points, [4], more.replace("(2, 2, 2)", "(2, 2, 1)")))
    ((mesh, matrix, material),) = scene.world_meshes()
    assert np.allclose(mesh["radii"], 0.25) and np.allclose(matrix, np.diag([2, 2, 1, 1]))
    assert mesh["name"] == "/C" and material < len(scene.materials)
    assert scene.groups[0]["meshes"] == []


def test_colours_per_curve_and_per_point(tmp_path):
    points = np.random.default_rng(5).random((9, 3))
    colours = 'color3f[] primvars:displayColor = [(1,0,0), (0,1,0)] (\n' \
        ' interpolation = "uniform"\n)\n'  # fmt: skip
    scene, _ = load(tmp_path, curves(points, [4, 5], colours + widths([1], "constant")))
    (mesh,) = scene.meshes
    rate, found = mesh["attributes"]["displayColor"]
    assert rate == "primitive" and found.tolist() == [[1, 0, 0], [0, 1, 0], [0, 1, 0]]
    scene, _ = load(
        tmp_path,
        f"""def Points "P" {{
            point3f[] points = {triples(points[:3])}
            float[] widths = [1, 2, 3] (\n interpolation = "vertex"\n)
            color3f[] primvars:displayColor = [(1,0,0), (0,1,0), (0,0,1)] (
                interpolation = "vertex"\n)
        }}""",
    )
    (mesh,) = scene.meshes
    assert mesh["kind"] == "sphere" and mesh["radii"].tolist() == [0.5, 1.0, 1.5]
    rate, found = mesh["attributes"]["displayColor"]
    assert rate == "primitive" and found.tolist() == [[1, 0, 0], [0, 1, 0], [0, 0, 1]]


def test_texture_coordinates(tmp_path):
    points = np.random.default_rng(6).random((9, 3))
    roots = 'texCoord2f[] primvars:st = [(0.1,0.2), (0.3,0.4)] (\n' \
        ' interpolation = "uniform"\n)\n'  # fmt: skip
    text = """def Material "M" {
        token outputs:surface.connect = </M/S.outputs:surface>
        def Shader "S" {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>
            token outputs:surface }
        def Shader "T" {
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @hair.png@
            float2 inputs:st.connect = </M/R.outputs:result>
            float3 outputs:rgb }
        def Shader "R" {
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result } }
    """
    bound = "rel material:binding = </M>\n" + widths([1], "constant")
    body = curves(points, [4, 5], bound + roots).replace(
        'def BasisCurves "C"', 'def BasisCurves "C" (prepend apiSchemas = ["MaterialBindingAPI"])'
    )
    image = np.zeros((2, 2, 3), np.uint8)
    OpenImageIO.ImageBuf(image).write(str(tmp_path / "hair.png"))
    scene, _ = load(tmp_path, text + body)
    uvs = scene.meshes[0]["uvs"]
    assert np.allclose(uvs[:, 0], [[0.1, 0.2], [0.3, 0.4], [0.3, 0.4]])
    assert (uvs[:, 0] == uvs[:, 1]).all()
    # Without texture coordinates, u runs along the curve.
    scene, loaded = load(tmp_path, text + body.replace("primvars:st", "primvars:other"))
    assert np.allclose(scene.meshes[0]["uvs"][:, :, 0], [[0, 1], [0, 0.5], [0.5, 1]])
    assert "generated" in said(loaded)


def test_curves_are_instanced(tmp_path):
    points = np.random.default_rng(7).random((4, 3))
    scene, _ = load(
        tmp_path,
        f"""def PointInstancer "I" {{
            rel prototypes = </I/C>
            int[] protoIndices = [0, 0]
            point3f[] positions = [(0,0,0), (5,0,0)]
            {curves(points, [4], widths([0.2], "constant"))}
        }}""",
    )
    assert len(scene.meshes) == 1 and len(scene.world_meshes()) == 2
    assert scene.meshes[0]["material"] in (INHERIT, 0)


POINTS = triples(np.random.default_rng(8).random((4, 3)))


@pytest.mark.parametrize(
    ("text", "words", "drawn"),
    [
        (curves(np.ones((5, 3)), [4]), "ask for 4 points, and there are 5", 0),
        (curves(np.ones((4, 3)), [5, -1]), "ask for 4 points", 0),
        (curves([(0, 0, 0), (1, float("nan"), 0), (2, 0, 0), (3, 0, 0)], [4]), "not finite", 0),
        (curves(np.random.rand(6, 3), [4, 2], widths([1], "constant")), "does not fit bspline", 1),
        (curves(np.random.rand(6, 3), [6], widths([1], "constant"), "bezier"), "does not fit", 0),
        (curves(np.random.rand(4, 3), [4], widths([-1], "constant")), "negative", 1),
        (curves(np.random.rand(4, 3), [4], widths([1, float("nan"), 1, 1], "vertex")), "finite", 1),
        (curves(np.random.rand(4, 3), [4], widths([1, 2, 3], "vertex")), "3 values where 4", 1),
        (curves(np.random.rand(4, 3), [4], wrap="round"), "its wrap is 'round'", 0),
        (f'def Points "C" {{\n point3f[] points = {POINTS}\n float[] widths = [1, 2]\n }}',
         "2 values where 4", 1),
        ('def Points "C" {\n point3f[] points = [(0, 0, inf)]\n float[] widths = [1]\n }',
         "not finite", 0),
    ],
)  # fmt: skip
def test_broken_prims_are_named_once(tmp_path, text, words, drawn):
    scene, loaded = load(tmp_path, text)
    assert len(scene.meshes) == drawn
    (line,) = [line for line in loaded.report.lines() if line.startswith("warning: ")]
    assert words in line and line.endswith("/C")


@pytest.mark.slow
def test_many_curves_load_in_a_second(tmp_path):
    from pxr import Usd, UsdGeom, Vt

    count, size = 100_000, 8
    stage = Usd.Stage.CreateNew(str(tmp_path / "hair.usdc"))
    hair = UsdGeom.BasisCurves.Define(stage, "/Hair")
    hair.CreateTypeAttr("cubic")
    hair.CreateBasisAttr("bspline")
    hair.CreateWrapAttr("pinned")
    points = np.random.default_rng(9).random((count * size, 3)).astype(np.float32)
    hair.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    hair.CreateCurveVertexCountsAttr(Vt.IntArray(count, size))
    hair.CreateWidthsAttr(Vt.FloatArray(count * size, 0.01))
    stage.Save()
    started = time.process_time()
    scene = load_stage(tmp_path / "hair.usdc", builder_factory=Recorder).scene
    assert len(scene.meshes[0]["segments"]) == count * (size - 1)
    # Python code that ran for each curve would take several seconds.
    assert time.process_time() - started < 5.0
