# SPDX-License-Identifier: Apache-2.0
"""Supports references, payloads and sublayers to MaterialX files, which usd-core cannot read.

USD opens layers only in its built-in formats. Therefore layers that name a .mtlx file are changed
in memory to name a translated layer instead. See docs/decisions/materialx-layers.md for the
reasons.
"""

from __future__ import annotations

import os
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pxr import Ar, Sdf, Tf, Usd

from wavecomb.run.isolation import progress_notes
from wavecomb.usd.layers.unopened_materialx import unopened_materialx
from wavecomb.usd.materialx.files import MtlxError, read_document
from wavecomb.usd.materialx.graphs import Graphs
from wavecomb.usd.materialx.materials import Materials, write_looks
from wavecomb.usd.materialx.prims import Prims
from wavecomb.usd.stage.report import LoadReport

MAX_ROUNDS = 16
"""Maximum number of passes over a stage, since a translated file may refer to further files."""


@dataclass
class _Translation:
    """Result of translating a MaterialX file to a layer.

    Attributes:
        stamp: Stamp of the file when it was read.
        layer: The translated layer; None if the file is unreadable.
        error: Reason why the file is unreadable.
        report: Warnings and notes of the translation.
    """

    stamp: object
    layer: Sdf.Layer | None
    error: str
    report: LoadReport


_translations: dict[str, _Translation] = {}
"""Translations of MaterialX files by file name. Translated layers are never released, since layers
of open stages refer to them."""

_lock = threading.Lock()


def translated_files(stage: Usd.Stage) -> list[str]:
    """Returns MaterialX files that a stage uses or that its layers name in any variant."""
    layers = stage.GetUsedLayers(True)
    named = {layer.identifier for layer in layers}
    for layer in layers:
        named.update(layer.GetCompositionAssetDependencies())
    return [
        file
        for file, one in _translations.items()
        if one.layer is not None and one.layer.identifier in named
    ]


def resolve(stage: Usd.Stage, *, everywhere: bool = False) -> None:
    """Makes a stage use the MaterialX files that its layers name.

    Changes the layers in memory, which then can no longer be saved. Unreadable files stay missing;
    ``report_problems`` reports them. The call is fast if no MaterialX file is missing.

    Args:
        stage: The stage.
        everywhere: Whether to include unselected variants, which takes a pass over all layers.
            Selecting other variants later, on any thread, then changes no layer.
    """
    tried: set[tuple[str, str]] = set()
    for turn in range(MAX_ROUNDS):
        if not (everywhere and turn == 0) and not any(True for _ in unopened_materialx(stage)):
            return
        with _lock, Ar.ResolverContextBinder(stage.GetPathResolverContext()):
            changes = _changes(stage, tried)
            if not changes:
                return
            with Sdf.ChangeBlock():
                for layer, name, target in changes:
                    layer.UpdateCompositionAssetDependency(name, target)
                    layer.SetPermissionToSave(False)


def reload(stage: Usd.Stage) -> None:
    """Reloads changed files of a stage, including MaterialX files."""
    with _lock:
        kept = [t.layer for t in _translations.values() if t.layer is not None]
    # Copy the contents of layers without a file, because Reload() would make them empty.
    copies = [(layer, Sdf.Layer.CreateAnonymous("kept.usda")) for layer in kept]
    for layer, copy in copies:
        copy.TransferContent(layer)
    stage.Reload()
    for layer, copy in copies:
        if layer.empty:
            layer.TransferContent(copy)
    resolve(stage, everywhere=True)


def report_problems(stage: Usd.Stage, report: LoadReport) -> None:
    """Reports MaterialX files that are missing, and problems of translated ones."""
    for error, named in unopened_materialx(stage):
        known = next((t for file, t in _translations.items() if _same(file, named)), None)
        why = known.error if known is not None and known.error else _why(named)
        place = str(error.rootSite.path)
        report.warn(f"MaterialX file {named} cannot be read ({why})", place)
    if not _translations:
        return
    used = {layer.identifier for layer in stage.GetUsedLayers()}
    for translation in _translations.values():
        if translation.layer is not None and translation.layer.identifier in used:
            report.absorb(translation.report)


def _same(file: str, named: str) -> bool:
    return file == named or Path(file) == Path(os.path.abspath(named))


def _why(named: str) -> str:
    if not Ar.GetResolver().Resolve(named):
        return "there is no such file"
    return "the stage was opened elsewhere; give Wavecomb its file instead"


def _changes(stage: Usd.Stage, tried: set[tuple[str, str]]) -> list[tuple[Sdf.Layer, str, str]]:
    """Returns the names to replace in layers: (layer, MaterialX name, translated layer)."""
    changes = []
    for layer in stage.GetUsedLayers(False):
        for name in layer.GetCompositionAssetDependencies():
            key = (layer.identifier, name)
            if not name.lower().endswith(".mtlx") or key in tried:
                continue
            tried.add(key)
            identifier = Sdf.ComputeAssetPathRelativeToLayer(layer, name)
            file = str(Ar.GetResolver().Resolve(identifier))
            if not file:
                continue
            found = _translated(file)
            if found.layer is not None and layer.permissionToEdit:
                changes.append((layer, name, found.layer.identifier))
    return changes


def _translated(file: str) -> _Translation:
    """Returns the translation of a file; updates its layer if the file changed."""
    stamp = _stamp(file)
    known = _translations.get(file)
    if known is not None and known.stamp == stamp:
        return known
    progress_notes.note("translating", file)
    try:
        layer, report = translate(file)
        error = ""
    except (MtlxError, Tf.ErrorException) as reason:
        layer, report, error = None, LoadReport(), str(reason)
    if layer is not None and known is not None and known.layer is not None:
        known.layer.TransferContent(layer)
        layer = known.layer
    _translations[file] = _Translation(stamp, layer, error, report)
    return _translations[file]


def _stamp(file: str) -> object:
    """Returns modification time and size of a file, or of the package that contains it."""
    outer = Ar.SplitPackageRelativePathOuter(file)[0] or file
    try:
        status = os.stat(outer)
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size


ROOT = Sdf.Path("/MaterialX")


def translate(file: str) -> tuple[Sdf.Layer, LoadReport]:
    """Translates a file to a layer; also returns a report of the parts that were not translated.

    File names in the translated layer are absolute, so that the layer can be used anywhere.

    Args:
        file: Path that OpenUSD's asset resolver (Ar) returned.

    Raises:
        MtlxError: The file cannot be read.
    """
    document = read_document(file)
    report = LoadReport()

    def tell(element: Any, what: str) -> None:
        report.warn(what, f"{file} {element.getNamePath()}")

    layer = Sdf.Layer.CreateAnonymous(f"{Path(file.rstrip(']')).name}.usda")
    try:
        with Sdf.ChangeBlock():
            prims = Prims(layer, file, tell, report)
            prims.define(ROOT)
            layer.defaultPrim = ROOT.name
            graphs = Graphs(document, prims)
            Materials(document, prims, graphs).all()
            graphs.all()
        write_looks(document, layer, tell)
    # The MaterialX bindings raise library-specific exception types.
    except Exception as error:
        raise MtlxError(" ".join(str(error).split())[:200]) from None
    return layer, report
