# SPDX-License-Identifier: Apache-2.0
"""Captures as Gaussian splats in PLY files, as 3DGS writes them, and prims of splats."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Vt

from wavecomb.scenes.errors import SceneError
from wavecomb.scenes.mesh import FloatArray
from wavecomb.scenes.ply import ply_vertices
from wavecomb.scenes.stage import StageWriter

_COUNTS = {0: 0, 9: 1, 24: 2, 45: 3}
"""Degree by how many coefficients there are beside the first."""


@dataclass
class Splats:
    """Gaussian splats, as UsdVol has them.

    Attributes:
        positions: (n, 3).
        scales: (n, 3), lengths.
        orientations: (n, 4) quaternions w, x, y, z.
        opacities: (n,) from 0 to 1.
        harmonics: (n, k, 3) of the colour less 0.5.
    """

    positions: FloatArray
    scales: FloatArray
    orientations: FloatArray
    opacities: FloatArray
    harmonics: FloatArray


def read_capture(path: Path) -> Splats:
    """Reads what 3DGS and its kin write.

    Columns x, y, z, scale_* (logarithms), rot_*, opacity (a logit), f_dc_*, f_rest_* (by channel).

    Raises:
        SceneError: The file is something else.
    """
    try:
        columns = ply_vertices(path.read_bytes())
    except (OSError, ValueError, KeyError, IndexError) as error:
        raise SceneError(f"{path}: not a capture of Gaussian splats: {error}") from error
    rest = sum(name.startswith("f_rest_") for name in columns)
    names = [
        "x", "y", "z", "opacity", *(f"scale_{k}" for k in range(3)),
        *(f"rot_{k}" for k in range(4)), *(f"f_dc_{k}" for k in range(3)),
        *(f"f_rest_{k}" for k in range(rest)),
    ]  # fmt: skip
    missing = [name for name in names if name not in columns]
    if missing or rest not in _COUNTS:
        what = (
            f"no {missing[0]}" if missing else f"{rest} values f_rest_*; 0, 9, 24 or 45 are known"
        )
        raise SceneError(f"{path}: not a capture of Gaussian splats: {what}")

    def table(prefix: str, count: int) -> FloatArray:
        return np.stack([columns[f"{prefix}{k}"] for k in range(count)], axis=1)

    n = len(columns["x"])
    first = table("f_dc_", 3)[:, None]
    if rest:
        others = table("f_rest_", rest).reshape(n, 3, rest // 3).transpose(0, 2, 1)
        first = np.concatenate([first, others], axis=1)
    with np.errstate(over="ignore"):
        opacities = 1.0 / (1.0 + np.exp(-columns["opacity"]))
        scales = np.exp(table("scale_", 3))
    positions = np.stack([columns[axis] for axis in "xyz"], axis=1)
    return Splats(positions, scales, table("rot_", 4), opacities, first)


def add_splats(writer: StageWriter, path: str, splats: Splats) -> None:
    """Adds a prim of splats to a stage."""
    prim = writer.stage.DefinePrim(path, "ParticleField3DGaussianSplat")

    def put(name: str, kind: Any, values: FloatArray) -> None:
        prim.GetAttribute(name).Set(kind.FromNumpy(np.ascontiguousarray(values, np.float32)))

    put("positions", Vt.Vec3fArray, splats.positions)
    put("scales", Vt.Vec3fArray, splats.scales)
    # In memory the real part of a quaternion comes last.
    put("orientations", Vt.QuatfArray, splats.orientations[:, [1, 2, 3, 0]])
    put("opacities", Vt.FloatArray, splats.opacities)
    degree = round(splats.harmonics.shape[1] ** 0.5) - 1
    prim.GetAttribute("radiance:sphericalHarmonicsDegree").Set(degree)
    put(
        "radiance:sphericalHarmonicsCoefficients",
        Vt.Vec3fArray,
        splats.harmonics.reshape(-1, 3),
    )
    reach = 3.0 * splats.scales.max(1, keepdims=True)
    low, high = (splats.positions - reach).min(0), (splats.positions + reach).max(0)
    prim.GetAttribute("extent").Set([Gf.Vec3f(*map(float, end)) for end in (low, high)])
