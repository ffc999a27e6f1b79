# SPDX-License-Identifier: Apache-2.0
"""What reading a stage for the window takes and gives. No Qt: it happens on another thread."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pxr import Sdf, Usd

from wavecomb.run.boxed.process import Process
from wavecomb.run.boxed.reader import Reader, is_wanted
from wavecomb.usd import LoadedStage
from wavecomb.usd.looks.texture_cache import TextureCache


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
    textures: TextureCache | None = None
    size: tuple[int, int] = (600, 600)


def copied(layer: Sdf.Layer) -> Sdf.Layer:
    """A layer with the same content that nobody else has."""
    copy = Sdf.Layer.CreateAnonymous("overrides.usda")
    copy.TransferContent(layer)
    return copy


class Spare:
    """A process that waits to read a stage: USD's libraries are there when one is asked for."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: Process | None = None

    def take(self) -> Process | None:
        """The process, if there is one."""
        with self._lock:
            process, self._process = self._process, None
        return process if process is not None and process.is_alive() else None

    def prepare(self) -> None:
        """Starts one, if there is none; it ends with this program."""
        with self._lock:
            if self._process is None:
                self._process = Process()


_spare = Spare()


def read(request: Request) -> tuple[Usd.Stage, LoadedStage]:
    """The stage, open, and its scene.

    The scene is read in a sandbox, before this process opens anything: what it then looks at and
    edits was composed there. Images, and files that the stage names in values, are read there only.

    Raises:
        WavecombError: It cannot be rendered.
    """
    from wavecomb.usd import LoadReport, mtlx, open_editable
    from wavecomb.usd.stage.diagnostics import captured

    usd, loaded = request.usd, None
    if is_wanted() and (usd is None or request.fresh):
        overrides = request.overrides
        if overrides is None and usd is not None:
            overrides = usd.GetSessionLayer()
        loaded = _read_elsewhere(request, overrides)
    if usd is None:
        usd = open_editable(request.source.path, request.source.variants)
    elif request.fresh:
        with captured(LoadReport()):
            mtlx.reload(usd)
    overrides = request.overrides if request.overrides is not None else usd.GetSessionLayer()
    if loaded is None:
        how = _read_elsewhere if is_wanted() else _read_here
        loaded = how(request, overrides)
    return usd, loaded


def _options(request: Request) -> dict[str, Any]:
    source = request.source
    options = {
        "frame": source.time, "camera": source.camera, "threads": request.threads,
        "editable": True, "size": request.size,
    }  # fmt: skip
    return options if source.purposes is None else {**options, "purposes": source.purposes}


def _read_elsewhere(request: Request, overrides: Sdf.Layer | None) -> LoadedStage:
    """The scene of a file, with what a session layer holds; None: with the variants asked for."""
    source, options = request.source, _options(request)
    text = None if overrides is None else overrides.ExportToString()
    if overrides is None and source.variants:
        options["variants"] = dict(source.variants)
    try:
        with Reader(source.path, process=_spare.take()) as reader:
            return reader.load(options, overrides=text, reuse=request.textures)
    finally:
        _spare.prepare()


def _read_here(request: Request, overrides: Sdf.Layer | None) -> LoadedStage:
    """Likewise, in this process."""
    from wavecomb.usd import LoadReport, load_stage, open_stage
    from wavecomb.usd.stage.diagnostics import captured

    said = LoadReport()
    with captured(said):
        # A stage of its own, so that the window can go on with the other.
        stage = open_stage(request.source.path, overrides=overrides)
    loaded = load_stage(stage, reuse=request.textures, **_options(request))
    loaded.report.absorb(said)
    return loaded
