# SPDX-License-Identifier: Apache-2.0
"""Edits of a prim's transform, stored in an additional transform operation of the prim.

Independent of Qt.
"""

from __future__ import annotations

from dataclasses import dataclass

from pxr import Gf, Sdf, Usd, UsdGeom, Vt

from wavecomb.gui.scene.stage_edits import Key, Opinion
from wavecomb.usd.lights.light import KINDS

OP = "xformOp:transform:edit"
"""Name of the transform operation that holds all edits. The operation is applied after the prim's
other operations."""
_RESET = "!resetXformStack!"


@dataclass(frozen=True)
class Placement:
    """The transform of a prim at the start of an edit.

    Attributes:
        path: Path of the prim.
        edit: Value of the transform operation ``OP``.
        parent: Transform from the parent's space to world space, applied after ``OP``.
        order: Names of the prim's transform operations.
    """

    path: Sdf.Path
    edit: Gf.Matrix4d
    parent: Gf.Matrix4d
    order: tuple[str, ...]

    def moved(self, change: Gf.Matrix4d) -> dict[Key, Opinion | None]:
        """Returns the opinions after a change by a matrix in world space.

        The matrix applies to row vectors.
        """
        value = self.edit * (self.parent * change * self.parent.GetInverse())
        order = list(self.order)
        if OP not in order:
            order.insert(order.count(_RESET), OP)
        types = Sdf.ValueTypeNames
        return {
            (self.path, f".{OP}"): Opinion(value, types.Matrix4d),
            (self.path, ".xformOpOrder"): Opinion(Vt.TokenArray(order), types.TokenArray),
        }


def placement(prim: Usd.Prim, time: Usd.TimeCode) -> Placement | None:
    """Returns the transform of a prim, or None if it cannot be edited."""
    if not prim or not prim.IsA(UsdGeom.Xformable) or prim.IsInstanceProxy():
        return None
    order = tuple(UsdGeom.Xformable(prim).GetXformOpOrderAttr().Get() or ())
    own = prim.GetAttribute(OP).Get(time) if OP in order else None
    parent = Gf.Matrix4d(1.0)
    if _RESET not in order:
        parent = UsdGeom.XformCache(time).GetParentToWorldTransform(prim)
    return Placement(prim.GetPath(), own or Gf.Matrix4d(1.0), parent, order)


def moves_alone(prim: Usd.Prim, time: Usd.TimeCode) -> bool:
    """Returns whether a prim's transform is constant and moves one light and nothing else."""
    if not prim or str(prim.GetTypeName()) not in KINDS or prim.GetAllChildren():
        return False
    others = (prim.GetRelationship(name) for name in ("light:filters", "portals"))
    if any(one and one.HasAuthoredTargets() for one in others):
        return False
    return not UsdGeom.Xformable(prim).TransformMightBeTimeVarying()
