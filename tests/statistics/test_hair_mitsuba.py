# SPDX-License-Identifier: Apache-2.0
"""Tests hair against Mitsuba 3's `hair`: a fibre, a bundle and a head agree within noise.

A fibre and a bundle are straight and end outside the image, because the two renderers model fibre
ends differently. The hairs of the head end inside the image and taper to a tenth of their radius;
round ends of full width would change the image by 0.15 %.
"""

from __future__ import annotations

import math
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from agreement import assert_agree, batches
from references import Reference

from wavecomb.scenes.hair import HEAD_LEVEL, hair_strands, head_mesh
from wavecomb.usd.geometry.strands import lay_out

pytestmark = pytest.mark.slow

SIZE = 32
ABSORPTION = (0.06, 0.2, 0.6)
TILT = 3.0


def colour(absorption: float, azimuthal: float) -> float:
    """Colour of hair with a given absorption (Chiang et al. 2016, eq. 9)."""
    a = azimuthal
    divisor = 5.969 - 0.215 * a + 2.532 * a**2 - 10.73 * a**3 + 5.574 * a**4 + 0.245 * a**5
    return math.exp(-math.sqrt(absorption) * divisor)


def fibres(kind: str) -> tuple[Any, Any]:
    """Control points of cubic B-splines, (n, k, 3), and the radius at each point of a spline."""
    points, radius = splines(kind)
    radii = np.full(points.shape[1], radius)
    if kind == "head":
        radii[-4:] *= (0.55, 0.1, 0.1, 0.1)
    return points, radii


def splines(kind: str) -> tuple[Any, float]:
    """Control points of the splines, (n, k, 3), and the fibre radius."""
    if kind == "fibre":
        return line(np.array([[-3.0, -2.0, 0.4]]), np.array([[3.0, 2.0, -0.4]])), 0.07
    if kind == "head":
        return hair_strands(np.random.default_rng(5), 1500).astype(np.float64), 0.006
    rng = np.random.default_rng(3)
    middle = rng.uniform(-0.16, 0.16, (24, 3))
    along = np.array([0.5, 1.0, 0.1]) + rng.normal(scale=0.25, size=(24, 3))
    along *= 2.5 / np.linalg.norm(along, axis=1, keepdims=True)
    return line(middle - along, middle + along), 0.03


def line(a: Any, b: Any) -> Any:
    """Evenly spaced points on lines from a to b, extended at both ends."""
    return a[:, None] + (b - a)[:, None] * np.linspace(-0.5, 1.5, 6)[None, :, None]


def stage(kind: str, roughness: tuple[float, float]) -> Any:
    """Fibres between a front and a back light under a dim sky; for the kind "head", on a ball."""
    from recording import RecordingBuilder

    builder = RecordingBuilder()
    native = builder.native
    # A small hidden floor: recorded meshes come before the fibres, which are not recorded.
    grey = builder.add_material("diffuse", base_color=(0.6, 0.5, 0.4))
    corners = np.array([[-2, -3, 2], [2, -3, 2], [2, -3, -2], [-2, -3, -2]], np.float32)
    quads = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    builder.add_to_group(0, builder.add_mesh(corners, quads, material=grey))
    if kind == "head":
        skin = builder.add_material("diffuse", base_color=(0.7, 0.5, 0.4))
        head = head_mesh(HEAD_LEVEL)
        shape = builder.add_mesh(
            head.points, head.faces.astype(np.uint32), normals=head.normals, material=skin
        )
        builder.add_to_group(0, shape)
    hair = native.add_material(
        "hair",
        base_color=tuple(colour(a, roughness[1]) for a in ABSORPTION),
        roughness=roughness[0],
        azimuthal_roughness=roughness[1],
        cuticle_tilt=TILT,
        ior=1.55,
    )
    points, radii = fibres(kind)
    layout = lay_out(np.full(len(points), points.shape[1]), "bspline", "nonperiodic")
    controls = layout.controls(points.reshape(-1, 3), "vertex")
    widths = layout.controls(np.tile(radii, len(points))[:, None], "vertex")
    curves = native.add_curves(
        "cubic-tube", controls, layout.segment_words(), np.float32(widths[:, 0]), material=hair
    )
    native.add_to_group(0, curves)
    for x, z, turn in ((1.6, 3.0, 0.0), (-1.9, -3.0, math.pi)):
        lamp = np.diag([math.cos(turn), 1.0, math.cos(turn), 1.0])
        lamp[3, :3] = (x, 0.6, z)
        builder.add_light("rect", lamp, width=1.0, height=1.0, color=(9.0, 8.0, 7.0))
    builder.add_light("dome", np.eye(4), color=(0.2, 0.25, 0.3))
    camera = np.eye(4)
    wide = 0.4 if kind == "head" else 0.05
    camera[3, :3] = (0.0, -0.3 if kind == "head" else 0.0, 4.5)
    builder.set_camera(camera, window=(-wide, wide, -wide, wide))
    return builder


@pytest.mark.parametrize(
    ("kind", "roughness", "depth"),
    [
        ("fibre", (0.3, 0.3), 1),
        ("fibre", (0.15, 0.5), 4),
        ("bundle", (0.3, 0.3), 4),
        ("head", (0.25, 0.3), 4),
    ],
)
def test_hair(
    mitsuba: ModuleType,
    beauty: Any,
    fewer: int,
    tmp_path: Path,
    kind: str,
    roughness: tuple[float, float],
    depth: int,
) -> None:
    """Compares a smooth fibre, a rough fibre, and fibres on a head."""
    from mitsuba_bridge import MitsubaScene, PeerSettings

    points, radii = fibres(kind)
    file = tmp_path / "fibres.txt"
    rows = [
        "\n".join(f"{x} {y} {z} {r}" for (x, y, z), r in zip(strand, radii, strict=True))
        for strand in points
    ]
    text = "\n\n".join(rows) + "\n"
    file.write_text(text)

    class WithFibres(MitsubaScene):
        """The stage with the fibres added."""

        def _geometry(self) -> dict[str, Any]:
            bsdf = {
                "type": "hair",
                "longitudinal_roughness": roughness[0],
                "azimuthal_roughness": roughness[1],
                "scale_tilt": TILT,
                "int_ior": 1.55,
                "ext_ior": 1.0,
                "sigma_a": {"type": "rgb", "value": list(ABSORPTION)},
            }
            shape = {"type": "bsplinecurve", "filename": str(file), "bsdf": bsdf}
            return super()._geometry() | {"fibres": shape}

    recorded = stage(kind, roughness)
    recorded.build()
    about = (text, roughness, Path(__file__).read_bytes())
    peer = Reference(mitsuba, recorded, PeerSettings(SIZE, SIZE, depth), WithFibres, about)
    spp = (256 if kind == "fibre" else 128) // fewer
    ours = batches(lambda seed: beauty(recorded.scene, SIZE, spp, seed=seed, max_depth=depth), 10)
    theirs = batches(lambda seed: peer.render(spp, seed), 10, first_seed=1000)
    assert_agree(f"hair {kind} {roughness[0]} {depth}", ours, theirs)
