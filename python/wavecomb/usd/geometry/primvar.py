# SPDX-License-Identifier: Apache-2.0
"""Reads primvars of every interpolation as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, Vt

from wavecomb.usd.geometry.triangulate import Topology
from wavecomb.usd.materials.colour_space import colours_in_linear
from wavecomb.usd.materials.network import holds_colour, space_of
from wavecomb.usd.stage.report import LoadReport


class PrimvarError(ValueError):
    """Raised if a primvar does not fit its mesh; the message gives the reason."""


@dataclass(frozen=True)
class Primvar:
    """Values of a primvar.

    Attributes:
        values: (k, c) values after applying the indices.
        interpolation: "constant", "uniform", "varying", "vertex" or "faceVarying".
        name: Authored name.
        index: (k,) authored index of each value; None if no indices are authored.
        space: Colour space of colour values; an empty string means linear Rec.709.
    """

    values: NDArray[Any]
    interpolation: str
    name: str
    index: NDArray[np.int32] | None = None
    space: str = ""


def as_array(value: Any) -> NDArray[Any] | None:
    """Returns a VtArray, vector or number as an array (k, c), without a copy if possible."""
    if value is None:
        return None
    # Handle Vec3fArray first, since the points of nearly all meshes have this type.
    if type(value) is Vt.Vec3fArray:
        return np.asarray(value)
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):
        return None
    if array.dtype.kind not in "fiub":
        return None
    if array.ndim == 0:
        return array.reshape(1, 1)
    if array.ndim == 1:
        is_list = getattr(type(value), "_isVtArray", False)
        return array.reshape(-1, 1) if is_list else array.reshape(1, -1)
    return array if array.ndim == 2 else None


def as_integers(value: Any, dtype: Any = np.int32) -> NDArray[Any]:
    """Returns a value as integers (k,); an empty array if the value does not hold integers."""
    if type(value) is Vt.IntArray and dtype is np.int32:
        return np.asarray(value)
    array = as_array(value)
    if array is None or array.dtype.kind not in "iu":
        return np.empty(0, dtype)
    return np.ascontiguousarray(array[:, 0], dtype)


def authored_names(prim: Usd.Prim) -> frozenset[str]:
    """Returns the names of authored properties, which takes as long as querying one attribute."""
    return frozenset(prim.GetAuthoredPropertyNames())


def from_attribute(attribute: Usd.Attribute, name: str, time: Usd.TimeCode) -> Primvar | None:
    """Reads a primvar and applies its indices; returns None if the primvar has no value.

    Raises:
        PrimvarError: Indices are out of range.
    """
    values = as_array(attribute.Get(time))
    if values is None:
        return None
    interpolation = attribute.GetMetadata("interpolation") or "constant"
    kept: NDArray[np.int32] | None = None
    companion = attribute.GetPrim().GetAttribute(attribute.GetName() + ":indices")
    if companion and companion.HasAuthoredValue():
        index = np.asarray(companion.Get(time))
        if index.ndim == 1 and index.dtype.kind in "iu":
            if len(index) and (index.min() < 0 or index.max() >= len(values)):
                raise PrimvarError(f"indices of primvar {name!r} are out of range")
            values, kept = values[index], np.ascontiguousarray(index, np.int32)
    space = space_of(attribute) if holds_colour(attribute) else ""
    return Primvar(values, interpolation, name, kept, space)


def in_linear(primvar: Primvar, report: LoadReport, place: object) -> Primvar:
    """Converts colours of a primvar to linear Rec.709; reports an unknown colour space."""
    if not primvar.space or primvar.values.shape[1] < 3:
        return primvar
    try:
        values = colours_in_linear(primvar.values, primvar.space)
    except ValueError as error:
        report.missing(f"{error} of primvar {primvar.name!r} (read as linear)", place)
        values = primvar.values
    return replace(primvar, values=values, space="")


def read_primvar(prim: Usd.Prim, name: str, time: Usd.TimeCode) -> Primvar | None:
    """Returns the primvar ``name`` that is authored on the prim itself, or None."""
    attribute = prim.GetAttribute("primvars:" + name)
    return from_attribute(attribute, name, time) if attribute.HasAuthoredValue() else None


def find_primvar(
    prim: Usd.Prim, name: str, inherited: Sequence[Any], time: Usd.TimeCode
) -> Primvar | None:
    """Returns a primvar of a prim, or else the constant primvar that the prim inherits."""
    own = read_primvar(prim, name, time)
    if own is not None or not inherited:
        return own
    for primvar in inherited:
        if primvar.GetPrimvarName() == name:
            return from_attribute(primvar.GetAttr(), name, time)
    return None


def first_primvar(
    prim: Usd.Prim, names: Sequence[str], inherited: Sequence[Any], time: Usd.TimeCode
) -> Primvar | None:
    """Returns the first of the named primvars that exists on a prim or that the prim inherits."""
    found = (find_primvar(prim, name, inherited, time) for name in names)
    return next((primvar for primvar in found if primvar is not None), None)


def plain_attribute(prim: Usd.Prim, name: str, time: Usd.TimeCode) -> Primvar | None:
    """Reads an attribute as a primvar with vertex interpolation; None if it has no values."""
    attribute = prim.GetAttribute(name)
    values = as_array(attribute.Get(time)) if attribute.HasAuthoredValue() else None
    if values is None or len(values) == 0:
        return None
    return Primvar(values, attribute.GetMetadata("interpolation") or "vertex", name)


def finite_uvs(uvs: NDArray[Any], report: LoadReport, place: object) -> NDArray[Any]:
    """Returns texture coordinates; sets values that are not finite to 0 and reports them."""
    if np.isfinite(uvs).all():
        return uvs
    report.warn("texture coordinates that are not finite: set to 0", place)
    return np.nan_to_num(uvs, nan=0.0, posinf=0.0, neginf=0.0)


def fitting(primvar: Primvar, topology: Topology, width: int) -> NDArray[np.float32]:
    """Returns the first ``width`` components (k, width) of a primvar that fits a mesh.

    Raises:
        PrimvarError: The number of values or of components does not match the mesh.
    """
    values, kind = primvar.values, primvar.interpolation
    if values.shape[1] < width:
        raise PrimvarError(f"primvar {primvar.name!r} has too few components")
    values = np.ascontiguousarray(values[:, :width], np.float32)
    wanted = {
        "constant": 1,
        "uniform": topology.face_count,
        "varying": topology.point_count,
        "vertex": topology.point_count,
        "faceVarying": len(topology.indices),
    }.get(kind)
    if wanted is None:
        raise PrimvarError(f"primvar {primvar.name!r} has unknown interpolation {kind!r}")
    if len(values) != wanted:
        raise PrimvarError(
            f"primvar {primvar.name!r} ({kind}) has the wrong number of values, {len(values):,} "
            f"where the mesh needs {wanted:,}"
        )
    return values


def spread(primvar: Primvar, topology: Topology, width: int) -> tuple[NDArray[np.float32], str]:
    """Maps a primvar to triangles.

    Returns an array (n, c) and "vertex", (m, 3, c) and "corner", or (1, c) and "constant".

    Args:
        primvar: The primvar.
        topology: Topology of the primvar's mesh.
        width: Number of components c to return.

    Raises:
        PrimvarError: The number of values or of components does not match the mesh.
    """
    values, kind = fitting(primvar, topology, width), primvar.interpolation
    if kind == "constant":
        return values, "constant"
    if kind in ("vertex", "varying"):
        return values, "vertex"
    if kind == "uniform":
        per_face = values[topology.face_ids()]
        return np.repeat(per_face[:, None], 3, axis=1), "corner"
    welded = _weld(values, topology)
    if welded is not None:
        return welded, "vertex"
    if topology.corners is None:
        return values.reshape(-1, 3, width), "corner"
    return np.ascontiguousarray(values[topology.corners]), "corner"


def _weld(values: NDArray[np.float32], topology: Topology) -> NDArray[np.float32] | None:
    """Converts values with face-varying interpolation to one value per point.

    Returns None if a point has different values at its corners.
    """
    indices = topology.indices
    probe = slice(0, 64)
    per_point = np.zeros((topology.point_count, values.shape[1]), np.float32)
    per_point[indices[probe]] = values[probe]
    if not np.array_equal(per_point[indices[probe]], values[probe]):
        return None
    per_point[indices] = values
    return per_point if np.array_equal(per_point[indices], values) else None
