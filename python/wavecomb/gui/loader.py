# SPDX-License-Identifier: Apache-2.0
"""Loads a stage for the window.

The module is independent of Qt, because it does not run on the window's thread.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pxr import Sdf, Usd

from wavecomb.usd import LoadedStage
from wavecomb.usd.materials.texture import TextureCache


@dataclass(frozen=True)
class Source:
    """A stage to load, with its loading options.

    Attributes:
        path: File of the stage.
        camera: Prim path or unique name of the camera, or None.
        time: Time code; None means the start time code of the stage.
        variants: Selected variants in the form that ``wavecomb.load`` expects, authored in the
            session layer.
        purposes: Purposes of the geometry; None means "default" and "render".
    """

    path: Path
    camera: str | None = None
    time: float | None = None
    variants: Mapping[str, str] | None = None
    purposes: tuple[str, ...] | None = None


@dataclass(frozen=True)
class Request:
    """Request of a session to load a stage.

    Attributes:
        source: The stage and its loading options.
        usd: The USD stage, if it is already open; else None.
        overrides: Private copy of the session layer with the user's edits, or None.
        fresh: Whether to reload the layers of ``usd`` from disk first.
        threads: Number of threads that read textures; 0 uses all cores.
        textures: Textures of the previous scene, which the new scene reuses.
        size: Width and height of the rendered image, in pixels.
    """

    source: Source
    usd: Usd.Stage | None = None
    overrides: Sdf.Layer | None = None
    fresh: bool = False
    threads: int = 0
    textures: TextureCache | None = None
    size: tuple[int, int] = (600, 600)


def copied(layer: Sdf.Layer) -> Sdf.Layer:
    """Returns a private copy of a layer."""
    copy = Sdf.Layer.CreateAnonymous("overrides.usda")
    copy.TransferContent(layer)
    return copy


@dataclass(frozen=True)
class Read:
    """A stage that was loaded for the window.

    Attributes:
        stage: The loaded stage with its scene.
        usd: The USD stage that the window shows and edits.
    """

    stage: LoadedStage
    usd: Usd.Stage


def read(request: Request) -> Read:
    """Opens a stage for the window's editors, and loads a scene from a second copy of it.

    Raises:
        WavecombError: The stage cannot be rendered.
    """
    from wavecomb.usd import LoadReport, mtlx, open_editable
    from wavecomb.usd.stage.report import capture_diagnostics

    usd = request.usd
    if usd is None:
        usd = open_editable(request.source.path, request.source.variants)
    elif request.fresh:
        with capture_diagnostics(LoadReport()):
            mtlx.reload(usd)
    return Read(_load(request, _overrides(request, usd)), usd)


def _overrides(request: Request, usd: Usd.Stage) -> Sdf.Layer:
    """Returns the requested session layer; the default is the session layer of the open stage."""
    return usd.GetSessionLayer() if request.overrides is None else request.overrides


def _options(request: Request) -> dict[str, Any]:
    source = request.source
    options = {
        "frame": source.time, "camera": source.camera, "threads": request.threads,
        "editable": True, "size": request.size,
    }  # fmt: skip
    return options if source.purposes is None else {**options, "purposes": source.purposes}


def _load(request: Request, overrides: Sdf.Layer | None) -> LoadedStage:
    """Loads the scene from a second copy of the stage. The window can use its stage meanwhile."""
    from wavecomb.usd import LoadReport, load_stage, open_stage
    from wavecomb.usd.stage.report import capture_diagnostics

    said = LoadReport()
    with capture_diagnostics(said):
        stage = open_stage(request.source.path, overrides=overrides)
    loaded = load_stage(stage, reuse=request.textures, **_options(request))
    loaded.report.absorb(said)
    return loaded
