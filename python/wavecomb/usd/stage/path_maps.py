# SPDX-License-Identifier: Apache-2.0
"""Files that lie elsewhere on this machine than where a stage names them.

Layers are changed in memory only, before they are composed: each absolute name in them, of layers,
textures and all other files. Names that are relative need nothing. The variable is set for the
workers of a farm; nothing else sets it.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Iterable

from pxr import Sdf, Tf, UsdUtils

VARIABLE = "WAVECOMB_PATH_MAPS"
"""JSON: pairs of folders, what is named and where it lies."""

_changed: dict[str, Sdf.Layer] = {}
"""By identifier. Held as long as the process: a layer that is let go would be read anew."""


def maps() -> list[tuple[str, str]]:
    """Those of this process."""
    text = os.environ.get(VARIABLE)
    return [(str(named), str(lies)) for named, lies in json.loads(text)] if text else []


def mapped(path: str, pairs: Iterable[tuple[str, str]]) -> str:
    """Where a file lies; the longest folder that fits decides. Relative names stay as they are.

    >>> mapped("/a/b/c.png", [("/a", "/x"), ("/a/b", "/y")]), mapped("/ab/c", [("/a", "/x")])
    ('/y/c.png', '/ab/c')
    """
    if not os.path.isabs(path):
        return path
    best = max(
        (pair for pair in pairs if _is_in(path, pair[0])),
        key=lambda pair: len(pair[0].rstrip("/")),
        default=None,
    )
    if best is None:
        return path
    named, lies = (folder.rstrip("/") for folder in best)
    rest = path[len(named) :]
    # What was mapped already is not mapped again.
    return path if named == "" and _is_in(path, lies) else (lies + rest) or "/"


def _is_in(path: str, folder: str) -> bool:
    folder = folder.rstrip("/")
    return path == folder or path.startswith(folder + "/")


def change_layers(layers: Iterable[Sdf.Layer]) -> None:
    """Changes names in layers, and in all that they name, where this process has maps."""
    pairs = maps()
    if not pairs:
        return
    left = list(layers)
    while left:
        layer = left.pop()
        if layer.identifier in _changed:
            continue
        _changed[layer.identifier] = layer
        if layer.permissionToEdit:
            UsdUtils.ModifyAssetPaths(layer, lambda path: mapped(path, pairs))
        for name in layer.GetCompositionAssetDependencies():
            if name and not name.lower().endswith(".mtlx"):
                # Of one that cannot be read the stage tells when it is composed.
                with contextlib.suppress(Tf.ErrorException):
                    other = Sdf.Layer.FindOrOpenRelativeToLayer(layer, name)
                    if other:
                        left.append(other)
