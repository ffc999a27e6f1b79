# SPDX-License-Identifier: Apache-2.0
"""Lists all files that a stage needs, and all files that the stage names but that are missing."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from pxr import Ar, Sdf, Tf, Usd, UsdUtils

from wavecomb.usd import mtlx
from wavecomb.usd.layers.opening import open_stage
from wavecomb.usd.materials.network import UDIM, asset_file, missing_tiles, tile_files
from wavecomb.usd.stage.report import LoadReport, capture_diagnostics


@dataclass(frozen=True)
class Dependencies:
    """Files that a stage needs.

    Attributes:
        files: Absolute names of existing files: layers in all variants, textures and their tiles,
            IES profiles, and images that MaterialX files name.
        missing: Messages about files that the composed stage names but that do not exist.
    """

    files: tuple[str, ...]
    missing: tuple[str, ...]


def dependencies(
    file: Path, variants: Mapping[str, str] | None = None, session_layer: Path | None = None
) -> Dependencies:
    """Returns the dependencies of a stage with the given variants.

    Raises:
        WavecombError: The stage cannot be opened.
    """
    report = LoadReport()
    with capture_diagnostics(report):
        stage = open_stage(file, variants, session_layer=session_layer)
        mtlx.report_problems(stage, report)
        found: dict[str, None] = dict.fromkeys(_layers(stage))
        for name in (file, session_layer):
            if name is not None:
                found.update(dict.fromkeys(_all(str(name))))
        missing: dict[str, None] = {}
        for prim in _prims(stage):
            for attribute in prim.GetAuthoredAttributes():
                for value in _values(attribute):
                    _add(found, missing, value, attribute)
    for warning in report.warnings:
        if warning.what.startswith(("MaterialX file", "cannot open layer")):
            missing[warning.line()] = None
    files = {os.path.abspath(path) for path in map(_outer, found) if path and os.path.isfile(path)}
    return Dependencies(tuple(sorted(files)), tuple(sorted(missing)))


def _prims(stage: Usd.Stage) -> Iterator[Usd.Prim]:
    """Yields all active and defined prims of the stage, and the prims of each prototype once."""
    predicate = Usd.PrimIsActive & Usd.PrimIsDefined & ~Usd.PrimIsAbstract
    yield from Usd.PrimRange(stage.GetPseudoRoot(), predicate)
    for prototype in stage.GetPrototypes():
        yield from Usd.PrimRange(prototype, predicate)


def _values(attribute: Usd.Attribute) -> Iterator[Sdf.AssetPath]:
    """Yields all asset paths of an attribute over time."""
    kind = attribute.GetTypeName()
    if kind not in (Sdf.ValueTypeNames.Asset, Sdf.ValueTypeNames.AssetArray):
        return
    for time in (Usd.TimeCode.Default(), *attribute.GetTimeSamples()):
        value = attribute.Get(time)
        values: Iterable[Sdf.AssetPath] = (
            [value] if isinstance(value, Sdf.AssetPath) else value or ()
        )
        yield from (one for one in values if one.path)


def _add(
    found: dict[str, None],
    missing: dict[str, None],
    value: Sdf.AssetPath,
    attribute: Usd.Attribute,
) -> None:
    """Adds a file of an attribute to the existing or to the missing files."""
    if UDIM in value.path:
        pattern = asset_file(value, attribute)
        tiles = [path for _, path in tile_files(pattern)]
        found.update(dict.fromkeys(tiles))
        if not tiles:
            why = missing_tiles(pattern)
            missing[f"texture {pattern} does not exist ({why}): {attribute.GetPath()}"] = None
        return
    path = _outer(value.resolvedPath or asset_file(value, attribute))
    if path and os.path.isfile(path):
        found[path] = None
    elif not _is_library(value.path):
        missing[f"file {value.path} does not exist: {attribute.GetPath()}"] = None


def _is_library(path: str) -> bool:
    """Returns whether a path names a file of shader source code, which Wavecomb does not read."""
    return path.endswith((".osl", ".oso", ".glslfx", ".args"))


def _layers(stage: Usd.Stage) -> Iterator[str]:
    for layer in stage.GetUsedLayers(True):
        if layer.realPath:
            yield _outer(layer.realPath)
    yield from map(_outer, mtlx.translated_files(stage))


def _all(file: str) -> Iterator[str]:
    """Yields files that layers name, including those in unselected variants."""
    try:
        layers, assets, _ = UsdUtils.ComputeAllDependencies(file)
    except (Tf.ErrorException, RuntimeError):
        return
    yield from (_outer(layer.realPath) for layer in layers)
    yield from (_outer(str(asset)) for asset in assets)


def _outer(path: str) -> str:
    """Returns the file itself, or the package (.usdz) that contains it."""
    return Ar.SplitPackageRelativePathOuter(path)[0] if Ar.IsPackageRelativePath(path) else path
