# SPDX-License-Identifier: Apache-2.0
"""Tests MaterialX nodes against their formulas, both primitives and graphs of the library."""

from __future__ import annotations

import colorsys

import numpy as np
import pytest
from graph_reference import perlin
from materialx_nodes import Node, points, run
from pxr import Gf, Sdf, UsdShade

from wavecomb.usd.graphs.surface_parameters import plain_use
from wavecomb.usd.materialx.nodes import images

AT = points()
UV = AT[:, :2].astype(float)
PLACE = AT[:, 6:9].astype(float)
LUMA = np.array((0.2722287, 0.6740818, 0.0536895))


def noise(node, name):
    """Evaluates the noise that feeds an input."""
    shader = node.shader
    return run(node.networks.input(shader, name, "number"), AT).astype(float)


def fed(identifier, width=3, **names):
    """Returns a node whose named inputs are noise of the given types."""
    node = Node(identifier)
    for name, kind in names.items():
        size = ",".join(["0.9"] * {"float": 1, "color3": 3, "color4": 4, "vector3": 3}[kind])
        node.feed(name, f"ND_noise3d_{kind}", amplitude=size, pivot="0.4")
    return node


def rows(function, *arrays):
    return np.array([function(*row) for row in zip(*arrays, strict=True)])


def hsv(colours):
    """Converts to hue, saturation and value, also for colours outside of 0..1."""
    return rows(lambda c: colorsys.rgb_to_hsv(*c), colours)


def rgb(values):
    return rows(lambda c: colorsys.hsv_to_rgb(c[0] % 1.0, *c[1:]), values)


def test_checkerboard():
    got = Node("ND_checkerboard_color3").give(uvtiling="3, 5", uvoffset="0.25, 0.5").run(AT)
    cell = np.floor(UV * (3, 5) - (0.25, 0.5)).sum(axis=1)
    # As in MaterialX's node graph, the checkerboard has its first colour where the sum is odd.
    assert np.array_equal(got[:, 0], np.mod(cell, 2))


@pytest.mark.parametrize("kind", ["float", "color3", "color4"])
def test_overlay_asks_the_background(kind):
    node = fed(f"ND_overlay_{kind}", fg=kind, bg=kind, mix="float")
    f, b, mix = (noise(node, name) for name in ("fg", "bg", "mix"))
    full = np.where(b >= 0.5, 1 - 2 * (1 - f) * (1 - b), 2 * f * b)
    assert np.allclose(node.run(AT), b + mix * (full - b), atol=1e-5)


@pytest.mark.parametrize("kind", ["color3", "color4"])
def test_colorcorrect(kind):
    given = {"hue": 0.1, "saturation": 0.7, "gamma": 1.5, "lift": 0.1, "gain": 1.2,
             "contrast": 1.3, "contrastpivot": 0.4, "exposure": 0.5}  # fmt: skip
    node = fed(f"ND_colorcorrect_{kind}", **{"in": kind}).give(**given)
    x = noise(node, "in")
    inside = (x[:, :3] > 0.01).all(axis=1)
    x = x[inside]
    c = hsv(x[:, :3])
    c = rgb(c + np.array((given["hue"], 0, 0)))
    grey = (c @ LUMA)[:, None]
    c = grey + (c - grey) * given["saturation"]
    c = np.sign(c) * np.abs(c) ** (1 / given["gamma"])
    c = (c * (1 - given["lift"]) + given["lift"]) * given["gain"]
    c = (c - given["contrastpivot"]) * given["contrast"] + given["contrastpivot"]
    got = node.run(AT)[inside]
    assert inside.sum() > 50
    assert np.allclose(got[:, :3], c * 2 ** given["exposure"], atol=2e-5)
    assert np.array_equal(got[:, 3:].astype(float), x[:, 3:])


def test_colorcorrect_of_nothing_is_its_input():
    node = fed("ND_colorcorrect_color4", **{"in": "color4"})
    x = noise(node, "in")
    inside = (x[:, :3] > 0.01).all(axis=1)
    assert np.allclose(node.run(AT)[inside], x[inside], atol=1e-5)


def test_saturate_and_hsvadjust_and_contrast():
    node = fed("ND_saturate_color3", **{"in": "color3"}).give(amount="0.25")
    x = noise(node, "in")
    grey = (x @ LUMA)[:, None]
    assert np.allclose(node.run(AT), grey + (x - grey) * 0.25, atol=1e-6)
    node = fed("ND_hsvadjust_color3", **{"in": "color3"}).give(amount="0.3, 0.5, 1.5")
    inside = (x > 0.01).all(axis=1)
    expected = rgb(hsv(x) * (1, 0.5, 1.5) + (0.3, 0, 0))
    assert np.allclose(node.run(AT)[inside], expected[inside], atol=2e-5)
    node = fed("ND_contrast_color3FA", **{"in": "color3"}).give(amount="2", pivot="0.3")
    assert np.allclose(node.run(AT), (x - 0.3) * 2 + 0.3, atol=1e-6)


def test_range_clamps_only_when_told():
    for told in ("true", "false"):
        node = fed("ND_range_float", **{"in": "float"})
        node.give(inlow="0.2", inhigh="0.7", gamma="2", outlow="1", outhigh="3", doclamp=told)
        x = (noise(node, "in") - 0.2) / 0.5
        expected = 1 + 2 * np.sign(x) * np.sqrt(np.abs(x))
        expected = np.clip(expected, 1, 3) if told == "true" else expected
        assert np.allclose(node.run(AT), expected, atol=1e-5)


def test_fractal2d_is_a_sum_of_flat_noise():
    """The node fractal2d uses two-dimensional noise, not a slice of three-dimensional noise."""
    node = Node("ND_fractal2d_vector3")
    node.give(octaves=4, lacunarity="2.5", diminish="0.4", amplitude="1, 2, 3")
    total = sum(
        0.4**i * np.stack(perlin(list(UV.T * 2.5**i), 3), axis=1) for i in range(4)
    )  # fmt: skip
    assert np.allclose(node.run(AT), total * (1, 2, 3), atol=1e-4)


def test_blackbody():
    """A black body is white at 6500 K, redder below, and like CIE illuminant A at 2856 K."""

    def chromaticity(kelvin):
        value = Node("ND_blackbody").give(temperature=kelvin).run(AT[:1])[0].astype(float)
        to_xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
        xyz = np.array(to_xyz) @ value
        assert xyz[1] == pytest.approx(1.0, abs=2e-3)
        return xyz[:2] / xyz.sum()

    assert chromaticity(2856) == pytest.approx((0.4476, 0.4074), abs=1e-3)
    assert chromaticity(6500) == pytest.approx((0.3135, 0.3237), abs=1e-3)
    assert chromaticity(1900) == pytest.approx((0.5368, 0.4112), abs=2e-3)
    hot = Node("ND_blackbody").give(temperature=40000).run(AT[:1])
    assert np.array_equal(hot, Node("ND_blackbody").give(temperature=25000).run(AT[:1]))


def test_blackbody_is_a_colour_of_the_working_space():
    node = Node("ND_blackbody").give(temperature="3000")
    node.textures.working = "acescg"
    there = node.networks.in_working_space().node(node.shader, "out", "colour")
    from wavecomb.image.working_space import from_rec709

    rec709 = node.run(AT[:1])
    assert np.allclose(run(there, AT[:1]), from_rec709(rec709, "acescg"), atol=1e-5)
    assert not np.allclose(run(there, AT[:1]), rec709, atol=1e-2)


def test_conversion_of_colour_spaces_keeps_white():
    """The library's graph multiplies row vectors by its matrix."""
    node = Node("ND_acescg_to_lin_rec709_color3").give(**{"in": "1, 1, 1"})
    assert np.allclose(node.run(AT[:1]), 1.0, atol=1e-3)
    red = Node("ND_acescg_to_lin_rec709_color3").give(**{"in": "1, 0, 0"}).run(AT[:1])[0]
    assert red == pytest.approx((1.705, -0.130, -0.024), abs=2e-3)
    curve = Node("ND_srgb_texture_to_lin_rec709_color3").give(**{"in": "0.5, 0.02, 1"})
    expected = (((0.5 + 0.055) / 1.055) ** 2.4, 0.02 / 12.92, 1)
    assert curve.run(AT[:1])[0] == pytest.approx(expected, abs=1e-5)


def test_matrices():
    node = fed("ND_transformmatrix_vector3M4", **{"in": "vector3"})
    node.give(mat="1,2,3,0, 4,5,6,0, 7,8,10,0, 0.5,0.25,2,1")
    matrix = np.array([[1, 2, 3], [4, 5, 6], [7, 8, 10]])
    expected = noise(node, "in") @ matrix + (0.5, 0.25, 2)
    assert np.allclose(node.run(AT), expected, atol=1e-4)
    turned = Node("ND_transpose_matrix33").give(**{"in": "1,2,3, 4,5,6, 7,8,9"}).value()
    assert turned == (1, 4, 7, 2, 5, 8, 3, 6, 9)
    made = Node("ND_creatematrix_vector3_matrix44").give(in4="7, 8, 9").value()
    assert made == (1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 7, 8, 9, 1)


@pytest.mark.parametrize(
    ("category", "formula"),
    [
        ("in", lambda f, b, a, g: f * g),
        ("out", lambda f, b, a, g: f * (1 - g)),
        ("mask", lambda f, b, a, g: b * a),
        ("over", lambda f, b, a, g: f + b * (1 - a)),
    ],
)
def test_porter_and_duff(category, formula):
    node = fed(f"ND_{category}_color4", fg="color4", bg="color4").give(mix="0.75")
    f, b = noise(node, "fg"), noise(node, "bg")
    full = formula(f, b, f[:, 3:], b[:, 3:])
    assert np.allclose(node.run(AT), b + 0.75 * (full - b), atol=1e-5)


def test_matte_and_disjointover():
    node = fed("ND_matte_color4", fg="color4", bg="color4")
    f, b = noise(node, "fg"), noise(node, "bg")
    a, g = f[:, 3:], b[:, 3:]
    expected = np.hstack([f[:, :3] * a + b[:, :3] * (1 - a), a + g * (1 - a)])
    assert np.allclose(node.run(AT), expected, atol=1e-5)
    node = fed("ND_disjointover_color4", fg="color4", bg="color4")
    under = np.where(a + g <= 1, b[:, :3], b[:, :3] * (1 - a) / g)
    expected = np.hstack([f[:, :3] + under, np.minimum(a + g, 1)])
    assert np.allclose(node.run(AT), expected, atol=1e-4) and (a + g > 1).any()


def test_ramp_between_colours():
    """Ramps of several kinds and interpolations, with authored intervals."""
    given = {
        "type": 0, "num_intervals": 3, "interval1": "0", "interval2": "0.25", "interval3": "1",
        "color1": "1, 0, 0, 1", "color2": "0, 1, 0, 0.5", "color3": "0, 0, 1, 1",
    }  # fmt: skip
    u = UV[:, 0]
    steps, colours = (0, 0.25, 1), np.array([(1, 0, 0, 1), (0, 1, 0, 0.5), (0, 0, 1, 1)], float)
    between = [np.interp(u, steps, colours[:, i]) for i in range(4)]
    linear = Node("ND_ramp").give(interpolation=0, **given).run(AT)
    assert np.allclose(linear, np.stack(between, axis=1), atol=1e-5)
    stepped = Node("ND_ramp").give(interpolation=2, **given).run(AT)
    assert np.array_equal(stepped, np.where((u < 0.25)[:, None], colours[0], colours[1]))


def test_shapes():
    circle = Node("ND_circle_float").give(center="0.5, 0.5", radius="0.3").run(AT)[:, 0]
    away = np.hypot(*(UV - 0.5).T)
    assert np.array_equal(circle, (away < 0.3).astype(float))
    wave = fed("ND_trianglewave_float", **{"in": "float"})
    x = noise(wave, "in")
    assert np.allclose(wave.run(AT), np.abs(x - np.round(x)), atol=1e-5)


def test_reflect():
    node = fed("ND_reflect_vector3", **{"in": "vector3", "normal": "vector3"})
    i, n = noise(node, "in"), noise(node, "normal")
    expected = i - 2 * (i * n).sum(axis=1, keepdims=True) * n
    assert np.allclose(node.run(AT), expected, atol=1e-4)


def test_facingratio_is_as_written_out():
    node = Node("ND_facingratio_float").give(faceforward="false", invert="true")
    cosine = (AT[:, 9:12] * AT[:, 18:21]).sum(axis=1)
    assert np.allclose(node.run(AT)[:, 0], 1 - cosine, atol=1e-6)


def test_logic():
    for a in ("true", "false"):
        for b in ("true", "false"):
            x, y = a == "true", b == "true"
            for name, expected in (("and", x and y), ("or", x or y), ("xor", x != y)):
                got = Node(f"ND_logical_{name}").give(in1=a, in2=b).value()
                assert got == (float(expected),), (name, a, b)


def test_images_of_gltf_are_placed_as_its_graph_says():
    """The scale of the glTF node is the inverse of the scale of place2d."""
    node = Node("ND_gltf_image_color3_color3_1_0").give(file="a.png", scale="2, 4", factor="1,1,1")
    node.give(offset="0.25, 0.5", rotate="90")
    use = plain_use(node.value(kind="base"), wide=True)
    assert use["channel"] == "rgb" and use["scale"] == (1, 1, 1, 1)
    a, b, c, d, e, f = use["uv"]
    for u, v in ((0.0, 0.0), (0.3, 0.8)):
        x, y = 2 * u, 4 * (v - 1)
        expected = (-y + 0.25, x - 0.5 + 1)
        assert (a * u + b * v + c, d * u + e * v + f) == pytest.approx(expected, abs=1e-5)


def test_tiled_images_stay_plain_textures():
    node = Node("ND_tiledimage_color3").give(file="a.png", uvtiling="3, 2", uvoffset="0.5, 0.25")
    use = plain_use(node.value(kind="base"), wide=True)
    assert use["uv"] == pytest.approx((3, 0, -0.5, 0, 2, -0.25))
    assert node.textures.uses == [("a.png", "auto", "repeat", "repeat", True)]
    data = Node("ND_tiledimage_float").give(file="a.png")
    data.value(kind="number")
    assert data.textures.uses == [("a.png", "raw", "repeat", "repeat", False)]


def test_normal_maps_of_gltf_read_their_file():
    node = Node("ND_gltf_normalmap_vector3_1_0").give(file="n.png")
    use = plain_use(node.value(kind="normal"), wide=True)
    assert use["scale"][:3] == (2, 2, 2) and use["bias"][:3] == (-1, -1, -1)
    assert node.textures.uses == [("n.png", "raw", "repeat", "repeat", False)]


def test_triplanar_projection_mixes_three_images(monkeypatch):
    """Images are blended by the object-space normal, and each image is projected along its axis."""
    read = []

    def numbered(n, uv, *_):
        read.append((n.inputs.source("file").value, run(uv, AT)))
        return (*(float(len(read) == i + 1) for i in range(3)), 1.0)

    monkeypatch.setattr(images, "read_image", numbered)
    node = Node("ND_triplanarprojection_color3")
    node.give(filex="x.png", filey="y.png", filez="z.png", upaxis=2, blend="1.0")
    got = node.run(AT, kind="base")
    assert sorted(str(file.path) for file, _ in read) == ["x.png", "y.png", "z.png"]
    normal = np.abs(AT[:, 12:15].astype(float))
    order = ["xyz".index(str(file.path)[0]) for file, _ in read]
    assert np.allclose(got.sum(axis=1), 1, atol=1e-5)
    # Where the normal is near an axis, the image along that axis has the largest weight.
    strongest = np.array(order)[got.argmax(axis=1)]
    clear = np.sort(normal, axis=1)[:, 2] > 0.8
    assert clear.sum() > 20 and np.array_equal(strongest[clear], normal.argmax(axis=1)[clear])
    for file, uv in read:
        axes = {"x": (2, 1), "y": (0, 2), "z": (0, 1)}[str(file.path)[0]]
        assert np.allclose(np.sort(np.abs(uv)), np.sort(np.abs(PLACE[:, axes])), atol=1e-6)


def test_coordinates_by_an_image_are_no_colours():
    """An image used as texture coordinates is read once, without colour conversion."""
    node = Node("ND_tiledimage_color3").give(file="a.png")
    node.feed("texcoord", "ND_image_color3", file="b.png")  # whatever its type
    node.value(kind="base")
    assert sorted(node.textures.uses) == [
        ("a.png", "auto", "repeat", "repeat", True),
        ("b.png", "raw", "repeat", "repeat", False),
    ]


def test_long_networks_of_graphs_are_no_deep_calls():
    """A chain of 90 contrast nodes, each of which is a graph, compiles completely."""
    node = Node("ND_contrast_float").give(amount="1.01", pivot="0")
    shader = node.shader
    for i in range(90):
        source = UsdShade.Shader.Define(node.stage, f"/M/C{i}")
        source.CreateIdAttr("ND_contrast_float")
        source.CreateOutput("out", Sdf.ValueTypeNames.Float)
        source.CreateInput("amount", Sdf.ValueTypeNames.Float).Set(1.01)
        source.CreateInput("pivot", Sdf.ValueTypeNames.Float).Set(0.0)
        shader.CreateInput("in", Sdf.ValueTypeNames.Float).ConnectToSource(
            source.ConnectableAPI(), "out"
        )
        shader = source
    shader.CreateInput("in", Sdf.ValueTypeNames.Float).Set(1.0)
    assert node.value()[0] == pytest.approx(1.01**91, rel=1e-4)
    assert not node.report.lines()


@pytest.mark.parametrize("is_driven", [False, True])
@pytest.mark.parametrize(
    ("identifier", "name"),
    [
        ("ND_add_color3", "in1"), ("ND_noise2d_color3", "texcoord"), ("ND_contrast_color3", "in"),
        ("ND_dotproduct_vector3", "in1"), ("ND_rgbtohsv_color3", "in"), ("ND_overlay_color4", "bg"),
        ("ND_ifgreater_color3", "value1"), ("ND_transformmatrix_vector3", "in"),
        ("ND_creatematrix_vector3_matrix33", "in1"),
    ],
)  # fmt: skip
def test_a_matrix_in_the_place_of_numbers_is_cut(identifier, name, is_driven):
    """Files may connect inputs of any types."""
    node = Node(identifier)
    port = node.shader.CreateInput(name, Sdf.ValueTypeNames.Matrix4d)
    if is_driven:
        for prim, kind, output in (
            ("C", "ND_creatematrix_vector4_matrix44", Sdf.ValueTypeNames.Matrix4d),
            ("K", "ND_noise3d_vector4", Sdf.ValueTypeNames.Float4),
        ):
            source = UsdShade.Shader.Define(node.stage, f"/M/{prim}")
            source.CreateIdAttr(kind)
            source.CreateOutput("out", output)
            port.ConnectToSource(source.ConnectableAPI(), "out")
            port = source.CreateInput("in1", Sdf.ValueTypeNames.Float4)
    else:
        port.Set(Gf.Matrix4d(2.0))
    assert np.isfinite(node.run(AT)).all()
