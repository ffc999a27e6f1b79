# SPDX-License-Identifier: Apache-2.0
"""Objects of several meshes with different materials, and instances of such objects."""

from __future__ import annotations

from collections.abc import Sequence

from pxr import Gf, UsdGeom

from wavecomb.scenes.authoring.stage import StageWriter
from wavecomb.scenes.models.mesh import Mesh, merge

Part = tuple[Mesh, str]
"""A mesh and the name of its material."""


def add_object(
    writer: StageWriter,
    path: str,
    parts: Sequence[Part],
    position: Sequence[float] = (0.0, 0.0, 0.0),
    turn_degrees: float = 0.0,
) -> None:
    """Adds an Xform, rotated about Y, with one mesh for each material of its parts."""
    _place(UsdGeom.Xform.Define(writer.stage, path), position, turn_degrees)
    _fill(writer, path, parts)


def add_prototype(writer: StageWriter, name: str, parts: Sequence[Part]) -> str:
    """Adds a class prim with one mesh for each material; returns its path for ``add_instance``."""
    path = f"/_Prototype_{name}"
    writer.stage.CreateClassPrim(path).SetTypeName("Xform")
    _fill(writer, path, parts)
    return path


def add_instance(
    writer: StageWriter,
    path: str,
    prototype: str,
    position: Sequence[float],
    turn_degrees: float = 0.0,
) -> None:
    """Adds a native instance of a prototype from ``add_prototype``."""
    xform = UsdGeom.Xform.Define(writer.stage, path)
    _place(xform, position, turn_degrees)
    xform.GetPrim().GetReferences().AddInternalReference(prototype)
    xform.GetPrim().SetInstanceable(True)


def _place(xform: UsdGeom.Xform, position: Sequence[float], turn_degrees: float) -> None:
    xform.AddTranslateOp().Set(Gf.Vec3d(*(float(v) for v in position)))
    xform.AddRotateYOp().Set(float(turn_degrees))


def _fill(writer: StageWriter, path: str, parts: Sequence[Part]) -> None:
    meshes: dict[str, list[Mesh]] = {}
    for mesh, material in parts:
        meshes.setdefault(material, []).append(mesh)
    for material, some in meshes.items():
        writer.mesh(f"{path}/{material}", merge(some), material)
