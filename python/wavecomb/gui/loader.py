# SPDX-License-Identifier: Apache-2.0
"""What reading a stage for the window takes and gives. No Qt: it happens on another thread."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pxr import Sdf, Usd

from wavecomb.run.isolate.probe import check, is_wanted
from wavecomb.usd import LoadedStage
from wavecomb.usd.looks.texture import TextureStock


@dataclass(frozen=True)
class Source:
    """What is read, and how.

    Attributes:
        path: The stage's file.
        camera: Prim path or unique name.
        time: Time code; None: the stage's start.
        variants: Selections as ``wavecomb.load`` takes them; made in the session layer.
        purposes: Of the geometry; None: default and render.
    """

    path: Path
    camera: str | None = None
    time: float | None = None
    variants: Mapping[str, str] | None = None
    purposes: tuple[str, ...] | None = None


@dataclass(frozen=True)
class Request:
    """What the session wants to be read.

    Attributes:
        source: What to read.
        usd: A stage that is open already, or None.
        overrides: What its session layer holds; a copy of its own.
        fresh: Read the layers of ``usd`` from the disk again, first.
        threads: For textures; 0: all.
        textures: Of the scene read before, to share.
        size: Of the picture, width and height.
    """

    source: Source
    usd: Usd.Stage | None = None
    overrides: Sdf.Layer | None = None
    fresh: bool = False
    threads: int = 0
    textures: TextureStock | None = None
    size: tuple[int, int] = (600, 600)


def copied(layer: Sdf.Layer) -> Sdf.Layer:
    """A layer with the same content that nobody else has."""
    copy = Sdf.Layer.CreateAnonymous("overrides.usda")
    copy.TransferContent(layer)
    return copy


def read(request: Request) -> tuple[Usd.Stage, LoadedStage]:
    """The stage, open, and its scene.

    Raises:
        WavecombError: It cannot be rendered.
    """
    from wavecomb.usd import LoadReport, load_stage, open_editable, open_stage
    from wavecomb.usd.materialx import references as mtlx
    from wavecomb.usd.stage.diagnostics import captured

    source = request.source
    usd = request.usd
    if usd is None:
        if is_wanted():
            chosen = {"variants": source.variants, "purposes": source.purposes}
            check(source.path, {key: value for key, value in chosen.items() if value is not None})
        usd = open_editable(source.path, source.variants)
    elif request.fresh:
        with captured(LoadReport()):
            mtlx.reload(usd)
    overrides = request.overrides if request.overrides is not None else usd.GetSessionLayer()
    options: dict[str, Any] = {} if source.purposes is None else {"purposes": source.purposes}
    said = LoadReport()
    with captured(said):
        # A stage of its own, so that the window can go on with the other.
        stage = open_stage(source.path, overrides=overrides)
    loaded = load_stage(
        stage,
        frame=source.time,
        camera=source.camera,
        threads=request.threads,
        editable=True,
        reuse=request.textures,
        size=request.size,
        **options,
    )
    loaded.report.absorb(said)
    return usd, loaded
