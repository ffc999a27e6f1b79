# SPDX-License-Identifier: Apache-2.0
"""Tests volumes against Mitsuba 3's `volpathmis`: images agree within noise."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
import pytest
from agreement import assert_agree, batches
from voxels import bricks

pytestmark = pytest.mark.slow

VOXELS = 16
SIZE = 32
DEPTH = 12


def smoke() -> Any:
    """Densities of a lumpy ball; 0 at the edge of the grid, since Mitsuba's grids end there."""
    rng = np.random.default_rng(4)
    at = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, VOXELS)] * 3, indexing="ij"), axis=-1)
    ball = np.linalg.norm(at, axis=-1) < 0.85
    return np.where(ball, rng.random((VOXELS,) * 3), 0.0).astype(np.float32)


def tints() -> Any:
    """Albedos that vary along x, y and z."""
    ramp = np.linspace(0.3, 0.95, VOXELS, dtype=np.float32)
    return np.stack(np.meshgrid(ramp, ramp, ramp, indexing="ij"), axis=-1)


def in_cube(voxels: Any) -> Any:
    """A grid whose voxels are the centres of equal cells of [-1, 1]^3."""
    from wavecomb import _core

    step = 2.0 / VOXELS
    place = np.diag([step, step, step, 1.0])
    place[3, :3] = -1.0 + 0.5 * step
    return _core.VolumeGrid(*bricks(voxels), place)


def stage() -> Any:
    """A grey floor below the cube, an emissive block beside it, a dim sky; no volume yet."""
    from recording import RecordingBuilder

    builder = RecordingBuilder()
    floor = builder.add_material("diffuse", base_color=(0.6, 0.5, 0.4))
    lamp = builder.add_material("emissive", emission=(9.0, 7.0, 5.0))
    corners = np.array([[-6, -1.3, 6], [6, -1.3, 6], [6, -1.3, -6], [-6, -1.3, -6]], np.float32)
    quads = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    builder.add_to_group(0, builder.add_mesh(corners, quads, material=floor))
    cube = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32)
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = [t for f in faces for t in ([f[0], f[1], f[2]], [f[0], f[2], f[3]])]
    block = cube * 0.8 + np.array([1.3, 0.6, 0.4], np.float32)
    number = builder.add_mesh(block, np.array(triangles, np.uint32), material=lamp)
    builder.add_to_group(0, number)
    builder.add_light("dome", np.eye(4), color=(0.2, 0.3, 0.4))
    camera = np.eye(4)
    camera[3, :3] = (0.2, 0.1, 4.5)
    builder.set_camera(camera, window=(-0.4, 0.4, -0.4, 0.4))
    return builder


@pytest.mark.parametrize("kind", ["even", "grid"])
def test_volumes(mitsuba: ModuleType, beauty: Any, fewer: int, kind: str) -> None:
    """A homogeneous box with extinction by channel, and a grid of densities and albedos."""
    from mitsuba_bridge import MitsubaScene, PeerSettings

    mi = mitsuba
    recorded = stage()
    if kind == "even":
        extinction, g = (0.4, 1.0, 2.0), 0.5
        recorded.native.add_volume(
            np.eye(4), bounds=((-1, -1, -1), (1, 1, 1)), extinction=extinction,
            albedo=(0.9, 0.8, 0.5), anisotropy=g,
        )  # fmt: skip
        medium: dict[str, Any] = {
            "type": "homogeneous",
            "sigma_t": {"type": "rgb", "value": [0.5 * x for x in extinction]},
            "scale": 2.0,
            "albedo": {"type": "rgb", "value": [0.9, 0.8, 0.5]},
        }
    else:
        g = -0.4
        recorded.native.add_volume(
            np.eye(4), density=in_cube(smoke()), color=in_cube(tints()), extinction=(4, 4, 4),
            albedo=(1, 1, 1), anisotropy=g,
        )  # fmt: skip

        def gridvolume(voxels: Any) -> dict[str, Any]:
            # Mitsuba's arrays are indexed z, y, x over the unit cube.
            values = np.ascontiguousarray(np.swapaxes(voxels, 0, 2))
            if values.ndim == 3:
                values = values[..., None]
            place = mi.ScalarTransform4f().translate(-1.0).scale(2.0)
            return {"type": "gridvolume", "grid": mi.VolumeGrid(values), "to_world": place,
                    "raw": True}  # fmt: skip

        medium = {
            "type": "heterogeneous",
            "sigma_t": gridvolume(smoke()),
            "scale": 4.0,
            "albedo": gridvolume(tints()),
        }
    medium["phase"] = {"type": "hg", "g": g}

    class WithVolume(MitsubaScene):
        """The stage with the volume inside an invisible cube."""

        def _geometry(self) -> dict[str, Any]:
            return super()._geometry() | {
                "volume": {"type": "cube", "bsdf": {"type": "null"}, "interior": medium},
                "integrator": {"type": "volpathmis", "max_depth": DEPTH + 1, "rr_depth": 1000},
            }

    recorded.build()
    peer = WithVolume(mi, recorded, PeerSettings(SIZE, SIZE, DEPTH))
    spp = 256 // fewer
    ours = batches(lambda seed: beauty(recorded.scene, SIZE, spp, seed=seed, max_depth=DEPTH), 10)
    theirs = batches(lambda seed: peer.render(spp, seed), 10, first_seed=1000)
    assert_agree(f"volume {kind}", ours, theirs)
