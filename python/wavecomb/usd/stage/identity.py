# SPDX-License-Identifier: Apache-2.0
"""What prims belong to: their asset, and their light group."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from pxr import Kind, Sdf, Usd, UsdGeom

from wavecomb.usd.looks.assign import Parent
from wavecomb.usd.stage.report import LoadReport

OTHER = "other"
"""The group of lights that have none."""
MAX_LIGHT_GROUPS = 63
"""Beside that: what the core has room for."""
PRIMVAR = "wavecomb:lightGroup"
_LIGHT_GROUPS = (
    "wavecomb:lightGroup",
    "inputs:ri:light:lightGroup",
    "ri:light:lightGroup",
    "inputs:karma:light:lpetag",
    "karma:light:lpetag",
    "primvars:karma:object:lpetag",
    "primvars:arnold:aov",
)
"""Attributes that name a light's group, after the primvar: ours, RenderMan's, Karma's, Arnold's."""


def light_group(prim: Usd.Prim, inherited: Sequence[Any] | None = None) -> str:
    """The light group of a light, or of a mesh that may shine; "" where it has none.

    ``primvars:wavecomb:lightGroup`` counts on the prim and, like all primvars, on its ancestors;
    of other renderers what they call so is read on the prim itself.

    Args:
        prim: The light or mesh.
        inherited: Primvars of its ancestors where they are known.
    """
    if inherited is None:
        primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(PRIMVAR)
        value = primvar.Get() if primvar and primvar.HasValue() else None
    else:
        value = prim.GetAttribute(f"primvars:{PRIMVAR}").Get()
        for primvar in inherited if value is None else ():
            if primvar.GetPrimvarName() == PRIMVAR:
                value = primvar.Get()
    for name in _LIGHT_GROUPS if value is None else ():
        value = prim.GetAttribute(name).Get()
        if value:
            break
    return str(value) if value else ""


class LightGroups:
    """The light groups of a stage by names that channels can have, and no more than fit."""

    def __init__(self, report: LoadReport) -> None:
        self._report = report
        self._names: dict[str, str] = {}

    def of(self, prim: Usd.Prim, inherited: Sequence[Any] | None = None) -> str:
        """``light_group``, with "_" for what a channel's name cannot hold; "" where it has none."""
        name = light_group(prim, inherited)
        channel = re.sub(r"[^A-Za-z0-9_]", "_", name)
        if channel in ("", OTHER):
            return ""
        if channel not in self._names and len(self._names) == MAX_LIGHT_GROUPS:
            what = f"more than {MAX_LIGHT_GROUPS} light groups: light of the rest is in {OTHER!r}"
            self._report.warn(what, prim.GetPath())
            return ""
        first = self._names.setdefault(channel, name)
        if first != name:
            what = f"light groups {first!r} and {name!r} are one: channels call both {channel!r}"
            self._report.warn(what, prim.GetPath())
        return channel


def _is_asset(prim: Usd.Prim) -> bool:
    """Whether its kind is component, or derived from that."""
    kind = prim.GetKind()
    return bool(kind) and Kind.Registry.IsA(kind, Kind.Tokens.component)


class Assets:
    """Finds the asset that a prim is part of: its nearest model of kind component."""

    def __init__(self) -> None:
        self._known: dict[Sdf.Path, int] = {Sdf.Path.absoluteRootPath: 0}

    def length_below(self, prim: Usd.Prim, path: str, parent: Parent | None) -> int:
        """As ``length``, of a prim with this path whose siblings were seen before."""
        if parent is None:
            return self.length(prim)
        if _is_asset(prim):
            return len(path)
        if parent.asset is None:
            parent.asset = self.length(parent.prim)
        return parent.asset

    def length(self, prim: Usd.Prim) -> int:
        """How much of the prim's path names its asset; 0 where no ancestor is a component."""
        above: list[Sdf.Path] = []
        length: int | None = 0
        while prim:
            path = prim.GetPath()
            length = self._known.get(path)
            if length is not None:
                break
            above.append(path)
            if _is_asset(prim):
                length = len(str(path))
                break
            prim = prim.GetParent()
        self._known.update(dict.fromkeys(above, length or 0))
        return length or 0
