# SPDX-License-Identifier: Apache-2.0
"""Convert recorded volumes to Mitsuba media, each in an invisible box.

Mitsuba has no overlapping and no emissive media. Colour grids of volumes are not converted; only
tests of Wavecomb use them.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from recorded import Recorded, dense

Matrix = NDArray[np.float64]


class Media:
    """The scene dictionary entries of volumes, and the medium that contains the camera."""

    def __init__(self, mi: ModuleType, recorded: Recorded) -> None:
        self._mi = mi
        self.entries: dict[str, Any] = {}
        self.of_camera: str | None = None
        at = recorded.camera["transform"][3] if recorded.camera else np.array([0, 0, 0, 1.0])
        for k, volume in enumerate(recorded.volumes):
            if volume.get("color") is not None or any(volume.get("emission", (0.0,))):
                raise NotImplementedError("volumes with emission or a colour grid")
            box, medium = self._medium(volume)
            self.entries[f"medium{k}"] = medium
            self.entries[f"volume{k}"] = {
                "type": "cube",
                "bsdf": {"type": "null"},
                "interior": {"type": "ref", "id": f"medium{k}"},
                "to_world": self._transform(_from_minus_one() @ box),
            }
            inside = at @ np.linalg.inv(box)
            if np.all((inside[:3] > 0.0) & (inside[:3] < 1.0)):
                self.of_camera = f"medium{k}"

    def _transform(self, rows: Matrix) -> Any:
        return self._mi.ScalarTransform4f(np.ascontiguousarray(rows.T))

    def _medium(self, volume: dict[str, Any]) -> tuple[Matrix, dict[str, Any]]:
        """Return the transform from the unit cube to a volume's box, and its medium."""
        extinction = np.asarray(volume["extinction"], np.float64)
        medium: dict[str, Any] = {
            "phase": {"type": "hg", "g": float(volume.get("anisotropy", 0.0))},
            "albedo": {"type": "rgb", "value": [float(v) for v in volume["albedo"]]},
        }
        if volume.get("density") is None:
            low, high = (np.array(end, np.float64) for end in volume["bounds"])
            box = np.diag([*(high - low), 1.0])
            box[3, :3] = low
            sigma = [float(v) for v in extinction]
            medium |= {"type": "homogeneous", "sigma_t": {"type": "rgb", "value": sigma}}
            return box @ volume["to_world"], medium
        values, box = dense(volume["density"])
        box = box @ volume["to_world"]
        scale = float(extinction.max())
        # Mitsuba's arrays are indexed z, y, x; a grid of one channel suffices if the extinction is
        # grey.
        grid = np.ascontiguousarray(values.T)[..., None]
        if np.ptp(extinction) > 0.0:
            grid = grid * (extinction / scale).astype(np.float32)
        medium |= {
            "type": "heterogeneous",
            "scale": scale,
            "sigma_t": {"type": "gridvolume", "grid": self._mi.VolumeGrid(grid), "raw": True,
                        "to_world": self._transform(box)},
        }  # fmt: skip
        return box, medium


def _from_minus_one() -> Matrix:
    """Transform from [-1, 1]^3 to the unit cube, for row vectors."""
    rows = np.diag([0.5, 0.5, 0.5, 1.0])
    rows[3, :3] = 0.5
    return rows
