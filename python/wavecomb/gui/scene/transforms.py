# SPDX-License-Identifier: Apache-2.0
"""Edits of a prim's transform, stored in an additional transform operation of the prim.

Also finds the moves of the rendered scene that follow edits. Independent of Qt.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdLux, UsdVol, Vt

from wavecomb.gui.scene.stage_edits import Key, Opinion
from wavecomb.usd.lights.light import KINDS
from wavecomb.usd.stage.context import Origin

Matrix = NDArray[np.float64]

OP = "xformOp:transform:edit"
"""Name of the transform operation that holds all edits. The operation is applied after the prim's
other operations."""
_RESET = "!resetXformStack!"
_FIXED = (UsdGeom.Camera, UsdVol.Volume, UsdLux.LightFilter, UsdLux.PortalLight)
"""Types of prims whose content does not move when ``Renderer.edit`` moves objects."""


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


# ---- Moves of the rendered scene that follow edits
# ----------------------------------------------------------


class Placements:
    """Prims of one stage that were moved after the stage was loaded.

    ``Renderer.edit`` moves objects relative to their loaded positions, so that the stage need not
    be loaded again when a transform changes.

    Attributes:
        time: Time code at which transforms are read.
        refused: Prims that the rendered scene has refused to move.
    """

    def __init__(
        self, stage: Usd.Stage, time: Usd.TimeCode, refused: Iterable[Sdf.Path] = ()
    ) -> None:
        self._stage, self.time = stage, time
        self.refused = set(refused)
        self._loaded: dict[Sdf.Path, Matrix] = {}
        self._known: dict[Sdf.Path, bool] = {}
        self._prototypes: list[Sdf.Path] | None = None

    def can_follow(self, path: Sdf.Path, is_rendered: Callable[[str], bool]) -> bool:
        """Returns whether the render can follow the transform of a prim.

        Args:
            path: Path of the prim.
            is_rendered: Whether an object or a light is at or below a path.
        """
        if path in self.refused:
            return False
        if path not in self._known:
            prim = self._stage.GetPrimAtPath(path)
            self._known[path] = (
                bool(prim)
                and is_rendered(str(path))
                and all(_is_still(above) for above in _ancestors(prim))
                and all(_moves_with(one, prim) for one in Usd.PrimRange(prim))
                and not any(one.HasPrefix(path) or path.HasPrefix(one) for one in self._sources())
            )
        return self._known[path]

    def refuse(self) -> None:
        """Marks all moved prims as refused."""
        self.refused.update(self._loaded)

    def begin(self, path: Sdf.Path) -> None:
        """Stores the transform with which a prim was loaded, before the transform changes."""
        if path not in self._loaded:
            self._loaded[path] = self._world(path) @ np.linalg.inv(self.moved(path))

    def moved(self, path: Sdf.Path) -> Matrix:
        """Returns the transform (4, 4) of a prim, in world space, since the prim was loaded.

        The transform is for row vectors, and includes the moves of ancestors.
        """
        for one in path.GetPrefixes()[::-1]:
            if one in self._loaded:
                return np.linalg.inv(self._loaded[one]) @ self._world(one)
        return np.eye(4)

    def moves(self, origin: Origin) -> dict[str, Matrix]:
        """Returns the argument ``moves`` of ``Renderer.edit``, in the space relative to ``origin``.

        The move of a prim is applied in addition to the moves of its ancestors.
        """
        there, back = np.eye(4), np.eye(4)
        there[3, :3], back[3, :3] = origin, np.negative(origin)
        out = {}
        for path in self._loaded:
            own = self.moved(path) @ np.linalg.inv(self.moved(path.GetParentPath()))
            out[str(path)] = there @ own @ back
        return out

    def _world(self, path: Sdf.Path) -> Matrix:
        prim = self._stage.GetPrimAtPath(path)
        return np.array(UsdGeom.XformCache(self.time).GetLocalToWorldTransform(prim))

    def _sources(self) -> list[Sdf.Path]:
        """Returns the prototypes of point instancers; moving a prototype moves its instances."""
        if self._prototypes is None:
            self._prototypes = [
                target
                for prim in self._stage.Traverse()
                if prim.IsA(UsdGeom.PointInstancer)
                for target in UsdGeom.PointInstancer(prim).GetPrototypesRel().GetTargets()
                if not target.HasPrefix(prim.GetPath())
            ]
        return self._prototypes


def _ancestors(prim: Usd.Prim) -> list[Usd.Prim]:
    out = []
    while (prim := prim.GetParent()) and not prim.IsPseudoRoot():
        out.append(prim)
    return out


def _is_still(prim: Usd.Prim) -> bool:
    """Returns whether a move below a prim has the same effect in world space at all times."""
    if str(prim.GetTypeName()) == "SkelRoot":
        return False
    return not prim.IsA(UsdGeom.Xformable) or not _varies(prim)


def _varies(prim: Usd.Prim) -> bool:
    return bool(UsdGeom.Xformable(prim).TransformMightBeTimeVarying())


def _moves_with(prim: Usd.Prim, root: Usd.Prim) -> bool:
    """Returns whether the rendered content of a prim moves with a prim at or above it."""
    if str(prim.GetTypeName()) == "SkelRoot" or any(prim.IsA(one) for one in _FIXED):
        return False
    if prim != root and prim.IsA(UsdGeom.Xformable):
        order = UsdGeom.Xformable(prim).GetXformOpOrderAttr().Get() or ()
        if _RESET in order:
            return False
    if not prim.HasAPI(UsdLux.LightAPI):
        return True
    others = (prim.GetRelationship(name) for name in ("light:filters", "portals"))
    return not _varies(prim) and not any(one and one.HasAuthoredTargets() for one in others)


def changed_transforms(stage: Usd.Stage, change: Callable[[], None]) -> set[Sdf.Path]:
    """Calls a function that edits a stage; returns the prims whose transforms it changed.

    References and inherits also change prims that the function does not name.
    """
    found: set[Sdf.Path] = set()

    def note(notice: Usd.Notice.ObjectsChanged, sender: Usd.Stage) -> None:
        paths: Iterable[Sdf.Path] = [*notice.GetResyncedPaths(), *notice.GetChangedInfoOnlyPaths()]
        found.update(
            path.GetPrimPath()
            for path in paths
            if path.IsPropertyPath() and path.name.startswith("xformOp")
        )

    key = Tf.Notice.Register(Usd.Notice.ObjectsChanged, note, stage)
    try:
        change()
    finally:
        key.Revoke()
    return found
