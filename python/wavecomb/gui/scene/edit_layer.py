# SPDX-License-Identifier: Apache-2.0
"""Writes the edits of a stage as a small layer over it."""

from __future__ import annotations

import os
from pathlib import Path

from pxr import Sdf, Usd

from wavecomb.errors import WavecombError
from wavecomb.image.files.output_file import replacing

_NOT_REPEATED = frozenset(
    {"subLayers", "subLayerOffsets", "comment", "documentation", "customLayerData", "owner"}
)
"""Metadata fields of the stage's root layer that are not copied to a new layer of edits."""


def edit_layer(stage: Usd.Stage, folder: Path) -> Sdf.Layer:
    """Returns a layer that contains the session layer's edits and has the stage as a sublayer.

    Args:
        stage: Stage with edits in its session layer.
        folder: Folder of the new layer; the path of the stage is relative to it.
    """
    root = stage.GetRootLayer()
    layer = Sdf.Layer.CreateAnonymous("edits.usda")
    layer.TransferContent(stage.GetSessionLayer())
    base = Path(root.realPath)
    try:
        name = os.path.relpath(base, folder)
    except ValueError:  # On Windows, there is no relative path between different drives.
        name = str(base)
    name = Path(name).as_posix()
    layer.subLayerPaths = [name if name.startswith(("../", "/")) else f"./{name}"]
    # USD reads the up axis, units, default prim and time range only from the strongest layer, so
    # copy these values to the edit layer.
    for key in root.pseudoRoot.ListInfoKeys():
        if key not in _NOT_REPEATED and not layer.pseudoRoot.HasInfo(key):
            layer.pseudoRoot.SetInfo(key, root.pseudoRoot.GetInfo(key))
    return layer


def save_edits(stage: Usd.Stage, path: str | os.PathLike[str]) -> Path:
    """Writes the edits of a stage to a .usda file and returns its path.

    A failure leaves no partial file.

    Raises:
        WavecombError: The file cannot be written, or is one of the stage's files.
    """
    target = Path(path)
    if target.suffix.lower() not in (".usda", ".usd"):
        raise WavecombError(f"{target}: edits are saved as text: give a name that ends in .usda")
    root = stage.GetRootLayer()
    if not root.realPath:
        raise WavecombError("the stage is no file, so no layer can be put over it")
    used = {layer.realPath for layer in stage.GetUsedLayers()} | {root.realPath}
    if target.resolve() in {Path(one).resolve() for one in used if one}:
        raise WavecombError(f"{target}: is a file of the stage; give another name")
    text = edit_layer(stage, target.resolve().parent).ExportToString()
    try:
        with replacing(target) as part:
            part.write_text(text, encoding="utf-8")
    except OSError as error:
        raise WavecombError(str(error)) from error
    return target
