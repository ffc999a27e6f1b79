# SPDX-License-Identifier: Apache-2.0
"""Fields of a UsdVol volume: which grid of which file each relationship leads to."""

from __future__ import annotations

from dataclasses import dataclass

from pxr import Usd, UsdVol

from wavecomb.usd.looks.network import asset_file, word
from wavecomb.usd.stage.report import LoadReport


@dataclass(frozen=True)
class Field:
    """A field of a volume.

    Attributes:
        name: Of the relationship, without ``field:``.
        file: A .vdb file.
        grid: Its name in the file; "": that of the relationship, or the only one.
        index: Among the grids of that name.
        prim: Path of the asset.
        changes: Whether the file changes over time.
    """

    name: str
    file: str
    grid: str = ""
    index: int = 0
    prim: str = ""
    changes: bool = False


def read_fields(volume: Usd.Prim, time: Usd.TimeCode, report: LoadReport) -> dict[str, Field]:
    """The fields of a volume by name, in its order; those that cannot be read are said."""
    found: dict[str, Field] = {}
    stage = volume.GetStage()
    for name, path in sorted(UsdVol.Volume(volume).GetFieldPaths().items()):
        prim = stage.GetPrimAtPath(path)
        if not prim:
            report.warn(f"volume field without its asset {path}: left out", volume.GetPath())
            continue
        if prim.GetTypeName() != "OpenVDBAsset":
            kind = str(prim.GetTypeName()) or "prim without a type"
            report.missing(f"{kind} as a volume field (left out)", prim.GetPath())
            continue
        field = _asset(str(name), prim, time)
        if not field.file:
            report.warn("volume field that names no file: left out", prim.GetPath())
            continue
        if prim.GetAttribute("xformOpOrder").HasAuthoredValue():
            report.missing("transforms of volume fields of their own (left out)", prim.GetPath())
        found[str(name)] = field
    return found


def _asset(name: str, prim: Usd.Prim, time: Usd.TimeCode) -> Field:
    asset = UsdVol.OpenVDBAsset(prim)
    file = asset.GetFilePathAttr()
    index = asset.GetFieldIndexAttr().Get(time)
    return Field(
        name,
        asset_file(file.Get(time), file),
        word(asset.GetFieldNameAttr().Get(time)),
        index if isinstance(index, int) and index >= 0 else 0,
        str(prim.GetPath()),
        file.ValueMightBeTimeVarying(),
    )
