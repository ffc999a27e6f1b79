# SPDX-License-Identifier: Apache-2.0
"""Whether emissive meshes light what is drawn, so that a stage without lights needs no dome."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.usd.geometry.mesh_arrays import MeshArrays
from wavecomb.usd.looks.material import MaterialTable
from wavecomb.usd.stage.group import Emitter, Group, placed_emitters

LEAST = 0.02
"""Irradiance on an object that counts as light, a hundredth of that of the default dome."""

MOST = 2048
"""Objects, and emitters, that are looked at."""


def emitter_of(shape: MeshArrays, material: int, faces: NDArray[np.uint32] | None) -> Emitter:
    """The emitter that a mesh is; ``faces``: the material of each triangle where they differ."""
    positions = shape.positions.reshape(-1, *shape.positions.shape[-2:])[0].astype(np.float64)
    a, b, c = (positions[shape.triangles[:, corner]] for corner in range(3))
    areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    centre = np.asarray(shape.bounds, np.float64).mean(axis=0)
    if faces is None:
        return Emitter(centre, {material: float(areas.sum())})
    used = np.unique(faces)
    return Emitter(centre, {int(one): float(areas[faces == one].sum()) for one in used})


def light_what_is_drawn(world: Group, materials: MaterialTable) -> bool:
    """Whether half of the objects get as much light as ``LEAST`` from emitters, one for each box.

    The light of an emitter counts as that of a point in its middle, at the distance of an object's
    middle and no nearer than its size. Shadows and bounces are left out. Neither the camera nor
    the frame's samples matter, so that frames of a shot and tasks of a farm decide alike.
    """
    boxes = np.array(world.shown[:MOST], np.float64)
    powers, centres = _placed_powers(world, materials)
    if len(boxes) == 0 or len(powers) == 0:
        return False
    middles = boxes.mean(axis=1)
    sizes = 0.5 * np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1)
    apart = np.linalg.norm(middles[:, None] - centres[None], axis=2)
    distances = np.maximum(np.maximum(apart, sizes[:, None]), 1e-30)
    irradiance = (powers / (4.0 * math.pi * distances * distances)).sum(axis=1)
    return bool((irradiance >= LEAST).mean() >= 0.5)


def _placed_powers(
    world: Group, materials: MaterialTable
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Power of each emitter and its centre (n, 3) in the world."""
    powers: list[float] = []
    centres: list[Any] = []
    for emitter, place in placed_emitters(world, MOST):
        radiance_area = sum(
            materials.mean_emission(material) * area for material, area in emitter.areas.items()
        )
        matrix = place.middle
        scale = abs(float(np.linalg.det(matrix[:3, :3]))) ** (2.0 / 3.0)
        powers.append(math.pi * radiance_area * scale)
        centres.append(emitter.centre @ matrix[:3, :3] + matrix[3, :3])
    return np.array(powers, np.float64), np.array(centres, np.float64).reshape(-1, 3)
