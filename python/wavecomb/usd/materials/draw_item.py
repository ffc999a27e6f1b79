# SPDX-License-Identifier: Apache-2.0
"""A gprim to draw, with its binding and the primvars that it inherits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from pxr import Gf, Usd, UsdShade

from wavecomb.usd.geometry.shutter import Track

_DISPLAYED = ("primvars:displayColor", "primvars:displayOpacity")


@dataclass(slots=True)
class Parent:
    """Parent prim of gprims, with properties that all its child gprims share.

    Attributes:
        prim: The parent prim.
        above: Parent of ``prim``, if the traversal has visited it.
        asset: Length of the part of the path that identifies the asset, once ``Assets`` has
            computed it.
    """

    prim: Usd.Prim
    above: Parent | None = None
    asset: int | None = None


@dataclass(slots=True)
class DrawItem:
    """A gprim to draw.

    Attributes:
        prim: Prim of a mesh, implicit shape, curves, points or splats.
        matrix: Transform from the gprim to its group (the world or a prototype).
        inherited: Constant primvars of the gprim's ancestors.
        subsets: GeomSubset prims to which materials are bound.
        material: Material bound to the gprim.
        subset_materials: Materials bound to the subsets, one for each subset.
        track: Animated transform of the gprim, which replaces ``matrix`` while the shutter is open.
        names: Names of the gprim's authored properties, from ``authored_names``.
        kind: "mesh", "patch", "shape", "curves", "points" or "splats".
        parent: The parent prim, if the traversal has visited it.
    """

    prim: Usd.Prim
    matrix: Gf.Matrix4d
    inherited: Sequence[Any] = ()
    subsets: Sequence[Usd.Prim] = ()
    material: UsdShade.Material | None = None
    subset_materials: list[UsdShade.Material | None] = field(default_factory=list)
    track: Track | None = None
    names: frozenset[str] = frozenset()
    kind: str = ""
    parent: Parent | None = None

    @property
    def is_plain(self) -> bool:
        """Whether the gprim has neither subsets nor display colours."""
        is_alone = bool(self.names) and not self.subsets and not self.inherited
        return is_alone and self.names.isdisjoint(_DISPLAYED)
