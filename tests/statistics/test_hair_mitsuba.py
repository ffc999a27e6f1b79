# SPDX-License-Identifier: Apache-2.0
"""Hair against Mitsuba 3's `hair`: pictures of a fibre and of a bundle agree to within noise.

Fibres are straight and end outside of the picture: ends differ by design.
"""

from __future__ import annotations

import math
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from agreement import assert_agree, batches

pytestmark = pytest.mark.slow

SIZE = 32
ABSORPTION = (0.06, 0.2, 0.6)
TILT = 3.0


def colour(absorption: float, azimuthal: float) -> float:
    """The colour whose absorption it is (Chiang et al. 2016, eq. 9)."""
    a = azimuthal
    divisor = 5.969 - 0.215 * a + 2.532 * a**2 - 10.73 * a**3 + 5.574 * a**4 + 0.245 * a**5
    return math.exp(-math.sqrt(absorption) * divisor)


def fibres(kind: str) -> tuple[Any, float]:
    """Both ends of each, (n, 2, 3), and their radius."""
    if kind == "fibre":
        return np.array([[[-3.0, -2.0, 0.4], [3.0, 2.0, -0.4]]], np.float32), 0.07
    rng = np.random.default_rng(3)
    middle = rng.uniform(-0.16, 0.16, (24, 3))
    along = np.array([0.5, 1.0, 0.1]) + rng.normal(scale=0.25, size=(24, 3))
    along *= 2.5 / np.linalg.norm(along, axis=1, keepdims=True)
    return np.stack([middle - along, middle + along], axis=1).astype(np.float32), 0.03


def stage(ends: Any, radius: float, roughness: tuple[float, float]) -> Any:
    """Fibres between a lamp in front and one behind, under a dim sky."""
    from recording import RecordingBuilder

    builder = RecordingBuilder()
    native = builder.native
    # A small floor out of sight; what is recorded comes before what is not.
    grey = builder.add_material("diffuse", base_color=(0.6, 0.5, 0.4))
    corners = np.array([[-2, -3, 2], [2, -3, 2], [2, -3, -2], [-2, -3, -2]], np.float32)
    quads = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    builder.add_to_group(0, builder.add_mesh(corners, quads, material=grey))
    hair = native.add_material(
        "hair",
        base_color=tuple(colour(a, roughness[1]) for a in ABSORPTION),
        roughness=roughness[0],
        azimuthal_roughness=roughness[1],
        cuticle_tilt=TILT,
        ior=1.55,
    )
    points = np.ascontiguousarray(ends.reshape(-1, 3))
    curves = native.add_curves(
        "linear-tube",
        points,
        np.arange(0, len(points), 2, dtype=np.uint32),
        np.full(len(points), radius, np.float32),
        material=hair,
    )
    native.add_to_group(0, curves)
    for x, z, turn in ((1.6, 3.0, 0.0), (-1.9, -3.0, math.pi)):
        lamp = np.diag([math.cos(turn), 1.0, math.cos(turn), 1.0])
        lamp[3, :3] = (x, 0.6, z)
        builder.add_light("rect", lamp, width=1.0, height=1.0, color=(9.0, 8.0, 7.0))
    builder.add_light("dome", np.eye(4), color=(0.2, 0.25, 0.3))
    camera = np.eye(4)
    camera[3, :3] = (0.0, 0.0, 4.5)
    builder.set_camera(camera, window=(-0.05, 0.05, -0.05, 0.05))
    return builder


@pytest.mark.parametrize(
    ("kind", "roughness", "depth"),
    [("fibre", (0.3, 0.3), 1), ("fibre", (0.15, 0.5), 4), ("bundle", (0.3, 0.3), 4)],
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
    """A fibre alone, smooth and rough; and light that goes from fibre to fibre."""
    from mitsuba_bridge import MitsubaScene, PeerSettings

    ends, radius = fibres(kind)
    file = tmp_path / "fibres.txt"
    # A B-spline through evenly spaced points of a line: Mitsuba's linear curves have no tangents.
    lines = [a + (b - a) * np.linspace(-0.5, 1.5, 6)[:, None] for a, b in ends.astype(float)]
    rows = ["\n".join(f"{x} {y} {z} {radius}" for x, y, z in line) for line in lines]
    file.write_text("\n\n".join(rows) + "\n")

    class WithFibres(MitsubaScene):
        """The stage with the fibres."""

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

    recorded = stage(ends, radius, roughness)
    recorded.build()
    peer = WithFibres(mitsuba, recorded, PeerSettings(SIZE, SIZE, depth))
    spp = (256 if kind == "fibre" else 128) // fewer
    ours = batches(lambda seed: beauty(recorded.scene, SIZE, spp, seed=seed, max_depth=depth), 10)
    theirs = batches(lambda seed: peer.render(spp, seed), 10, first_seed=1000)
    assert_agree(f"hair {kind} {roughness[0]} {depth}", ours, theirs)
