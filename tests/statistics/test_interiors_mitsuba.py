# SPDX-License-Identifier: Apache-2.0
"""Tests media inside meshes against Mitsuba 3's `volpathmis`: images agree within noise."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from agreement import assert_agree, batches
from references import Reference

pytestmark = pytest.mark.slow

SIZE = 24
DEPTH = 100
SCATTERING, ABSORPTION = np.array([0.9, 0.6, 0.4]), np.array([0.1, 0.2, 0.5])
ANISOTROPY = 0.4


def cube() -> tuple[Any, Any]:
    """Corners and triangles of [-1, 1]^3."""
    corners = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = [t for f in faces for t in ([f[0], f[1], f[2]], [f[0], f[2], f[3]])]
    return np.array(corners, np.float32), np.array(triangles, np.uint32)


def stage(ior: float) -> Any:
    """A cube of a medium above a floor, under a uniform sky."""
    from recording import RecordingBuilder

    builder = RecordingBuilder()
    floor = builder.add_material("diffuse", base_color=(0.6, 0.5, 0.4))
    corners = np.array([[-6, -1.3, 6], [6, -1.3, 6], [6, -1.3, -6], [-6, -1.3, -6]], np.float32)
    quads = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    builder.add_to_group(0, builder.add_mesh(corners, quads, material=floor))
    builder.add_light("dome", np.eye(4), color=(0.8, 0.9, 1.0))
    camera = np.eye(4)
    camera[3, :3] = (0.2, 0.1, 4.5)
    builder.set_camera(camera, window=(-0.4, 0.4, -0.4, 0.4))
    native = builder.native
    medium = native.add_material(
        "openpbr",
        ior=ior,
        roughness=0.0,
        specular_color=(1, 1, 1),
        openpbr={
            "transmission_weight": 1.0,
            "transmission_depth": 1.0,
            "transmission_color": tuple(np.exp(-(SCATTERING + ABSORPTION))),
            "transmission_scatter": tuple(SCATTERING),
            "transmission_scatter_anisotropy": ANISOTROPY,
        },
    )
    native.add_to_group(0, native.add_mesh(*cube(), material=medium))
    return builder


@pytest.mark.parametrize("ior", [1.0, 1.4])
def test_media_in_meshes(mitsuba: ModuleType, beauty: Any, fewer: int, ior: float) -> None:
    """Media behind an index-matched boundary and behind a refracting one equal Mitsuba's."""
    from mitsuba_bridge import MitsubaScene, PeerSettings

    recorded = stage(ior)
    extinction = SCATTERING + ABSORPTION
    medium = {
        "type": "homogeneous",
        "sigma_t": {"type": "rgb", "value": [float(0.5 * x) for x in extinction]},
        "scale": 2.0,
        "albedo": {"type": "rgb", "value": [float(x) for x in SCATTERING / extinction]},
        "phase": {"type": "hg", "g": ANISOTROPY},
    }
    bound = {"type": "dielectric", "int_ior": ior, "ext_ior": 1.0} if ior != 1 else {"type": "null"}

    class WithMedium(MitsubaScene):
        """The stage with the cube added."""

        def _geometry(self) -> dict[str, Any]:
            return super()._geometry() | {
                "filled": {"type": "cube", "bsdf": bound, "interior": medium},
                "integrator": {"type": "volpathmis", "max_depth": DEPTH + 1, "rr_depth": 1000},
            }

    recorded.build()
    about = (bound, medium, Path(__file__).read_bytes())
    peer = Reference(mitsuba, recorded, PeerSettings(SIZE, SIZE, DEPTH), WithMedium, about)
    spp = 256 // fewer
    ours = batches(lambda seed: beauty(recorded.scene, SIZE, spp, seed=seed, max_depth=DEPTH), 10)
    theirs = batches(lambda seed: peer.render(spp, seed), 10, first_seed=1000)
    assert_agree(f"medium in a mesh of index {ior:g}", ours, theirs)
