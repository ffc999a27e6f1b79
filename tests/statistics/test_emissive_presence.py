# SPDX-License-Identifier: Apache-2.0
"""Emissive meshes and mesh lights with opacity: they contribute opacity times their emission.

A floor below a square is lit by light samples, which aim at the square, and by bounces, which hit
the square where it is present. Each technique is also tested alone: only bounces find moving
meshes, and only light samples find a mesh light of mode independent.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from stages import camera, ground, material, matrix, moved, numbers, turned, write_stage

import wavecomb
from wavecomb import _core
from wavecomb.scenes.authoring.textures import write_image

ALBEDO = 0.6
SQUARE = [(-0.5, 0.5, 0), (0.5, 0.5, 0), (0.5, -0.5, 0), (-0.5, -0.5, 0)]
DOWN = turned(x=-90) @ moved(0, 1, 0)
GLOW = np.array((0.5, 1.0, 2.0))
TINT = np.array((4.0, 1.0, 0.5))
FLOOR = material("M", "diffuse", diffuseColor=(ALBEDO,) * 3) + "\n" + ground("M", 20)
SHUTTER = "double shutter:open = -0.5\ndouble shutter:close = 0.5"
AT_FLOOR = camera((4, 2, 0.5), (0, 0, 0), half=1e-3, lens=SHUTTER)
UNDER_SQUARE = ALBEDO * 4 / np.pi * (0.5 / np.sqrt(1.25)) * np.arctan(0.5 / np.sqrt(1.25))
"""Radiance of the floor below the centre of SQUARE of radiance 1 at height 1, by form factors."""

SYNC = {
    "glow": None,
    "tinted": "materialGlowTintsLight",
    "independent": "independent",
}


def square(
    kind: str = "glow", *, name: str = "Lamp", place: Any = DOWN, moves: bool = False
) -> str:
    """An emissive mesh, or a mesh light in one of its modes, with material G."""
    apis = ['"MaterialBindingAPI"']
    lines = [
        f"point3f[] points = {numbers(SQUARE)}",
        "int[] faceVertexCounts = [4]\nint[] faceVertexIndices = [0, 1, 2, 3]",
        'uniform token subdivisionScheme = "none"',
        "texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)]"
        ' ( interpolation = "vertex" )',
        "rel material:binding = </World/G>",
    ]  # fmt: skip
    if SYNC[kind]:
        apis.append('"MeshLightAPI"')
        lines.append(f'uniform token light:materialSyncMode = "{SYNC[kind]}"')
        lines.append(f"color3f inputs:color = {numbers(TINT)}")
    if moves:
        lines.append(
            "double3 xformOp:translate.timeSamples = { -1: (-1e-3, 1, 0), 1: (1e-3, 1, 0) }\n"
            "float xformOp:rotateX = -90\n"
            'uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]'
        )
    elif place is not None:
        lines.append(matrix(place))
    body = "\n".join(lines)
    return f'def Mesh "{name}" ( prepend apiSchemas = [{", ".join(apis)}] ) {{\n{body}\n}}'


def shown(kind: str) -> NDArray[np.float64]:
    """Expected radiance of the emission ``GLOW`` in a mode."""
    return {"glow": GLOW, "tinted": GLOW * TINT, "independent": TINT}[kind]


def constant(opacity: float, threshold: float = 0.0) -> str:
    text = material("G", "principled", emissiveColor=GLOW, diffuseColor=(0, 0, 0),
                    opacity=opacity, opacityThreshold=threshold, ior=1)  # fmt: skip
    return text.replace(
        'uniform token info:id = "UsdPreviewSurface"',
        'uniform token info:id = "UsdPreviewSurface"\ntoken inputs:opacityMode = "presence"',
    )


def textured(threshold: float = 0.0) -> str:
    """Opacity from the red channel of mask.exr."""
    text = constant(1.0, threshold).replace("float inputs:opacity = 1.0", "")
    connection = "float inputs:opacity.connect = </World/G/Map.outputs:r>"
    nodes = """def Shader "Map" {
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @mask.exr@
            token inputs:sourceColorSpace = "raw"
            token inputs:wrapS = "clamp"
            token inputs:wrapT = "clamp"
            float2 inputs:st.connect = </World/G/St.outputs:result>
            float outputs:r
        }
        def Shader "St" {
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }"""
    text = text.replace("token outputs:surface\n", f"token outputs:surface\n{connection}\n", 1)
    return text[: text.rindex("}")] + nodes + "\n}"


def driven() -> str:
    """Opacity from a value graph: 1/2 + x, with x along the square in object space."""
    return f"""def Material "G" {{
        token outputs:mtlx:surface.connect = </World/G/Surface.outputs:out>
        def Shader "Surface" {{
            uniform token info:id = "ND_open_pbr_surface_surfaceshader"
            float inputs:base_weight = 0
            float inputs:specular_weight = 0
            float inputs:emission_luminance = 1
            color3f inputs:emission_color = {numbers(GLOW)}
            float inputs:geometry_opacity.connect = </World/G/Add.outputs:out>
            token outputs:out
        }}
        def Shader "Add" {{
            uniform token info:id = "ND_add_float"
            float inputs:in1.connect = </World/G/Dot.outputs:out>
            float inputs:in2 = 0.5
            float outputs:out
        }}
        def Shader "Dot" {{
            uniform token info:id = "ND_dotproduct_vector3"
            float3 inputs:in1.connect = </World/G/Place.outputs:out>
            float3 inputs:in2 = (1, 0, 0)
            float outputs:out
        }}
        def Shader "Place" {{
            uniform token info:id = "ND_position_vector3"
            string inputs:space = "object"
            float3 outputs:out
        }}
    }}"""


def under_mask(mask: NDArray[np.float32]) -> float:
    """Radiance of the floor below a square whose opacity is a bilinear, clamped mask."""
    n, steps = len(mask), 400
    at = (np.arange(steps) + 0.5) / steps
    texel = np.clip(at * n - 0.5, 0, n - 1)
    first = np.minimum(texel.astype(int), n - 2)
    weights = np.zeros((steps, n))
    weights[np.arange(steps), first] = 1 - (texel - first)
    weights[np.arange(steps), first + 1] = texel - first
    opacity = weights @ mask @ weights.T
    away2 = (at[:, None] - 0.5) ** 2 + (at[None, :] - 0.5) ** 2
    return float(ALBEDO / np.pi * (opacity / (1 + away2) ** 2).mean())


def write_mask(folder: Path, values: NDArray[np.float32]) -> None:
    write_image(folder / "mask.exr", np.repeat(values[..., None], 3, axis=2), "float")


Shot = Callable[..., NDArray[np.float64]]


@pytest.fixture
def shot(tmp_path: Path, beauty: Any) -> Shot:
    """Function that renders the floor below the square with direct light only."""

    def render(
        *prims: str, spp: int = 256, view: str = AT_FLOOR, floor: str = FLOOR, **settings: Any
    ) -> NDArray[np.float64]:
        stage = write_stage(tmp_path / "stage.usda", view, floor, *prims)
        loaded = wavecomb.load(stage, frame=0)
        picture = beauty(loaded, 16, spp, **({"max_depth": 1} | settings))
        return np.asarray(picture, np.float64).reshape(-1, 3)

    return render


def agree(found: NDArray[np.float64], expected: Any) -> None:
    """Expect the mean within 4.5 standard errors, which must be small enough to be significant.

    ``expected`` may also be the pixels of another image.
    """
    expected = np.asarray(expected, np.float64)
    error2 = found.var(axis=0, ddof=1) / len(found)
    if expected.ndim == 2:
        error2 = error2 + expected.var(axis=0, ddof=1) / len(expected)
        expected = expected.mean(axis=0)
    limit = 4.5 * np.sqrt(error2) + 1e-4 * expected
    assert (limit <= 0.05 * expected).all(), "too noisy to tell"
    assert (np.abs(found.mean(axis=0) - expected) <= limit).all(), (found.mean(axis=0), expected)


@pytest.mark.parametrize("kind", SYNC)
@pytest.mark.parametrize(
    ("opacity", "threshold", "there"),
    [(0.5, 0.0, 0.5), (0.0, 0.0, 0.0), (0.4, 0.5, 0.0), (0.6, 0.5, 1.0)],
)
def test_constant_opacity(
    shot: Shot, kind: str, opacity: float, threshold: float, there: float
) -> None:
    found = shot(constant(opacity, threshold), square(kind))
    if there == 0:
        assert found.max() == 0
    else:
        agree(found, there * shown(kind) * UNDER_SQUARE)


@pytest.mark.parametrize("kind", SYNC)
def test_textured_opacity(shot: Shot, tmp_path: Path, kind: str) -> None:
    checker = (np.indices((8, 8)).sum(axis=0) % 2).astype(np.float32)
    values = np.random.default_rng(3).random((8, 8)).astype(np.float32)
    mask = np.maximum(checker, 0.5 * values)
    write_mask(tmp_path, mask)
    agree(shot(textured(), square(kind)), shown(kind) * under_mask(mask))


def test_textured_opacity_with_a_threshold(shot: Shot, tmp_path: Path) -> None:
    """Half of the square is present."""
    write_mask(tmp_path, np.repeat([[0.0, 1.0]], 2, axis=0).astype(np.float32).repeat(8, axis=1))
    agree(shot(textured(0.5), square()), 0.5 * GLOW * UNDER_SQUARE)


@pytest.mark.parametrize("kind", SYNC)
def test_opacity_by_a_graph(shot: Shot, kind: str) -> None:
    agree(shot(driven(), square(kind)), 0.5 * shown(kind) * UNDER_SQUARE)


def test_a_light_without_a_material_has_no_opacity(shot: Shot) -> None:
    """In mode noMaterialResponse the material has no effect."""
    lamp = square("tinted").replace("materialGlowTintsLight", "noMaterialResponse")
    agree(shot(constant(0.5), lamp), TINT * UNDER_SQUARE)


@pytest.mark.slow
def test_bounces_and_light_samples_alone(shot: Shot, tmp_path: Path) -> None:
    """Moving meshes are found by bounces only; both techniques together give the same mean."""
    write_mask(tmp_path, np.random.default_rng(5).random((4, 4)).astype(np.float32))
    for surface in (constant(0.5), textured(), driven()):
        by_bounces = shot(surface, square(moves=True), spp=2048)
        by_both = shot(surface, square())
        by_samples = shot(surface, square("independent"))
        agree(by_both, by_bounces)
        agree(by_samples / TINT * GLOW, by_bounces)


@pytest.mark.parametrize("roughness", [0.2, 0.6])
def test_on_gloss(shot: Shot, roughness: float) -> None:
    """A light of opacity 1/2 contributes half of its radiance to glossy floors, with MIS."""
    metal = material("M", "metal", diffuseColor=(0.9, 0.9, 0.9), roughness=roughness)
    scene: dict[str, Any] = {
        "view": camera((0, 1, 2), (0, 0, 1), half=0.02, lens=SHUTTER),
        "floor": metal + "\n" + ground("M", 20),
        "spp": 1024,
    }
    whole = shot(constant(1.0), square(), **scene)
    agree(shot(constant(0.5), square(), **scene), 0.5 * whole)
    agree(shot(driven(), square(), **scene), 0.5 * whole)  # 1/2 + x, averaged along x = 0


def test_instances(shot: Shot) -> None:
    """Two instances of one prototype, mirrored and rotated; one is seen through the other."""
    mirrored = np.diag((-1.0, 1.0, 1.0, 1.0)) @ DOWN
    prims = f"""class "Lamps" {{
        {square(place=None)}
    }}
    def Xform "A" ( instanceable = true\n inherits = </World/Lamps> ) {{
        {matrix(mirrored)}
    }}
    def Xform "B" ( instanceable = true\n inherits = </World/Lamps> ) {{
        {matrix(turned(z=90) @ DOWN @ moved(0, 1, 0))}
    }}"""
    corner = 0.25 / np.sqrt(1 + 0.25**2)
    above = ALBEDO * 4 / np.pi * corner * np.arctan(corner)
    # The opacity of the upper square is 1/2 + z, and a fraction 1/2 + x of its light passes the
    # lower square. By symmetry, the mean of the product over the upper square is 1/4.
    agree(shot(driven(), prims), GLOW * (0.5 * UNDER_SQUARE + 0.25 * above))


def test_every_way_gives_the_same_picture(tmp_path: Path) -> None:
    """Waves and reference integrator agree bitwise for all modes and kinds of opacity."""
    write_mask(tmp_path, np.random.default_rng(5).random((4, 4)).astype(np.float32))
    view = camera((0, 1.5, 4), (0, 0.3, 0), half=0.5)
    for surface in (constant(0.5), textured(0.4), driven()):
        lamps = [
            square(kind, name=kind.title(), place=turned(x=-70) @ moved(1.1 * i - 1.6, 1, 0))
            for i, kind in enumerate(SYNC)
        ]
        stage = wavecomb.load(write_stage(tmp_path / "s.usda", view, FLOOR, surface, *lamps))
        plain: dict[str, Any] = {"size": (32, 24), "spp": 4, "max_depth": 4, "threads": 2}
        reference = wavecomb.render(stage, integrator="reference", **plain).beauty
        assert reference.max() > 0.1
        for policy in _core.policies():
            picture = wavecomb.render(stage, policy=policy, wave_size=64, **plain).beauty
            assert np.array_equal(picture, reference), policy
        assert np.array_equal(wavecomb.render(stage, lanes=1, **plain).beauty, reference)
