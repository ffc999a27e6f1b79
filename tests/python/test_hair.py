# SPDX-License-Identifier: Apache-2.0
"""Tests hair: parameters from MaterialX nodes, equal images for all schedules, closed forms."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdShade
from usd_recorder import QUAD, Recorder, said

import wavecomb
from wavecomb import _core
from wavecomb.scenes import write_scene
from wavecomb.scenes.authoring.materials import Network
from wavecomb.usd import load_stage
from wavecomb.usd.materialx.nodes.colours import color_divisor
from wavecomb.usd.materialx.surfaces.hair import scale, variance

STRAND = """
def BasisCurves "C" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {
    rel material:binding = </Hair>
    uniform token type = "linear"
    int[] curveVertexCounts = [2, 2]
    point3f[] points = [(0,0,0), (0,1,0), (1,0,0), (1,1,0)]
    float[] widths = [0.1] ( interpolation = "constant" )
    MORE
}
"""


def read(folder: Path, more: str = "", mesh: bool = False, **inputs: Any) -> tuple[Any, str]:
    """Returns the material of a strand, and the messages of loading.

    ``inputs`` are the inputs of the hair node. "roughness" and "absorption" choose the nodes that
    feed it, and "of" sets the inputs of the absorption node.
    """
    text = STRAND.replace("MORE", more)
    if mesh:
        text = f"""def Mesh "C" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {{
            rel material:binding = </Hair> {QUAD} }}"""
    path = folder / "stage.usda"
    path.write_text("#usda 1.0\n" + text.replace("{", "{\n").replace("}", "\n}\n"))
    stage = Usd.Stage.Open(str(path))
    net = Network(stage, "/Hair")
    helpers = {key: inputs.pop(key, None) for key in ("roughness", "absorption", "of")}
    of = helpers["of"](net) if callable(helpers["of"]) else helpers["of"] or {}
    net.hair(
        helpers["absorption"] or "deon_hair_absorption_from_melanin",
        helpers["roughness"] or {},
        **of,
    )
    hair = UsdShade.Shader(stage.GetPrimAtPath("/Hair/Hair"))
    types = {float: Sdf.ValueTypeNames.Float, 2: Sdf.ValueTypeNames.Float2,
             3: Sdf.ValueTypeNames.Color3f}  # fmt: skip
    for name, value in inputs.items():
        made = hair.GetInput(name)
        if made:
            made.ClearSources()
        kind = types[float] if isinstance(value, float) else types[len(value)]
        if name == "absorption_coefficient":
            kind = Sdf.ValueTypeNames.Float3
        made = hair.CreateInput(name, kind)
        made.Set({2: Gf.Vec2f, 3: Gf.Vec3f}[len(value)](*value) if kind != types[float] else value)
    stage.GetRootLayer().Save()
    loaded = load_stage(path, builder_factory=Recorder)
    notes = [line for line in said(loaded).splitlines() if not line.startswith("note: no ")]
    return loaded.scene, "\n".join(notes)


def test_helpers_become_parameters(tmp_path: Path) -> None:
    roughness = {"longitudinal": ("float", 0.4), "azimuthal": ("float", 0.6),
                 "scale_TT": ("float", 0.7), "scale_TRT": ("float", 1.5)}  # fmt: skip
    scene, told = read(
        tmp_path, roughness=roughness, absorption="chiang_hair_absorption_from_color",
        of={"color": ("color3", (0.5, 0.3, 0.1)), "azimuthal_roughness": ("float", 0.6)},
        cuticle_angle=0.52, ior=1.6, tint_TT=(0.5, 0.5, 0.5),
    )  # fmt: skip
    made = scene.material_of("C")
    assert made["program"] == "hair" and told == ""
    assert made["base_color"] == pytest.approx((0.5, 0.3, 0.1))
    assert made["roughness"] == pytest.approx(0.4)
    assert made["azimuthal_roughness"] == pytest.approx(0.6)
    assert (made["scale_tt"], made["scale_trt"]) == pytest.approx((0.7, 1.5))
    assert made["cuticle_tilt"] == pytest.approx(-3.6, abs=1e-4)
    assert made["ior"] == pytest.approx(1.6)
    assert (made["tint_r"], made["tint_tt"], made["tint_trt"]) == pytest.approx((1, 0.5, 1))


def test_a_colour_of_another_roughness_keeps_its_absorption(tmp_path: Path) -> None:
    scene, _ = read(
        tmp_path, roughness={"azimuthal": ("float", 0.3)},
        absorption="chiang_hair_absorption_from_color",
        of={"color": ("color3", (0.5, 0.3, 0.1)), "azimuthal_roughness": ("float", 0.8)},
    )  # fmt: skip
    colour = np.log(scene.material_of("C")["base_color"]) / color_divisor(0.3)
    assert colour == pytest.approx(np.log((0.5, 0.3, 0.1)) / color_divisor(0.8), rel=1e-4)


def test_melanin(tmp_path: Path) -> None:
    """Absorption from melanin, by the formula of MaterialX's shader code."""
    of = {"melanin_concentration": ("float", 0.6), "melanin_redness": ("float", 0.3)}
    scene, _ = read(tmp_path, of=of)
    amount = -math.log(0.4)
    eumelanin, pheomelanin = (
        -np.log((0.657704, 0.498077, 0.254106)),
        -np.log((0.829443, 0.670320, 0.349937)),
    )
    absorption = amount * (0.7 * eumelanin + 0.3 * pheomelanin)
    colour = np.exp(-np.sqrt(absorption) * color_divisor(0.2))
    assert scene.material_of("C")["base_color"] == pytest.approx(colour, rel=1e-4)


def test_plain_values(tmp_path: Path) -> None:
    """Variances, scales and absorption are set directly, without helper nodes."""
    scene, told = read(
        tmp_path, roughness_R=(variance(0.35), scale(0.45)),
        roughness_TT=(0.16 * variance(0.35), scale(0.45)),
        roughness_TRT=(2.25 * variance(0.35), scale(0.45)),
        absorption_coefficient=(0.1, 0.3, 0.9),
    )  # fmt: skip
    made = scene.material_of("C")
    assert told == ""
    assert made["roughness"] == pytest.approx(0.35, abs=1e-4)
    assert made["azimuthal_roughness"] == pytest.approx(0.45, abs=1e-4)
    assert (made["scale_tt"], made["scale_trt"]) == pytest.approx((0.4, 1.5), abs=1e-4)
    root = np.log(made["base_color"]) / color_divisor(0.45)
    assert root**2 == pytest.approx((0.1, 0.3, 0.9), rel=1e-3)


def test_what_is_not_supported_is_said(tmp_path: Path) -> None:
    _, told = read(tmp_path, tint_R=(1.0, 0.5, 0.2), roughness_TT=(0.05, 0.3))
    assert "input tint_R in a colour (its luminance)" in told
    assert "different azimuthal roughness" in told
    _, told = read(tmp_path, mesh=True)
    assert "hair on a mesh" in told
    normals = "normal3f[] normals = [(0,0,1), (0,0,1), (0,0,1), (0,0,1)]"
    _, told = read(tmp_path, normals)
    assert "hair on ribbons" in told


def test_primvars_vary_from_strand_to_strand(tmp_path: Path) -> None:
    more = 'float[] primvars:melanin = [0.1, 0.9] ( interpolation = "uniform" )'

    def of(net: Network) -> dict[str, Any]:
        node = net.node("geompropvalue", "float", geomprop=("string", "melanin"))
        return {"melanin_concentration": node}

    scene, told = read(tmp_path, more, of=of)
    assert told == ""
    assert "graph" in scene.material_of("C")
    rate, values = scene.mesh("C")["attributes"]["melanin"]
    assert values.ravel() == pytest.approx([0.1, 0.9]), rate


def furry(folder: Path) -> Path:
    path = folder / "fur.usdc"
    write_scene("fur", path, strands=3000)
    return path


def test_one_picture_for_all_schedules(tmp_path: Path) -> None:
    stage = wavecomb.load(furry(tmp_path))
    settings: dict[str, Any] = {"size": (40, 30), "spp": 3, "max_depth": 6, "roulette": "off"}
    expected = wavecomb.render(stage, integrator="reference", threads=1, **settings).beauty
    assert expected.max() > 0
    policies = ("none", "material", "random-runs")
    for lanes, policy, wave in itertools.product(_core.lane_widths(), policies, (64, 4096)):
        picture = wavecomb.render(
            stage, lanes=lanes, policy=policy, wave_size=wave, threads=2, **settings
        )
        assert np.array_equal(picture.beauty, expected), (lanes, policy, wave)


def strands(
    kind: str, count: int, material: dict[str, Any], lamps: Sequence[tuple[Any, ...]] = ()
) -> Any:
    """Returns a bundle of hair under a white sky, or lights (position, radius, colour)."""
    builder = wavecomb.SceneBuilder()
    hair = builder.add_material("hair", **{"base_color": (1, 1, 1), "ior": 1.55, **material})
    rng = np.random.default_rng(5)
    points = 4 if kind.startswith("cubic") else 2
    ends = rng.normal(size=(count, 2, 3)) * 0.2
    ends[:, 1] += (0, 1.2, 0)
    ends[:, 0] -= (0, 1.2, 0)
    t = np.linspace(0, 1, points)[None, :, None]
    lines = ends[:, :1] * (1 - t) + ends[:, 1:] * t + 0.1 * rng.normal(size=(count, points, 3))
    positions = np.ascontiguousarray(lines.reshape(-1, 3), np.float32)
    options = {"normals": np.tile(np.float32([0, 0, 1]), (len(positions), 1))}
    curves = builder.add_curves(
        kind, positions, np.arange(0, len(positions), points, dtype=np.uint32),
        np.full(len(positions), 0.06, np.float32), material=hair,
        **(options if kind.endswith("ribbon") else {}),
    )  # fmt: skip
    builder.add_to_group(0, curves)
    if not lamps:
        builder.add_light("dome", np.eye(4), color=(1, 1, 1))
    for place, radius, color in lamps:
        to_world = np.eye(4)
        to_world[3, :3] = place
        builder.add_light("sphere", to_world, radius=radius, color=color)
    camera = np.eye(4)
    camera[3, :3] = (0, 0, 4)
    builder.set_camera(camera, window=(-0.15, 0.15, -0.15, 0.15))
    return builder.build()


@pytest.mark.parametrize("kind", ["linear-tube", "cubic-tube", "cubic-ribbon"])
def test_white_hair_under_a_white_sky_is_white(kind: str) -> None:
    """A furnace test of round and flat curves: no energy is lost or gained."""
    material = {"roughness": 0.3, "azimuthal_roughness": 0.3, "cuticle_tilt": 3.0}
    scene = strands(kind, 12, material)
    picture = wavecomb.render(
        scene, size=(32, 32), spp=64, max_depth=200, roulette="off", threads=2
    )
    assert picture.albedo is not None
    assert (picture.albedo.min(axis=2) > 0.99).mean() > 0.3
    assert np.abs(picture.beauty - 1).mean(axis=(0, 1)).max() < 0.03
    assert picture.beauty.mean(axis=(0, 1)) == pytest.approx(1.0, abs=0.005)


@pytest.mark.slow
def test_lamps_are_what_each_brings_alone() -> None:
    """The image with several lights equals the sum of the images with each light alone."""
    lamps = [
        ((1.5, 1, 2), 0.3, (9, 6, 3)),
        ((-2, 0, -2), 0.5, (2, 4, 9)),
        ((0, 3, 1), 0.1, (90, 90, 90)),
        ((0, -2.5, -1), 0.4, (0, 5, 0)),
    ]
    material = {"base_color": (0.8, 0.5, 0.2), "roughness": 0.25, "azimuthal_roughness": 0.3}

    def blocks(some: Sequence[Any], seeds: int) -> Any:
        scene = strands("linear-tube", 12, material, some)
        pictures = [
            wavecomb.render(scene, size=(16, 16), spp=16, max_depth=4, seed=s, threads=2).beauty
            for s in range(seeds)
        ]
        return np.stack(pictures).reshape(seeds, 4, 4, 4, 4, 3).mean((2, 4))

    together = blocks(lamps, 24)
    alone = sum(blocks([lamp], 24) for lamp in lamps)
    error = np.sqrt((together.var(0, ddof=1) + alone.var(0, ddof=1)) / 24)
    z = (together.mean(0) - alone.mean(0)) / error
    assert together.mean() > 0.01
    # 48 values with 46 degrees of freedom: exceeded by chance in 1 of 10,000 runs.
    assert np.abs(z).max() < 5.5
    assert error.mean() < 0.1 * together.mean()


def test_paths_from_lights_leave_hair_to_the_camera(tmp_path: Path) -> None:
    stage = wavecomb.load(furry(tmp_path))
    settings: dict[str, Any] = {"size": (16, 12), "spp": 64, "max_depth": 4, "threads": 2}
    plain = wavecomb.render(stage, **settings).beauty.mean()
    joined = wavecomb.render(stage, transport="light", **settings).beauty.mean()
    assert joined == pytest.approx(plain, rel=0.02)


@pytest.mark.parametrize("name", ["fur", "head"])
def test_stages_of_strands(name: str, tmp_path: Path) -> None:
    path = tmp_path / "stage.usdc"
    write_scene(name, path, strands=50)
    loaded = load_stage(path, builder_factory=Recorder)
    assert said(loaded) == ""
    strands = loaded.scene.mesh("Fur" if name == "fur" else "Hair")
    assert loaded.scene.materials[strands["material"]]["program"] == "hair"
    first = strands["segments"] >> 31 == 0
    assert strands["kind"] == "cubic-tube" and first.sum() == 50
    with pytest.raises(ValueError, match="strands must be from 1"):
        write_scene(name, path, strands=0)
