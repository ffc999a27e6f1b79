# SPDX-License-Identifier: Apache-2.0
"""Converts primvars that materials read to mesh attributes of the core."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.usd.geometry.curves import CurveArrays
from wavecomb.usd.geometry.mesh_arrays import MeshArrays
from wavecomb.usd.geometry.primvar import Primvar, PrimvarError, fitting, spread

MAX_WIDTH = 4
"""Maximum number of components of a mesh attribute."""

Attributes = dict[str, tuple[str, NDArray[np.float32]]]
"""Mesh attributes for ``SceneBuilder.add_mesh``: (rate, values (k, c)) by name."""


@dataclass(frozen=True)
class PrimvarRequest:
    """A primvar that a material reads and whose values fit the mesh.

    Attributes:
        primvar: The primvar, whose values are finite.
        width: Number of components that the material reads.
    """

    primvar: Primvar
    width: int

    @property
    def is_constant(self) -> bool:
        """Whether all values of the primvar are equal."""
        values = self.primvar.values[:, : self.width]
        return len(values) == 1 or bool((values == values[0]).all())

    @property
    def first(self) -> NDArray[np.float32]:
        """(width,) first value of the primvar."""
        return self.primvar.values[0, : self.width]

    @property
    def mean(self) -> NDArray[np.float64]:
        """(width,) mean of all values of the primvar."""
        return np.asarray(self.primvar.values[:, : self.width].mean(axis=0, dtype=np.float64))

    @property
    def highest(self) -> float:
        """Largest component of all values of the primvar."""
        return float(self.primvar.values[:, : self.width].max())


def check_fit(primvar: Primvar, mesh: MeshArrays | CurveArrays, width: int) -> None:
    """Checks whether a primvar fits a gprim.

    Raises:
        PrimvarError: The number of values or of components does not match the gprim.
    """
    if isinstance(mesh, CurveArrays):
        mesh.topology.fit(primvar, width)
    elif mesh.topology is not None:
        fitting(primvar, mesh.topology, width)
    elif primvar.values.shape[1] < width:
        raise PrimvarError(f"primvar {primvar.name!r} has too few components")


def on_shape(
    wanted: Mapping[str, PrimvarRequest], mesh: MeshArrays | CurveArrays, mirrored: bool
) -> Attributes:
    """Converts primvars to attributes of triangles, curve segments or points.

    ``mirrored`` means that the triangles of the mesh and of its topology have opposite winding.
    """
    return {name: _on_shape(one, mesh, mirrored) for name, one in wanted.items()}


def _on_shape(
    wanted: PrimvarRequest, mesh: MeshArrays | CurveArrays, mirrored: bool
) -> tuple[str, NDArray[np.float32]]:
    primvar, width = wanted.primvar, wanted.width
    if wanted.is_constant or mesh.topology is None:
        return "constant", _packed(primvar.values[:1], width)
    if isinstance(mesh, CurveArrays):
        values, kind = mesh.topology.fit(primvar, width)
        first, last = mesh.topology.ends(values, kind)
        if mesh.segments is None or kind == "uniform":
            return "primitive", _packed(first, width)
        return "end", _packed(np.stack([first, last], axis=1), width)
    if primvar.interpolation == "uniform":
        values = fitting(primvar, mesh.topology, width)
        return "primitive", _packed(values[mesh.topology.face_ids()], width)
    values, rate = spread(primvar, mesh.topology, width)
    if rate == "corner" and mirrored:
        values = values[:, ::-1]
    return rate, _packed(values, width)


class RefinedAttributes:
    """Primvars of a subdivision cage, evaluated for the triangles of the subdivided mesh."""

    def __init__(self, wanted: Mapping[str, PrimvarRequest]) -> None:
        self._wanted = wanted
        self._refined = [
            name
            for name, one in wanted.items()
            if not one.is_constant and one.primvar.interpolation != "uniform"
        ]

    def described(self, cage: Any, level: int) -> list[dict[str, Any]]:
        """Returns the primvars to subdivide, as descriptions for ``SceneBuilder.make_surfaces``."""
        chosen = [self._wanted[name] for name in self._refined]
        if level > 0:
            return [cage.primvar(one.primvar, one.width) for one in chosen]
        out = []
        for one in chosen:
            values, at = spread(one.primvar, cage.topology, one.width)
            kind = "vertex" if at == "vertex" else "faceVarying"
            packed = _packed(values, one.width)
            out.append({"interpolation": kind, "values": packed, "width": one.width})
        return out

    def of(self, refined: Mapping[str, Any]) -> Attributes:
        """Returns the attributes of a mesh that ``SceneBuilder.make_surfaces`` subdivided."""
        out: Attributes = dict(zip(self._refined, refined["primvars"], strict=True))
        for name, one in self._wanted.items():
            if name in out:
                continue
            values = one.primvar.values
            if one.is_constant:
                out[name] = "constant", _packed(values[:1], one.width)
            else:
                out[name] = "primitive", _packed(values[refined["faces"]], one.width)
        return out


def _packed(values: NDArray[Any], width: int) -> NDArray[np.float32]:
    """Returns values as a contiguous float32 array, (k, width)."""
    cut = np.asarray(values)[..., :width]
    return np.ascontiguousarray(cut.reshape(-1, width), np.float32)
