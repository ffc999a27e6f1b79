# SPDX-License-Identifier: Apache-2.0
"""Reads stages on a thread of its own, one after the other; only the newest counts."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pxr import Sdf, Usd

from wavecomb.run.faults import describe
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
    """Work for the loader.

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


class Loader:
    """The thread.

    Args:
        done: Called on it with the request, the stage that is open and what was read.
        failed: Called on it with the request and one line.
    """

    def __init__(
        self,
        done: Callable[[Request, Usd.Stage, LoadedStage], None],
        failed: Callable[[Request, str], None],
    ) -> None:
        self._done = done
        self._failed = failed
        self._condition = threading.Condition()
        self._request: Request | None = None
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="wavecomb-load", daemon=True)
        self._thread.start()

    def want(self, request: Request) -> None:
        """Reads this next, in place of what waits."""
        with self._condition:
            self._request = request
            self._condition.notify_all()

    def close(self, seconds: float = 0.5) -> None:
        """Ends the thread after the stage that it is at; does not wait longer than this."""
        with self._condition:
            self._request, self._closing = None, True
            self._condition.notify_all()
        self._thread.join(seconds)

    def _run(self) -> None:
        while True:
            with self._condition:
                while self._request is None and not self._closing:
                    self._condition.wait()
                if self._closing:
                    return
                request, self._request = self._request, None
            assert request is not None
            try:
                usd, loaded = read(request)
            except Exception as error:
                if not self._closing:
                    self._failed(request, describe(error))
            else:
                if not self._closing:
                    self._done(request, usd, loaded)


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
