# SPDX-License-Identifier: Apache-2.0
"""Tests MaterialX networks of a stage: constants, textures and value graphs."""

from __future__ import annotations

import numpy as np
import pytest
from graph_reference import perlin
from test_usd_material import surface, write_image
from usd_recorder import load, said, write

import wavecomb
from wavecomb.usd import load_stage
from wavecomb.usd.graphs.values import PARAMETERS, POINT_SIZE

UV = 'def Shader "UV" { uniform token info:id = "ND_texcoord_vector2"\nfloat2 outputs:out }\n'


def node(name, identifier, inputs, output="color3f outputs:out"):
    return f"""def Shader "{name}" {{ uniform token info:id = "{identifier}"
        {inputs}
        {output} }}
    """


def standard(inputs, nodes="", model="ND_standard_surface_surfaceshader"):
    text = surface(inputs, nodes).replace('"UsdPreviewSurface"', f'"{model}"')
    return text


def driven(scene, mesh="M"):
    """Returns a function that evaluates the graph of a mesh: points to values by parameter."""
    graph = scene.graphs[scene.material_of(mesh)["graph"]]

    def at(points):
        table = graph.run(points)
        columns = {number: table[:, i] for i, (number, _) in enumerate(graph.outputs)}
        return {
            name: np.stack([columns[first + i] for i in range(width)], axis=1)
            for name, (first, width) in PARAMETERS.items()
            if first in columns
        }

    return at


def grid(n=9):
    points = np.zeros((n * n, POINT_SIZE), np.float32)
    steps = (np.arange(n) + 0.37) / n
    points[:, 0], points[:, 1] = (axis.ravel() for axis in np.meshgrid(steps, steps))
    points[:, 3:6] = points[:, 6:9] = np.random.default_rng(3).uniform(-2, 2, (n * n, 3))
    return points


def test_constant_networks_are_constants(tmp_path):
    scene, loaded = load(
        tmp_path,
        standard(
            """color3f inputs:base_color.connect = </Mat/Mix.outputs:out>
            float inputs:base = 1
            float inputs:specular_roughness.connect = </Mat/P.outputs:out>""",
            node(
                "Mix",
                "ND_mix_color3",
                "color3f inputs:fg = (1, 0, 0)\ncolor3f inputs:bg = (0, 1, 0)\n"
                "float inputs:mix = 0.25",
            )
            + node(
                "P",
                "ND_power_float",
                "float inputs:in1 = 0.5\nfloat inputs:in2 = 2",
                "float outputs:out",
            ),
        ),
    )
    got = scene.material_of("M")
    assert got["base_color"] == (0.25, 0.75, 0.0)
    assert got["roughness"] == pytest.approx(0.25)
    assert "graph" not in got and not got["textures"] and "MaterialX" not in said(loaded)


def test_scaled_images_are_plain_textures(tmp_path):
    """image * tint + bias through place2d becomes one texture use without a graph."""
    write_image(tmp_path / "a.png", np.full((4, 4, 3), 99, np.uint8), "uint8")
    nodes = UV + node(
        "Place",
        "ND_place2d_vector2",
        "float2 inputs:texcoord.connect = </Mat/UV.outputs:out>\n"
        "float2 inputs:scale = (0.5, 0.25)\n"
        "float2 inputs:pivot = (0.5, 0.5)\nfloat inputs:rotate = 90\n"
        "float2 inputs:offset = (0.1, 0.2)",
        "float2 outputs:out",
    )
    nodes += node(
        "I",
        "ND_image_color3",
        "asset inputs:file = @a.png@\nfloat2 inputs:texcoord.connect = </Mat/Place.outputs:out>\n"
        'string inputs:uaddressmode = "mirror"',
    )
    nodes += node(
        "Mul",
        "ND_multiply_color3",
        "color3f inputs:in1.connect = </Mat/I.outputs:out>\ncolor3f inputs:in2 = (0.5, 1, 0.25)",
    )
    nodes += node(
        "Add",
        "ND_add_color3FA",
        "color3f inputs:in1.connect = </Mat/Mul.outputs:out>\nfloat inputs:in2 = 0.125",
    )
    scene, loaded = load(
        tmp_path,
        standard(
            "color3f inputs:base_color.connect = </Mat/Add.outputs:out>\nfloat inputs:base = 0.5",
            nodes,
        ),
    )
    got = scene.material_of("M")
    assert "graph" not in got and "MaterialX" not in said(loaded)
    use = got["textures"]["base_color"]
    assert use["channel"] == "rgb" and use["scale"] == (0.25, 0.5, 0.125, 1.0)
    assert use["bias"] == (0.0625, 0.0625, 0.0625, 0.0)
    assert scene.textures[use["texture"]]["wrap"][0] == "mirror"
    a, b, c, d, e, f = use["uv"]
    for u, v in ((0.0, 0.0), (0.3, 0.8)):
        x, y = (u - 0.5) / 0.5, (v - 0.5) / 0.25
        expected = (y - 0.1 + 0.5, -x - 0.2 + 0.5)
        assert (a * u + b * v + c, d * u + e * v + f) == pytest.approx(expected, abs=1e-5)


def test_normal_map_of_any_version(tmp_path):
    write_image(tmp_path / "n.png", np.full((4, 4, 3), 128, np.uint8), "uint8")
    for identifier in ("ND_normalmap", "ND_normalmap_float"):
        nodes = node(
            "I", "ND_image_vector3", "asset inputs:file = @n.png@", "vector3f outputs:out"
        ).replace("vector3f outputs", "float3 outputs")
        nodes += node(
            "N",
            identifier,
            "float3 inputs:in.connect = </Mat/I.outputs:out>\nfloat inputs:scale = 0.5",
            "float3 outputs:out",
        )
        scene, loaded = load(
            tmp_path, standard("float3 inputs:normal.connect = </Mat/N.outputs:out>", nodes)
        )
        use = scene.material_of("M")["textures"]["normal"]
        assert use["scale"] == (1, 1, 2, 1) and use["bias"] == (-0.5, -0.5, -1, 0)
        assert not scene.textures[use["texture"]]["srgb"]
        assert "MaterialX" not in said(loaded)


def test_noise_drives_many_parameters_by_one_program(tmp_path):
    nodes = node(
        "Noise",
        "ND_noise3d_float",
        "float inputs:amplitude = 0.5\nfloat inputs:pivot = 0.5",
        "float outputs:out",
    )
    nodes += node(
        "Mix",
        "ND_mix_color3",
        "color3f inputs:bg = (0, 0.2, 0.4)\ncolor3f inputs:fg = (1, 0.8, 0.6)\n"
        "float inputs:mix.connect = </Mat/Noise.outputs:out>",
    )
    inputs = ["color3f inputs:base_color.connect = </Mat/Mix.outputs:out>"]
    inputs += ["float inputs:base = 0.5"]
    numbers = {
        "specular_IOR": "ior", "coat": "clearcoat", "coat_IOR": "coat_ior", "sheen": "fuzz_weight",
        "sheen_roughness": "fuzz_roughness", "transmission": "transmission_weight",
        "thin_film_thickness": "film_thickness", "specular_anisotropy": "anisotropy",
        "specular_rotation": "rotation", "diffuse_roughness": "diffuse_roughness",
        "subsurface": "subsurface_weight",
    }  # fmt: skip
    inputs += [f"float inputs:{name}.connect = </Mat/Noise.outputs:out>" for name in numbers]
    colours = {"sheen_color": "fuzz_color", "coat_color": "coat_color", "opacity": "opacity",
               "transmission_color": "transmission_tint", "emission_color": "emission"}  # fmt: skip
    inputs += [f"color3f inputs:{name}.connect = </Mat/Mix.outputs:out>" for name in colours]
    inputs += ["float inputs:emission = 3"]
    scene, loaded = load(tmp_path, standard("\n".join(inputs), nodes))
    assert "by a node" not in said(loaded)
    at = grid()
    got = driven(scene)(at)
    noise = 0.5 * perlin(list(at[:, 6:9].astype(float).T), 1)[0] + 0.5
    low, high = np.array([0, 0.2, 0.4]), np.array([1, 0.8, 0.6])
    mix = low + (high - low) * noise[:, None]
    for parameter in numbers.values():
        expected = noise - np.floor(noise) if parameter == "rotation" else noise
        assert np.allclose(got[parameter][:, 0], expected, atol=1e-5), parameter
    assert np.allclose(got["base_color"], 0.5 * mix, atol=1e-5)
    assert np.allclose(got["emission"], 3 * mix, atol=1e-5)
    assert np.allclose(got["opacity"][:, 0], mix[:, 0], atol=1e-5)
    for parameter in ("fuzz_color", "coat_color", "transmission_tint"):
        assert np.allclose(got[parameter], mix, atol=1e-5)
    # The material has three graphs: for all parameters, for opacity only, and for emission only.
    assert len(scene.graphs) == 3
    assert [len(g.outputs) for g in scene.graphs[1:]] == [1, 3]


def test_absorption_in_glass_is_driven(tmp_path):
    nodes = UV + node(
        "R",
        "ND_ramplr_color3",
        "color3f inputs:valuel = (0.5, 0.5, 0.5)\ncolor3f inputs:valuer = (1, 1, 1)",
    )
    scene, _ = load(
        tmp_path,
        standard(
            "float inputs:transmission = 1\nfloat inputs:transmission_depth = 2\n"
            "color3f inputs:transmission_color.connect = </Mat/R.outputs:out>",
            nodes,
        ),
    )
    at = grid()
    expected = -np.log(0.5 + 0.5 * at[:, 0]) / 2
    assert np.allclose(driven(scene)(at)["extinction"][:, 0], expected, atol=1e-5)


def test_networks_feed_preview_surfaces(tmp_path):
    nodes = UV + node("Ramp", "ND_ramplr_float", "float inputs:valuel = 1\nfloat inputs:valuer = 2",
                      "float outputs:out")  # fmt: skip
    scene, loaded = load(
        tmp_path,
        standard(
            "float inputs:ior.connect = </Mat/Ramp.outputs:out>\n"
            "float inputs:roughness.connect = </Mat/Ramp.outputs:out>",
            nodes,
            "ND_UsdPreviewSurface_surfaceshader",
        ),
    )
    assert scene.material_of("M")["program"] == "principled" and not said(loaded).count("ND_")
    at = grid()
    got = driven(scene)(at)
    assert np.allclose(got["ior"][:, 0], 1 + at[:, 0]) and np.allclose(got["roughness"], got["ior"])


def number_node(identifier, inputs):
    return UV + node("X", identifier, inputs, "float outputs:out")


U = "float inputs:{}.connect = </Mat/E.outputs:out>"
E = node("E", "ND_separate2_vector2", "float2 inputs:in.connect = </Mat/UV.outputs:out>",
         "float outputs:outx\nfloat outputs:out")  # fmt: skip


@pytest.mark.parametrize(
    ("identifier", "inputs", "formula"),
    [
        ("ND_remap_float", U.format("in") + "\nfloat inputs:outlow = 2\nfloat inputs:outhigh = 4",
         lambda u: 2 + 2 * u),
        ("ND_clamp_float", U.format("in") + "\nfloat inputs:low = 0.3\nfloat inputs:high = 0.6",
         lambda u: np.clip(u, 0.3, 0.6)),
        ("ND_smoothstep_float", U.format("in"), lambda u: u * u * (3 - 2 * u)),
        ("ND_range_float", U.format("in") + "\nfloat inputs:gamma = 2", np.sqrt),
        ("ND_invert_float", U.format("in"), lambda u: 1 - u),
        ("ND_contrast_float", U.format("in") + "\nfloat inputs:amount = 3",
         lambda u: 3 * (u - 0.5) + 0.5),
        ("ND_ifgreater_float", U.format("value1") + "\nfloat inputs:value2 = 0.5\n"
         "float inputs:in1 = 2\nfloat inputs:in2 = 3", lambda u: np.where(u > 0.5, 2, 3)),
        ("ND_switch_float", U.format("which") + "\nfloat inputs:in1 = 5\nfloat inputs:in2 = 6",
         lambda u: np.where(u < 1, 5, 6)),
        ("ND_modulo_float", U.format("in1") + "\nfloat inputs:in2 = 0.3", lambda u: np.mod(u, 0.3)),
        ("ND_safepower_float", U.format("in1") + "\nfloat inputs:in2 = 3", lambda u: u**3),
        ("ND_tan_float", U.format("in"), np.tan),
        ("ND_asin_float", U.format("in"), np.arcsin),
        ("ND_ceil_float", U.format("in"), np.ceil),
        ("ND_fract_float", U.format("in"), lambda u: u - np.floor(u)),
        ("ND_screen_float", U.format("fg") + "\nfloat inputs:bg = 0.5", lambda u: 0.5 + u * 0.5),
        ("ND_splitlr_float", "float inputs:valuel = 1\nfloat inputs:valuer = 2",
         lambda u: np.where(u < 0.5, 1, 2)),
    ],
)  # fmt: skip
def test_nodes_of_numbers(tmp_path, identifier, inputs, formula):
    extra = E + number_node(identifier, inputs)
    scene, loaded = load(
        tmp_path, standard("float inputs:coat_IOR.connect = </Mat/X.outputs:out>", extra)
    )
    assert "MaterialX" not in said(loaded)
    at = grid()
    got = driven(scene)(at)["coat_ior"][:, 0]
    assert np.allclose(got, formula(at[:, 0].astype(float)), atol=2e-5)


def test_unknown_nodes_are_named_and_pass_an_input_on(tmp_path):
    nodes = node(
        "Odd",
        "ND_flake3d_color3",
        'string inputs:note = "x"\ncolor3f inputs:in = (0.25, 0.5, 1)',
    )
    scene, loaded = load(
        tmp_path,
        standard(
            "color3f inputs:base_color.connect = </Mat/Odd.outputs:out>\nfloat inputs:base = 1\n"
            "color3f inputs:specular_color.connect = </Mat/Nothing.outputs:out>",
            nodes,
        ),
    )
    assert scene.material_of("M")["base_color"] == (0.25, 0.5, 1)
    told = said(loaded)
    assert "ND_flake3d_color3 (its input in in its place)" in told and "/Mat/Odd" in told


def test_networks_in_circles_end(tmp_path):
    nodes = node("A", "ND_add_color3", "color3f inputs:in1.connect = </Mat/B.outputs:out>\n"
                 "color3f inputs:in2 = (0.25, 0.25, 0.25)")  # fmt: skip
    nodes += node("B", "ND_multiply_color3", "color3f inputs:in1.connect = </Mat/A.outputs:out>")
    scene, loaded = load(
        tmp_path, standard("color3f inputs:base_color.connect = </Mat/A.outputs:out>", nodes)
    )
    assert "cyclic" in said(loaded)
    assert scene.material_of("M")["base_color"] is not None


@pytest.mark.parametrize("category", ["power", "screen", "contrast", "safepower", "overlay"])
def test_networks_too_deep_are_cut(tmp_path, category):
    """Networks that are too deep are cut at a node with a warning. All other inputs keep their
    values.
    """
    first = {"power": "in1", "safepower": "in1", "contrast": "in"}.get(category, "fg")
    nodes = "".join(
        node(
            f"N{i}", f"ND_{category}_float",
            f"float inputs:{first}.connect = </Mat/N{i + 1}.outputs:out>", "float outputs:out",
        )
        for i in range(300)
    )  # fmt: skip
    text = (
        "float inputs:specular_roughness.connect = </Mat/N0.outputs:out>\nfloat inputs:base = 1\n"
    )
    text += "color3f inputs:base_color = (0.25, 0.5, 1)"
    scene, loaded = load(tmp_path, standard(text, nodes))
    assert "too deep (cut there): /Mat/N101" in said(loaded)
    assert scene.material_of("M")["base_color"] == (0.25, 0.5, 1)


def test_networks_too_large_are_said_and_leave_parameters_out(tmp_path):
    nodes = UV
    names = []
    for i in range(70):
        nodes += node(
            f"N{i}",
            "ND_noise2d_color3",
            f"float inputs:pivot = {i}.5",
        )
        names.append(f"N{i}")
    for i in range(1, 70):
        first = names[0] if i == 1 else f"S{i - 1}"
        # The max nodes come last, so that the results of all noise nodes are live at the same time.
        nodes += node(
            f"S{i}",
            "ND_max_color3",
            f"color3f inputs:in1.connect = </Mat/N{i}.outputs:out>\n"
            f"color3f inputs:in2.connect = </Mat/{first}.outputs:out>",
        )
    scene, loaded = load(
        tmp_path, standard("color3f inputs:base_color.connect = </Mat/S69.outputs:out>", nodes)
    )
    told = said(loaded)
    assert "too large for base_color" in told and "/Mat" in told
    assert not scene.graphs and "base_color" not in scene.material_of("M")


def test_graph_of_a_real_scene_renders_as_its_formula(tmp_path):
    """Emission that a ramp over texture coordinates drives is rendered as that ramp."""
    nodes = UV + node(
        "Ramp",
        "ND_ramp4_color3",
        "color3f inputs:valuetl = (0, 1, 0)\ncolor3f inputs:valuetr = (1, 1, 0)\n"
        "color3f inputs:valuebl = (0, 0, 0)\ncolor3f inputs:valuebr = (1, 0, 0)",
    )
    text = standard(
        "color3f inputs:emission_color.connect = </Mat/Ramp.outputs:out>\n"
        "float inputs:emission = 1\nfloat inputs:base = 0\nfloat inputs:specular = 0",
        nodes,
    )
    path = write(
        tmp_path,
        f"""#usda 1.0
        (upAxis = "Y")
        {text}
        def Camera "Cam" {{
            token projection = "orthographic"
            float horizontalAperture = 5
            float verticalAperture = 5
            double3 xformOp:translate = (0.5, 0.5, 5)
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }}""",
    )
    scene = load_stage(path).scene
    image = wavecomb.render(scene, size=(16, 16), spp=64, seed=1, max_depth=0).beauty
    steps = 0.25 + 0.5 * (np.arange(16) + 0.5) / 16
    assert np.allclose(image[..., 0], steps[None, :], atol=0.02)
    assert np.allclose(image[..., 1], steps[::-1][:, None], atol=0.02)


MOVED = """matrix4d xformOp:transform = ((0, 2, 0, 0), (-2, 0, 0, 0), (0, 0, 2, 0), (1, 2, 3, 1))
        uniform token[] xformOpOrder = ["xformOp:transform"]
        rel material:binding"""


def test_object_space_is_that_of_each_mesh(tmp_path):
    """Points of a mesh outside of instances are in world space. The graph of the material
    transforms the coordinates back."""
    nodes = node("P", "ND_position_vector3", "", "float3 outputs:out")
    nodes += node("N", "ND_normal_vector3", "", "float3 outputs:out")
    text = standard(
        "color3f inputs:base_color.connect = </Mat/P.outputs:out>\nfloat inputs:base = 1\n"
        "color3f inputs:specular_color.connect = </Mat/N.outputs:out>",
        nodes,
    )
    scene, _ = load(tmp_path, text.replace("rel material:binding", MOVED))
    at = grid()
    got = driven(scene)(at)
    matrix = np.array([[0, 2, 0, 0], [-2, 0, 0, 0], [0, 0, 2, 0], [1, 2, 3, 1]], float)
    world = np.concatenate([at[:, 6:9], np.ones((len(at), 1))], axis=1)
    assert np.allclose(got["base_color"], (world @ np.linalg.inv(matrix))[:, :3], atol=1e-5)
    normals = at[:, 9:12] = np.random.default_rng(1).normal(size=(len(at), 3))
    at[:, 12:15] = normals
    expected = normals @ matrix[:3, :3].T
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    assert np.allclose(driven(scene)(at)["specular_color"], expected, atol=1e-5)
    # Without a transform, meshes share the program of the material.
    still, _ = load(tmp_path, text)
    assert len(still.graphs) == 1


def test_primvars_of_a_mesh_take_their_places(tmp_path):
    nodes = node("C", "ND_geomcolor_color3", "")
    nodes += node("Half", "ND_multiply_color3FA", "float inputs:in2 = 0.5\n"
                  "color3f inputs:in1.connect = </Mat/C.outputs:out>")  # fmt: skip
    nodes += UV + node("R", "ND_geompropvalue_float", 'string inputs:geomprop = "wear"\n'
                       "float inputs:default = 0.75", "float outputs:out")  # fmt: skip
    nodes += node("Ramp", "ND_ramplr_float", "float inputs:valuel.connect = </Mat/R.outputs:out>\n"
                  "float inputs:valuer = 1", "float outputs:out")  # fmt: skip
    text = standard(
        "color3f inputs:base_color.connect = </Mat/Half.outputs:out>\nfloat inputs:base = 1\n"
        "float inputs:coat_IOR.connect = </Mat/Ramp.outputs:out>\n"
        "float inputs:specular_roughness.connect = </Mat/R.outputs:out>",
        nodes,
    )
    bare, _ = load(tmp_path, text)
    got = bare.material_of("M")
    assert got["roughness"] == 0.75 and got["base_color"] == (0, 0, 0)
    with_values = text.replace(
        "rel material:binding",
        "color3f[] primvars:displayColor = [(0.5, 1, 0.25)]\n"
        "float primvars:wear = 0.5\nrel material:binding",
    )
    scene, loaded = load(tmp_path, with_values)
    got = scene.material_of("M")
    assert got["base_color"] == (0.25, 0.5, 0.125) and got["roughness"] == 0.5
    at = grid()
    assert np.allclose(driven(scene)(at)["coat_ior"][:, 0], 0.5 + 0.5 * at[:, 0], atol=1e-6)
    assert "MaterialX" not in said(loaded)
