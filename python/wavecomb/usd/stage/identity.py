# SPDX-License-Identifier: Apache-2.0
"""Finds the asset and the light group of a prim."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from pxr import Kind, Sdf, Usd, UsdGeom

from wavecomb.usd.materials.assignment import Parent
from wavecomb.usd.stage.report import LoadReport

OTHER = "other"
"""Name of the group of lights without an authored group."""
MAX_LIGHT_GROUPS = 63
"""Most further light groups that the core supports."""
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
"""Light group attributes of Wavecomb, RenderMan, Karma and Arnold, tried after the primvar."""


def light_group(prim: Usd.Prim, inherited: Sequence[Any] | None = None) -> str:
    """Returns the light group of a light or emissive mesh; "" if it has none.

    ``primvars:wavecomb:lightGroup`` is inherited from ancestors like all primvars. Attributes of
    other renderers are read on the prim itself only.

    Args:
        prim: The light or mesh.
        inherited: Primvars of its ancestors, if they are known.
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
    """Light groups of a stage, with names that are valid in channels and a limited number."""

    def __init__(self, report: LoadReport) -> None:
        self._report = report
        self._names: dict[str, str] = {}

    def of(self, prim: Usd.Prim, inherited: Sequence[Any] | None = None) -> str:
        """Returns ``light_group`` with invalid characters replaced by "_"; "" if it has none."""
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
    """Returns whether the kind of a prim is component or derived from it."""
    kind = prim.GetKind()
    return bool(kind) and Kind.Registry.IsA(kind, Kind.Tokens.component)


class Assets:
    """The assets that contain prims: their nearest ancestors of kind component."""

    def __init__(self) -> None:
        self._known: dict[Sdf.Path, int] = {Sdf.Path.absoluteRootPath: 0}

    def length_below(self, prim: Usd.Prim, path: str, parent: Parent | None) -> int:
        """Returns ``length`` of a prim with this path, using its parent's cached result."""
        if parent is None:
            return self.length(prim)
        if _is_asset(prim):
            return len(path)
        chain: list[Parent] = []
        while parent.asset is None and parent.above is not None and not _is_asset(parent.prim):
            chain.append(parent)
            parent = parent.above
        if parent.asset is None:
            parent.asset = self.length(parent.prim)
        for one in chain:
            one.asset = parent.asset
        return parent.asset

    def length(self, prim: Usd.Prim) -> int:
        """Returns the length of the asset's path within the prim's path; 0 if there is no asset."""
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
