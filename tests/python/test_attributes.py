# SPDX-License-Identifier: Apache-2.0
"""Tests primvars that drive materials, in every interpolation."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from test_usd_material import BIND, surface
from usd_recorder import load, said, write

import wavecomb
from wavecomb.usd import load_stage
from wavecomb.usd.graphs.values import POINT_SIZE

_core = pytest.importorskip("wavecomb._core")

POINTS = [(x, y, 0.0) for y in range(3) for x in range(3)]
FACES = [(0, 1, 4), (0, 4, 3), (1, 2, 5), (1, 5, 4), (3, 4, 7), (3, 7, 6), (4, 5, 8), (4, 8, 7)]
"""Triangles over [0, 2]^2. Each face of the test mesh is one triangle."""

CAMERA = """def Camera "Cam" {
    token projection = "orthographic"
    float horizontalAperture = 20
    float verticalAperture = 20
    double3 xformOp:translate = (1, 1, 5)
    uniform token[] xformOpOrder = ["xformOp:translate"] }
def DomeLight "Sky" { float inputs:intensity = 1 }
"""

READER = """def Shader "P" {{ uniform token info:id = "UsdPrimvarReader_{kind}"
    string inputs:varname = "{name}"
    {kind} inputs:fallback = {fallback}
    {kind} outputs:result }}
"""


def material(inputs, extra=""):
    return surface(inputs, extra).split('def Mesh "M"', maxsplit=1)[0]


def numbers(rows):
    return ", ".join("(" + ", ".join(f"{x:.9g}" for x in row) + ")" for row in rows)


def grid(rest, name="M", points=POINTS, faces=FACES, scheme="none"):
    return f"""def Mesh "{name}" {BIND} {{
        int[] faceVertexCounts = {[len(face) for face in faces]}
        int[] faceVertexIndices = {[i for face in faces for i in face]}
        point3f[] points = [{numbers(points)}]
        uniform token subdivisionScheme = "{scheme}"
        {rest} }}
    """


def primvar(values, kind, name="displayColor", type_="color3f"):
    shown = numbers(values) if values.shape[1] > 1 else ", ".join(f"{x:.9g}" for x in values[:, 0])
    return f'{type_}[] primvars:{name} = [{shown}] (interpolation = "{kind}")\n'


def picture(tmp_path, text, aovs=("albedo", "position"), spp=1, size=(40, 40), **options):
    path = write(tmp_path, "#usda 1.0\n" + text + CAMERA)
    options = {"filter": "box", "filter_width": 1.0, **options}
    return wavecomb.render(load_stage(path).scene, size=size, spp=spp, aovs=list(aovs), **options)


def interpolated(where, values, kind):
    """Returns interpolated values at positions (n, 2) on the grid, computed with NumPy."""
    values = np.asarray(values, np.float64)
    out = np.full((len(where), values.shape[1]), np.nan)
    points = np.array(POINTS)[:, :2]
    for f, face in enumerate(FACES):
        a, b, c = points[list(face)]
        uv = np.linalg.solve(np.stack([b - a, c - a], axis=1), (where - a).T).T
        inside = (uv.min(axis=1) >= -1e-6) & (uv.sum(axis=1) <= 1 + 1e-6)
        weights = np.column_stack([1 - uv.sum(axis=1), uv])
        corners = {
            "constant": values[[0, 0, 0]] if kind == "constant" else None,
            "uniform": values[[f] * 3] if kind == "uniform" else None,
            "vertex": values[list(face)] if kind in ("vertex", "varying") else None,
            "faceVarying": values[3 * f : 3 * f + 3] if kind == "faceVarying" else None,
        }["vertex" if kind == "varying" else kind]
        out[inside] = (weights @ corners)[inside]
    return out


COUNTS = {"constant": 1, "uniform": 8, "varying": 9, "vertex": 9, "faceVarying": 24}


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("kind", COUNTS)
def test_interpolation_is_numpys(tmp_path, kind, mirrored):
    values = np.random.default_rng(7).random((COUNTS[kind], 3))
    turn = """double3 xformOp:scale = (-1, 1, 1)
        double3 xformOp:translate = (-2, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:scale", "xformOp:translate"]"""
    made = picture(tmp_path, grid(primvar(values, kind) + (turn if mirrored else "")))
    where = made.aovs["position"].reshape(-1, 3)[:, :2].astype(np.float64)
    if mirrored:
        where[:, 0] = 2 - where[:, 0]
    expected = interpolated(where, values, kind)
    assert np.isfinite(expected).all()
    seen = made.albedo.reshape(-1, 3)
    # On an edge between different faces, either value is right.
    wrong = np.abs(seen - expected).max(axis=1) > 1e-4
    assert wrong.mean() < (0.01 if kind in ("uniform", "faceVarying") else 1e-9)


def test_numbers_of_a_material_and_its_fallback(tmp_path):
    """A primvar drives roughness.

    A mesh without the primvar uses the fallback value of the primvar reader.
    """
    reader = READER.format(kind="float", name="rough", fallback="0.75")
    text = material("float inputs:roughness.connect = </Mat/P.outputs:result>", reader)
    values = np.linspace(0, 1, 9)[:, None]
    rest = "rel material:binding = </Mat>\n"
    scene, loaded = load(
        tmp_path,
        text
        + grid(rest + primvar(values, "vertex", "rough", "float"), "Own")
        + grid(rest + primvar(values[:1] + 0.125, "constant", "rough", "float"), "One")
        + grid(rest, "Without"),
    )
    own = scene.material_of("/Own")
    (graph,) = scene.graphs
    assert own["graph"] == 0 and graph.names == ("rough",) and len(graph.outputs) == 1
    rate, kept = scene.mesh("Own")["attributes"]["rough"]
    assert rate == "vertex" and kept.shape == (9, 1)
    assert scene.material_of("/One")["roughness"] == 0.125
    assert scene.material_of("/Without")["roughness"] == 0.75
    assert scene.mesh("One")["attributes"] == scene.mesh("Without")["attributes"] == {}
    assert "primvar" not in said(loaded)


def test_nodes_of_networks_read_primvars(tmp_path):
    """Constant geompropvalue nodes are folded; varying primvars and the second UV set are not."""
    nodes = """def Shader "G" { uniform token info:id = "ND_geompropvalue_float"
            string inputs:geomprop = "wear"
            float inputs:default = 0.5
            float outputs:out }
        def Shader "C" { uniform token info:id = "ND_geomcolor_color3"
            color3f outputs:out }
        def Shader "X" { uniform token info:id = "ND_multiply_color3FA"
            color3f inputs:in1.connect = </Mat/C.outputs:out>
            float inputs:in2.connect = </Mat/G.outputs:out>
            color3f outputs:out }
        def Shader "UV0" { uniform token info:id = "ND_texcoord_vector2"
            float2 outputs:out }
        def Shader "UV1" { uniform token info:id = "ND_texcoord_vector2"
            int inputs:index = 1
            float2 outputs:out }
        def Shader "N" { uniform token info:id = "ND_dotproduct_vector2"
            float2 inputs:in1.connect = </Mat/UV0.outputs:out>
            float2 inputs:in2.connect = </Mat/UV1.outputs:out>
            float outputs:out }
    """
    text = material(
        "color3f inputs:base_color.connect = </Mat/X.outputs:out>\n"
        "float inputs:specular_roughness.connect = </Mat/N.outputs:out>",
        nodes,
    ).replace('"UsdPreviewSurface"', '"ND_standard_surface_surfaceshader"')
    random = np.random.default_rng(5)
    st = primvar(random.random((9, 2)), "vertex", "st", "texCoord2f")
    st1 = primvar(random.random((9, 2)), "vertex", "st1", "texCoord2f")
    tints = primvar(random.random((9, 3)), "vertex")
    wear = primvar(np.full((1, 1), 0.25), "constant", "wear", "float")
    rest = "rel material:binding = </Mat>\n"
    scene, loaded = load(
        tmp_path,
        text
        + grid(rest + st + st1 + tints + wear, "A")
        + grid(rest + st + primvar(np.ones((1, 3)), "constant"), "B"),
    )
    whole = scene.graphs[scene.material_of("/A")["graph"]]
    assert set(whole.names) == {"displayColor", "st1"}
    assert set(scene.mesh("A")["attributes"]) == {"displayColor", "st1"}
    assert scene.mesh("A")["uvs"].shape == (9, 2) and "several sets" not in said(loaded)
    assert scene.mesh("B")["attributes"] == {}
    assert scene.material_of("/B")["base_color"] == pytest.approx((0.5, 0.5, 0.5))
    rest_of_it = scene.graphs[scene.material_of("/B")["graph"]]
    at = np.ones((1, POINT_SIZE), np.float32)
    assert rest_of_it.names == () and (rest_of_it.run(at) == 0).all()


def test_what_no_material_reads_is_not_kept(tmp_path):
    values = np.random.default_rng(1).random((9, 3))
    rest = "rel material:binding = </Mat>\n" + primvar(values, "vertex")
    scene, _ = load(tmp_path, material("") + grid(rest))
    assert scene.mesh("M")["attributes"] == {} and not scene.graphs


def test_equal_values_are_a_constant(tmp_path):
    scene, _ = load(tmp_path, grid(primvar(np.full((9, 3), 0.25), "vertex")))
    assert scene.material_of("/M")["base_color"] == (0.25, 0.25, 0.25)
    assert scene.mesh("M")["attributes"] == {} and not scene.graphs


@pytest.mark.parametrize(
    ("rest", "warning"),
    [
        (primvar(np.ones((5, 3)), "vertex"), "'displayColor' (vertex) has the wrong number"),
        (primvar(np.ones((9, 3)), "uniform"), "'displayColor' (uniform) has the wrong number"),
        (
            primvar(np.ones((9, 1)), "vertex", type_="float"),
            "primvar 'displayColor' has too few components: ignored",
        ),
        (
            primvar(np.ones((9, 3)), "vertex").replace("(1, 1, 1)", "(nan, inf, 1)", 2),
            "primvar 'displayColor' with values that are not finite: set to 0",
        ),
        (
            primvar(np.ones((9, 3)), "vertex") + "int[] primvars:displayColor:indices = [9, 0]",
            "indices of primvar 'displayColor' are out of range: ignored",
        ),
    ],
)
def test_what_does_not_fit_is_said_once(tmp_path, rest, warning):
    scene, loaded = load(tmp_path, grid(rest))
    found = [line for line in loaded.report.lines() if line.startswith("warning")]
    assert len(found) == 1 and warning in found[0] and "/M" in found[0]
    assert scene.material_of("/M")["program"] == "diffuse"


def test_opacity_by_a_primvar_cuts_out(tmp_path):
    """displayOpacity is the fraction of rays that each face intercepts."""
    opacity = np.array([1, 0, 0.5, 1, 0, 0.5, 1, 0], float)[:, None]
    text = grid(
        primvar(np.full((1, 3), 0.5), "constant")
        + primvar(opacity, "uniform", "displayOpacity", "float")
    )
    albedo = picture(tmp_path, text, ("albedo",), spp=64, size=(16, 16)).albedo.max(axis=2)
    x, y = np.meshgrid((np.arange(16) + 0.5) / 8, (15.5 - np.arange(16)) / 8)
    expected = interpolated(np.stack([x.ravel(), y.ravel()], axis=1), opacity, "uniform")
    expected = expected.reshape(16, 16)
    clear = np.abs((x - y) - np.rint(x - y)) > 0.1
    assert clear.sum() > 150
    assert albedo[clear] / albedo.max() == pytest.approx(expected[clear], abs=0.25)
    assert (albedo[clear & (expected == 0)] == 0).all()


def test_an_opacity_threshold_cuts_along_a_level_line(tmp_path):
    reader = READER.format(kind="float", name="there", fallback="1")
    text = material(
        "float inputs:opacity.connect = </Mat/P.outputs:result>\n"
        "float inputs:opacityThreshold = 0.5",
        reader,
    )
    values = np.array([[x / 2] for x, _, _ in POINTS])
    rest = "rel material:binding = </Mat>\n" + primvar(values, "vertex", "there", "float")
    made = picture(tmp_path, text + grid(rest), ("depth", "albedo"), spp=4, size=(16, 16))
    seen = made.albedo.max(axis=2) > 0
    assert seen[:, 9:].all() and not seen[:, :7].any()


def lamp(tmp_path, n, kind):
    """Returns a floor lit from the side by n x n quads with the emission 3 y."""
    reader = READER.format(kind="float3", name="glow", fallback="(0, 0, 0)")
    text = material(
        "color3f inputs:emissiveColor.connect = </Mat/P.outputs:result>\n"
        "color3f inputs:diffuseColor = (0, 0, 0)",
        reader,
    )
    steps = np.linspace(0, 2, n + 1)
    points = [(2.2, y, z) for z in steps for y in steps]
    row = n + 1
    faces = [
        (r * row + c, r * row + c + 1, (r + 1) * row + c + 1, (r + 1) * row + c)
        for r in range(n)
        for c in range(n)
    ]
    at = [np.mean([points[i][1] for i in f]) for f in faces] if kind == "uniform" else None
    heights = at or [y for _, y, _ in points]
    glow = primvar(np.array([[3 * y, y, 0.5] for y in heights]), kind, "glow")
    rest = "rel material:binding = </Mat>\n" + glow
    floor = grid("", "Floor", [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)], [(0, 1, 2, 3)])
    camera = CAMERA.split("def DomeLight", maxsplit=1)[0]
    path = write(tmp_path, "#usda 1.0\n" + text + grid(rest, "L", points, faces) + floor + camera)
    options = {"size": (12, 12), "spp": 512, "max_depth": 1, "aovs": []}
    return wavecomb.render(load_stage(path).scene, **options).beauty


def test_emission_by_a_primvar_is_aimed_at(tmp_path):
    """Emission that varies over two triangles lights the floor like many quads of one colour."""
    ramp, steps = lamp(tmp_path, 1, "vertex"), lamp(tmp_path, 12, "uniform")
    assert ramp.min() > 0.005 and ramp[0, :, 0].mean() > 1.4 * ramp[-1, :, 0].mean()
    assert ramp == pytest.approx(steps, rel=0.12)
    assert ramp.mean(axis=1) == pytest.approx(steps.mean(axis=1), rel=0.03)


def everything():
    """Returns a stage with cut-outs, all interpolations, instances, subdivision and emission."""
    random = np.random.default_rng(11)
    reader = READER.format(kind="float", name="there", fallback="1")
    cut = material("float inputs:opacity.connect = </Mat/P.outputs:result>\n"
                  'token inputs:opacityMode = "presence"', reader)  # fmt: skip
    glow = material(
        "color3f inputs:emissiveColor.connect = </Glow/P.outputs:result>",
        READER.format(kind="float3", name="glow", fallback="(0, 0, 0)"),
    ).replace("Mat", "Glow")
    quads = [(0, 1, 4, 3), (1, 2, 5, 4), (3, 4, 7, 6), (4, 5, 8, 7)]

    def moved(z, extra=""):
        return f"""double3 xformOp:translate = (0.2, 0.1, {z})
            uniform token[] xformOpOrder = ["xformOp:translate"]
            {extra}"""

    there = primvar(random.random((9, 1)), "vertex", "there", "float")
    shine = primvar(3 * random.random((24, 3)), "faceVarying", "glow")
    return (
        cut
        + glow
        + grid(moved(1.0, "rel material:binding = </Mat>\n" + there), "Cut")
        + grid(moved(3.0, "rel material:binding = </Glow>\n" + shine), "Lamp")
        + grid(
            moved(-0.5, primvar(random.random((16, 3)), "faceVarying")),
            "Smooth",
            [(x, y, (x * y) % 2) for x, y, _ in POINTS],
            quads,
            "catmullClark",
        )
        + f"""def PointInstancer "Many" {{
            rel prototypes = </Many/Proto>
            int[] protoIndices = [0, 0, 0]
            point3f[] positions = [(0, 0, -2), (1, 0.5, -3), (-0.5, 1, -2.5)]
            {grid(primvar(random.random((9, 3)), "vertex"), "Proto")} }}
        """
    )


@pytest.mark.slow
def test_same_bits_whatever_the_order(tmp_path):
    path = write(tmp_path, "#usda 1.0\n" + everything() + CAMERA)
    scene = load_stage(path).scene
    options = {"size": (24, 24), "spp": 4, "aovs": ["albedo"]}
    scalar = wavecomb.render(scene, lanes=1, policy="none", threads=1, **options)
    assert scalar.beauty.std() > 0.01
    choices = itertools.chain(
        [{"lanes": n} for n in _core.lane_widths()],
        [{"policy": name} for name in _core.policies()],
        [{"wave_size": 256, "threads": 1, "ray_order": "morton"}],
    )
    for choice in choices:
        made = wavecomb.render(scene, **options, **choice)
        assert made.beauty.tobytes() == scalar.beauty.tobytes(), choice
        assert made.albedo.tobytes() == scalar.albedo.tobytes(), choice
