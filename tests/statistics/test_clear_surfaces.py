# SPDX-License-Identifier: Apache-2.0
"""Clear surfaces: rays pass straight through, and so do shadow rays."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from agreement import assert_agree, batches
from numpy.typing import NDArray
from stages import (
    box,
    camera,
    ground,
    light,
    look_at,
    material,
    quad,
    sphere,
    turned,
    write_stage,
)

import wavecomb
from wavecomb.scenes.authoring.textures import write_image

SUN = light("Distant", "Sun", colour=(3, 3, 3), angle=0.0, transform=turned(x=-60))
WHITE = material("White", "diffuse", diffuseColor=(0.5,) * 3)


def pane(name: str, height: float, material: str) -> str:
    """A square of 8 x 8 above the floor."""
    h = height
    return quad(name, [(-4, h, 4), (4, h, 4), (4, h, -4), (-4, h, -4)], material)


def transmission(opacity: float, ior: float, cosine: float) -> float:
    """(1 - opacity) (1 - F), by Fresnel's formulas."""
    t = np.sqrt(1 - (1 - cosine**2) / ior**2)
    p = (ior * cosine - t) / (ior * cosine + t)
    s = (cosine - ior * t) / (cosine + ior * t)
    return float((1 - opacity) * (1 - (p * p + s * s) / 2))


@pytest.mark.parametrize(("opacity", "ior"), [(0.1, 1.5), (0.6, 1.3), (0.0, 2.0)])
def test_sun_through_panes(opacity: float, ior: float, tmp_path: Path, beauty: Any) -> None:
    """Sunlight on a floor below two panes is dimmed by their transmissions, without noise."""
    eye = camera((6, 0.4, 0), (0, 0, 0), half=1e-3)
    clear = material(
        "Clear", "principled", diffuseColor=(0.8, 0.9, 0.7), roughness=0.0, opacity=opacity, ior=ior
    )
    panes = [pane("Low", 1.0, "Clear"), pane("High", 2.0, "Clear")]

    def floor(count: int) -> NDArray[np.float32]:
        stage = write_stage(
            tmp_path / f"{count}.usda", eye, SUN, WHITE, clear, ground("White"), *panes[:count]
        )
        image: NDArray[np.float32] = beauty(stage, 4, 4, max_depth=1)
        return image

    bare = floor(0)
    assert bare.min() > 0
    once = transmission(opacity, ior, np.cos(np.pi / 6))
    for count in (1, 2):
        np.testing.assert_allclose(floor(count) / bare, once**count, rtol=2e-4)


def test_camera_sees_through_a_pane(tmp_path: Path, beauty: Any) -> None:
    """An emissive floor seen straight through a pane that reflects a black room."""
    # The view lies within one triangle of the pane, where decisions are stratified.
    eye = camera((2, 3, 0.001), (2, 0, 0), half=0.2)
    glow = material("Glow", "emissive", emissiveColor=(1, 2, 4))
    clear = material("Clear", "principled", diffuseColor=(0, 0, 0), roughness=0.0, opacity=0.3)
    stage = write_stage(
        tmp_path / "stage.usda", eye, glow, clear, ground("Glow"), pane("Pane", 1.0, "Clear")
    )
    # The floor also lights the pane from below, which reflects nothing back up to the camera.
    image = beauty(stage, 8, 256, max_depth=1)
    expected = transmission(0.3, 1.5, 1.0) * np.array((1, 2, 4))
    # Decisions are stratified over the samples of a pixel, so their error is at most 1 in 256.
    np.testing.assert_allclose(image, np.broadcast_to(expected, image.shape), rtol=8e-3)


def wall(name: str, **inputs: object) -> str:
    """A thin wall of OpenPBR."""
    types = {"transmission_color": "color3f", "coat_color": "color3f", "base_color": "color3f"}
    lines = [
        f"{types.get(key, 'float')} inputs:{key} = {value}"
        for key, value in {"specular_roughness": 0, "transmission_weight": 1, **inputs}.items()
    ]
    return f"""def Material "{name}" {{
        token outputs:mtlx:surface.connect = </World/{name}/S.outputs:out>
        def Shader "S" {{
            uniform token info:id = "ND_open_pbr_surface_surfaceshader"
            bool inputs:geometry_thin_walled = true
            {chr(10).join(lines)}
            token outputs:out
        }}
    }}"""


def wall_transmission(ior: float, cosine: float) -> float:
    """1 - 2 R / (1 + R): the transmission of both faces with all interreflections."""
    r = 1 - transmission(0.0, ior, cosine)
    return (1 - r) / (1 + r)


@pytest.mark.parametrize("tint", [(1, 1, 1), (0.9, 0.5, 0.2)])
@pytest.mark.parametrize("ior", [1.5, 2.0])
def test_sun_through_thin_walls(
    ior: float, tint: tuple[float, ...], tmp_path: Path, beauty: Any
) -> None:
    """Shadow rays pass thin walls by their smallest component; bounces find the rest."""
    eye = camera((6, 0.4, 0), (0, 0, 0), half=1e-3)
    clear = wall("Clear", specular_ior=ior, transmission_color=tint)

    def floor(count: int) -> NDArray[np.float32]:
        panes = [pane("Low", 1.0, "Clear"), pane("High", 2.0, "Clear")][:count]
        stage = write_stage(
            tmp_path / f"{count}.usda", eye, SUN, WHITE, clear, ground("White"), *panes
        )
        image: NDArray[np.float32] = beauty(stage, 4, 4, max_depth=1)
        return image

    bare = floor(0)
    once = wall_transmission(ior, np.cos(np.pi / 6)) * min(tint)
    for count in (1, 2):
        np.testing.assert_allclose(floor(count) / bare, once**count, rtol=1e-3)


def test_camera_sees_through_a_tinted_wall(tmp_path: Path, beauty: Any) -> None:
    """Traversal and the BSDF together transmit the wall's colour."""
    eye = camera((2, 3, 0.001), (2, 0, 0), half=0.2)
    glow = material("Glow", "emissive", emissiveColor=(1, 1, 1))
    tint = (0.8, 0.4, 0.6)
    coat = {"coat_weight": 1, "coat_roughness": 0, "coat_color": (0.9, 0.8, 1)}
    for name, inputs in (("bare", {}), ("coated", coat)):
        clear = wall("Clear", transmission_color=tint, **inputs)
        stage = write_stage(
            tmp_path / f"{name}.usda", eye, glow, clear, ground("Glow"), pane("P", 1.0, "Clear")
        )
        image = beauty(stage, 8, 1024, max_depth=2).mean(axis=(0, 1))
        if name == "bare":
            np.testing.assert_allclose(image, wall_transmission(1.5, 1) * np.array(tint), rtol=0.01)
        else:
            assert (image[:2] < 0.9 * wall_transmission(1.5, 1) * np.array(tint[:2])).all()


def showcase(folder: Path) -> Path:
    """A ball in a glass box, a smooth clear ball, leaves and a tinted metal, in sun and lamp."""
    leaf = folder / "leaf.png"
    mask = np.kron(np.random.default_rng(5).integers(0, 2, (8, 8)), np.ones((2, 2)))
    write_image(leaf, np.repeat(mask[..., None], 3, axis=2), "uint8")
    leaves = material(
        "Leaves", "principled", texture=leaf, diffuseColor=(0.2, 0.6, 0.1), roughness=0.4
    )
    leaves = leaves.replace(
        "color3f inputs:diffuseColor.connect = </World/Leaves/Map.outputs:rgb>",
        "float inputs:opacity.connect = </World/Leaves/Map.outputs:r>",
    ).replace("float3 outputs:rgb", "float outputs:r")
    return write_stage(
        folder / "stage.usda",
        camera((0.3, 1.6, 3.4), (0.0, 0.5, 0.0), half=0.42),
        light(
            "Rect",
            colour=(6, 6, 5),
            transform=look_at((0.4, 2.4, 0.3), (0.2, 0, -0.2)),
            width=0.6,
            height=0.4,
        ),
        light("Distant", "Sun", colour=(2, 1.8, 1.5), angle=25.0, transform=turned(x=-50, y=30)),
        WHITE,
        material("Red", "plastic", diffuseColor=(0.6, 0.2, 0.1), roughness=0.4),
        material("Glass", "principled", diffuseColor=(0.9, 0.9, 1), roughness=0.4, opacity=0.15),
        material("Ball", "principled", diffuseColor=(0.5, 0.9, 0.6), roughness=0.5, opacity=0.3),
        material(
            "Tinted",
            "principled",
            diffuseColor=(0.9, 0.6, 0.3),
            roughness=0.5,
            metallic=0.6,
            clearcoat=0.5,
            opacity=0.4,
        ),
        leaves,
        wall("Window", transmission_color=(0.9, 0.7, 0.5), coat_weight=0.5, coat_roughness=0),
        ground("White", 2.0),
        quad(
            "Window1",
            [(-0.9, 0.0, 1.2), (0.1, 0.0, 1.3), (0.1, 0.9, 1.2), (-0.9, 0.9, 1.1)],
            "Window",
        ),
        box("Case", (-1.1, 0.05, -0.4), (-0.1, 1.1, 0.6), "Glass"),
        sphere("Inside", "Red", (-0.6, 0.5, 0.1), 0.35),
        sphere("Smooth", "Ball", (0.6, 0.4, 0.6), 0.35, smooth=True),
        sphere("Metal", "Tinted", (0.5, 0.35, -0.5), 0.3),
        quad(
            "Leaf",
            [(0.2, 1.0, 0.9), (1.2, 1.2, 0.9), (1.2, 1.3, -0.4), (0.2, 1.1, -0.4)],
            "Leaves",
            uv=[(0, 0), (1, 0), (1, 1), (0, 1)],
        ),
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "settings",
    [{"transport": "light"}, {"transport": "bdpt"}, {"guiding": "on"}],
    ids=["light paths", "connections", "guiding"],
)
def test_clear_surfaces_are_unbiased(settings: dict[str, Any], tmp_path: Path, beauty: Any) -> None:
    """Light paths, connections and guiding agree with plain paths on what is clear."""
    stage = wavecomb.load(showcase(tmp_path))
    plain = {"max_depth": 5, "light_weights": "power"}
    a = batches(lambda seed: beauty(stage, 32, 32, seed=seed, **plain, **settings), 12)
    b = batches(lambda seed: beauty(stage, 32, 64, seed=seed, **plain), 12, 500)
    assert_agree(f"clear surfaces {'-'.join(settings.values())}", a, b)


@pytest.mark.parametrize("mode", ["transparent", "presence"])
def test_shadow_colours_behind_clear_surfaces(mode: str, tmp_path: Path, beauty: Any) -> None:
    """Light that a surface holds back is tinted by the shadow colour t: t + (1 - t) T."""
    eye = camera((6, 0.4, 0), (0, 0, 0), half=1e-3)
    half = material("Half", "principled", diffuseColor=(0, 0, 0), roughness=0.0, opacity=0.5)
    if mode == "presence":
        shader = 'uniform token info:id = "UsdPreviewSurface"'
        half = half.replace(shader, shader + '\ntoken inputs:opacityMode = "presence"')
    tint = np.array((0.0, 0.25, 0.5))
    apis = '"Sun" ( prepend apiSchemas = ["ShadowAPI"] ) {'
    sun = SUN.replace('"Sun" {', apis).replace(
        "float inputs:intensity",
        "color3f inputs:shadow:color = (0, 0.25, 0.5)\nfloat inputs:intensity",
    )
    floors = []
    for name, prims in (("bare", ()), ("covered", (pane("Pane", 1.0, "Half"),))):
        stage = write_stage(
            tmp_path / f"{name}.usda", eye, sun, WHITE, half, ground("White"), *prims
        )
        floors.append(beauty(stage, 4, 4, max_depth=1).mean((0, 1)))
        reference = beauty(stage, 4, 4, max_depth=1, integrator="reference").mean((0, 1))
        np.testing.assert_array_equal(floors[-1], reference)
    passed = 0.5 if mode == "presence" else transmission(0.5, 1.5, np.cos(np.pi / 6))
    np.testing.assert_allclose(floors[1] / floors[0], tint + (1 - tint) * passed, rtol=3e-4)


@pytest.mark.parametrize("ior", [1.0, 1.001, 1.5])
def test_clear_surfaces_emit(ior: float, tmp_path: Path, beauty: Any) -> None:
    """A surface of opacity 0 is as bright as its emission, even if all light passes."""
    eye = camera((2, 3, 0.001), (2, 0, 0), half=0.2)
    glow = material(
        "Glow", "principled", diffuseColor=(0, 0, 0), emissiveColor=(1, 2, 4), opacity=0.0, ior=ior
    )
    black = material("Black", "diffuse", diffuseColor=(0, 0, 0))
    stage = write_stage(
        tmp_path / "stage.usda", eye, glow, black, ground("Black"), pane("Pane", 1.0, "Glow")
    )
    image = beauty(stage, 8, 256, max_depth=2)
    np.testing.assert_allclose(image.mean((0, 1)), (1, 2, 4), rtol=5e-3)


@pytest.mark.parametrize("mode", ["transparent", "presence"])
def test_points_are_crossed_twice(mode: str, tmp_path: Path, beauty: Any) -> None:
    """Camera and shadow rays cross the surface of a point twice, like that of a sphere."""
    half = material("Half", "principled", diffuseColor=(0, 0, 0), roughness=0.0, ior=1, opacity=0.3)
    if mode == "presence":
        shader = 'uniform token info:id = "UsdPreviewSurface"'
        half = half.replace(shader, shader + '\ntoken inputs:opacityMode = "presence"')
    dots = """def Points "Dot" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {
        point3f[] points = [(0, 1.5, 0)]
        float[] widths = [2]
        rel material:binding = </World/Half>
    }"""
    glow = material("Glow", "emissive", emissiveColor=(1, 1, 1))
    down = camera((0, 6, 0.001), (0, 0, 0), half=1e-3)
    seen = write_stage(tmp_path / "seen.usda", down, glow, half, ground("Glow"), dots)
    across = camera((6, 0.4, 0), (0, 0, 0), half=1e-3)
    zenith = light("Distant", "Sun", colour=(3, 3, 3), angle=0.0, transform=turned(x=-90))
    lit = [
        write_stage(tmp_path / f"{len(x)}.usda", across, zenith, WHITE, half, ground("White"), *x)
        for x in ((), (dots,))
    ]
    bare, dimmed = (beauty(stage, 4, 4, max_depth=1).mean() for stage in lit)
    np.testing.assert_allclose(dimmed / bare, 0.7**2, rtol=1e-3)
    np.testing.assert_allclose(beauty(seen, 8, 512, max_depth=0).mean(), 0.7**2, rtol=0.02)
