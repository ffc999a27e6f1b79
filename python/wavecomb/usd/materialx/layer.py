# SPDX-License-Identifier: Apache-2.0
"""MaterialX files as layers, as OpenUSD's own reader of them would have it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pxr import Sdf

from wavecomb.usd.materialx.files import MtlxError, read_document
from wavecomb.usd.materialx.graphs import Graphs
from wavecomb.usd.materialx.looks import write_looks
from wavecomb.usd.materialx.materials import Materials
from wavecomb.usd.materialx.prims import Prims
from wavecomb.usd.stage.report import LoadReport

ROOT = Sdf.Path("/MaterialX")


def translate(file: str) -> tuple[Sdf.Layer, LoadReport]:
    """The layer of a file, and what could not be translated.

    Names of files in the layer are absolute, so that it can be anywhere.

    Args:
        file: As Ar resolved it.

    Raises:
        MtlxError: It cannot be read.
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
    except Exception as error:  # MaterialX's bindings raise types of their own
        raise MtlxError(" ".join(str(error).split())[:200]) from None
    return layer, report
