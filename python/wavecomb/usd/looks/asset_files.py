# SPDX-License-Identifier: Apache-2.0
"""Files that values of a stage name: images, alone or as UDIM tiles."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pxr import Sdf, Usd, UsdShade

from wavecomb.usd.looks.network import layer_of_value

UDIM = "<UDIM>"
_SMALL_UDIM = "<udim>"


def asset_file(value: Any, attribute: Usd.Attribute | None) -> str:
    """The file that an asset value names: resolved where it resolves, else as authored.

    Of a UDIM texture its pattern, with ``<UDIM>`` in it.
    """
    if not isinstance(value, Sdf.AssetPath):
        return _file_of_text(str(value or ""), attribute)
    if _SMALL_UDIM in value.path:  # as Arnold writes it
        return _file_of_text(value.path, attribute)
    path = value.resolvedPath or value.path
    if UDIM not in path and UDIM not in value.path:
        return path
    if UDIM in value.resolvedPath:
        return value.resolvedPath
    layer = layer_of_value(attribute)
    found = UsdShade.UdimUtils.ResolveUdimPath(value.path, layer)
    if not found and layer is not None and value.path.startswith("."):
        return str(layer.ComputeAbsolutePath(value.path))  # for messages: there are no tiles
    return found or value.path


def _file_of_text(name: str, attribute: Usd.Attribute | None) -> str:
    """The file that a text names: beside the layer that has it, unless it is absolute."""
    name = name.replace(_SMALL_UDIM, UDIM)
    layer = layer_of_value(attribute)
    return str(layer.ComputeAbsolutePath(name)) if name and layer is not None else name


def tile_files(pattern: str) -> list[tuple[int, str]]:
    """Tile numbers and files that are there of a UDIM pattern, 1001 to 1100."""
    found = UsdShade.UdimUtils.ResolveUdimTilePaths(pattern, None)
    return [(int(number), path) for path, number in found]


def image_files(material: Usd.Prim, time: Usd.TimeCode) -> Iterator[str]:
    """Files that the shaders in a material name: a guess at what it will ask for."""
    for prim in _each_once(material):
        for attribute in prim.GetAuthoredAttributes():
            if attribute.GetTypeName() == Sdf.ValueTypeNames.Asset:
                value = attribute.Get(time)
                if value is None:
                    continue
                if UDIM in value.path:
                    yield from (path for _, path in tile_files(asset_file(value, attribute)))
                elif value.resolvedPath:
                    yield value.resolvedPath


def _each_once(top: Usd.Prim) -> Iterator[Usd.Prim]:
    """A prim and all below it; what is in instances once, however often it is there."""
    tops = [top.GetPrimInPrototype() if top.IsInstanceProxy() else top]
    known: set[Sdf.Path] = set()
    while tops:
        for prim in Usd.PrimRange(tops.pop()):
            yield prim
            if prim.IsInstance() and (prototype := prim.GetPrototype()).GetPath() not in known:
                known.add(prototype.GetPath())
                tops.append(prototype)
