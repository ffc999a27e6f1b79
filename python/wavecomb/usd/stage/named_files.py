# SPDX-License-Identifier: Apache-2.0
"""What a composed stage names: all that reading it on may open."""

from __future__ import annotations

import os

from pxr import Ar, Sdf, Tf, Usd, UsdUtils

from wavecomb.run.isolate import box
from wavecomb.usd.looks.texture import UDIM, tile_files


def named_files(stage: Usd.Stage) -> list[str]:
    """Folders of the layers that a stage uses, and the files that these name, in any variant.

    A folder that holds the user's home is no such one: of it the layers' files alone.
    """
    found: dict[str, None] = {}
    resolver = Ar.GetResolver()
    with Ar.ResolverContextBinder(stage.GetPathResolverContext()):
        for layer in stage.GetUsedLayers():
            file = _outer(layer.realPath)
            if file:
                folder = os.path.dirname(file)
                found[file if box.holds_home(folder) else folder] = None
            for name in _names(layer):
                path = layer.ComputeAbsolutePath(name)
                if UDIM in name:
                    found.update(dict.fromkeys(_outer(tile) for _, tile in tile_files(path)))
                elif resolved := _outer(str(resolver.Resolve(path))):
                    found[resolved] = None
    return [path for path in found if path]


def _names(layer: Sdf.Layer) -> set[str]:
    """Files that a layer names: in sublayers, references and payloads, and as values."""
    try:
        kinds = UsdUtils.ExtractExternalReferences(layer.identifier)
    except Tf.ErrorException:
        return set()
    return {name for names in kinds for name in names if name}


def _outer(path: str) -> str:
    """The file, of one in a package the package."""
    return Ar.SplitPackageRelativePathOuter(path)[0] if Ar.IsPackageRelativePath(path) else path


def keep_to(stage: Usd.Stage) -> None:
    """From now on a process in a sandbox reads what a stage names."""
    if box.is_to_be_narrowed():
        box.narrow(named_files(stage))
