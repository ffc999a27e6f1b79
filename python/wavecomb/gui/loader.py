# SPDX-License-Identifier: Apache-2.0
"""What reading a stage for the window takes and gives. No Qt: it happens on another thread."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pxr import Sdf, Usd

from wavecomb.run.boxed.process import Process
from wavecomb.run.boxed.reader import Reader
from wavecomb.run.boxed.wanted import is_wanted
from wavecomb.usd import LoadedStage
from wavecomb.usd.looks.texture_cache import TextureCache

if TYPE_CHECKING:
    from wavecomb.usd.stage.outline import Outline


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


@dataclass(frozen=True)
class Read:
    """What was read.

    Attributes:
        stage: Its scene, and what is known beside.
        usd: The stage to look at and to edit: in memory only, where it was read in a sandbox.
        content: What its root layer is to hold from now on; None: what it holds.
    """

    stage: LoadedStage
    usd: Usd.Stage
    content: Sdf.Layer | None = None

    def settle(self) -> None:
        """Brings the content onto the stage, on the thread that owns it."""
        if self.content is not None:
            self.usd.GetRootLayer().TransferContent(self.content)


def read(request: Request) -> Read:
    """A stage and its scene.

    They are read in a sandbox. What this process then looks at and edits is a stage in memory, of
    the outline that came out: no file of the stage is opened here. With WAVECOMB_ISOLATE=0 it is
    the stage itself.

    Raises:
        WavecombError: It cannot be rendered.
    """
    return _read_elsewhere(request) if is_wanted() else _read_both_here(request)


def _overrides(request: Request, usd: Usd.Stage | None) -> Sdf.Layer | None:
    """What is to lie over the files: as asked for, or what lies over a stage that is open."""
    if request.overrides is None and usd is not None:
        return usd.GetSessionLayer()
    return request.overrides


def _read_both_here(request: Request) -> Read:
    """In this process: the stage, and another one of it that is loaded."""
    from wavecomb.usd import LoadReport, mtlx, open_editable
    from wavecomb.usd.stage.diagnostics import captured

    usd = request.usd
    if usd is None:
        usd = open_editable(request.source.path, request.source.variants)
    elif request.fresh:
        with captured(LoadReport()):
            mtlx.reload(usd)
    return Read(_read_here(request, _overrides(request, usd)), usd)


def _options(request: Request) -> dict[str, Any]:
    source = request.source
    options = {
        "frame": source.time, "camera": source.camera, "threads": request.threads,
        "editable": True, "size": request.size,
    }  # fmt: skip
    return options if source.purposes is None else {**options, "purposes": source.purposes}


def _read_elsewhere(request: Request) -> Read:
    """In a sandbox, with what a session layer holds; without one: with the variants asked for."""
    source, options = request.source, _options(request)
    overrides = _overrides(request, request.usd)
    text = None if overrides is None else overrides.ExportToString()
    if overrides is None and source.variants:
        options["variants"] = dict(source.variants)
    try:
        with Reader(source.path, process=_spare.take()) as reader:
            loaded = reader.load(options, overrides=text, reuse=request.textures, outline=True)
            assert reader.outline is not None
            return reader.checked(partial(_outlined, request, loaded, reader.outline))
    finally:
        _spare.prepare()


def _outlined(request: Request, loaded: LoadedStage, outline: Outline) -> Read:
    """A stage in memory of an outline, or what the one that is open is to hold."""
    from wavecomb.run.boxed.outline import digest
    from wavecomb.usd import LoadReport
    from wavecomb.usd.stage.diagnostics import captured
    from wavecomb.usd.stage.outline_layer import content_of, layer_of

    content = digest(outline)
    usd = request.usd
    if usd is not None and content_of(usd.GetRootLayer()) == content:
        return Read(loaded, usd)
    with captured(LoadReport()):
        layer = layer_of(outline, request.source.path, content)
        if usd is not None:
            return Read(loaded, usd, layer)
        session = Sdf.Layer.CreateAnonymous("session.usda")
        for path, name, choice in outline.selected:
            Sdf.CreatePrimInLayer(session, path).variantSelections[name] = choice
        return Read(loaded, Usd.Stage.Open(layer, session, Usd.Stage.LoadAll))


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
