# SPDX-License-Identifier: Apache-2.0
"""MaterialX files as layers, as OpenUSD's own reader of them would have it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pxr import Sdf

from wavecomb.usd.mtlx_files import MtlxError, read_document
from wavecomb.usd.mtlx_graphs import Graphs
from wavecomb.usd.mtlx_looks import write_looks
from wavecomb.usd.mtlx_materials import Materials
from wavecomb.usd.mtlx_prims import Prims

ROOT = Sdf.Path("/MaterialX")

Findings = list[tuple[str, str]]
"""What could not be translated: what, and which element of which file."""


def translate(file: str) -> tuple[Sdf.Layer, Findings]:
    """The layer of a file; names of files in it are absolute, so that it can be anywhere.

    Args:
        file: As Ar resolved it.

    Raises:
        MtlxError: It cannot be read.
    """
    document = read_document(file)
    findings: Findings = []

    def tell(element: Any, what: str) -> None:
        findings.append((what, f"{file} {element.getNamePath()}"))

    layer = Sdf.Layer.CreateAnonymous(f"{Path(file.rstrip(']')).name}.usda")
    try:
        with Sdf.ChangeBlock():
            prims = Prims(layer, file, tell)
            prims.define(ROOT)
            layer.defaultPrim = ROOT.name
            graphs = Graphs(document, prims)
            Materials(document, prims, graphs).all()
            graphs.all()
        write_looks(document, layer, tell)
    except Exception as error:  # MaterialX's bindings raise types of their own
        raise MtlxError(" ".join(str(error).split())[:200]) from None
    return layer, findings
