# SPDX-License-Identifier: Apache-2.0
"""Until the core has Renderer: the same interface over ``_core.render``, without edits."""

from __future__ import annotations

from typing import Any

import numpy as np

from wavecomb import _core


class _Snapshot:
    def __init__(self, snapshot: Any) -> None:
        self._snapshot = snapshot
        self.finished = snapshot.finished
        self.status = snapshot.status
        self.stats: dict[str, Any] = {}

    def beauty(self) -> Any:
        return self._snapshot.beauty()

    def samples(self) -> Any:
        return np.ones(self._snapshot.beauty().shape[:2], np.uint32)

    def layer(self, name: str) -> Any:
        return None


class _Watch:
    def __init__(self, renderer: Any, watcher: Any) -> None:
        self._renderer, self._watcher = renderer, watcher

    def progress(self, status: Any) -> Any:
        return "stop" if self._renderer.stopped else self._watcher.progress(status)

    def snapshot(self, snapshot: Any) -> None:
        self._watcher.snapshot(_Snapshot(snapshot))


class Renderer:
    def __init__(self, scene: Any, threads: int = 0) -> None:
        self.scene, self.version, self.stopped = scene, 0, False

    def edit(self, **edits: Any) -> None:
        self.version += 1

    def render(self, settings: Any, watcher: Any = None, interval: float = 0.1) -> Any:
        self.stopped = False
        return _core.render(self.scene, settings, watcher=_Watch(self, watcher))

    def stop(self) -> None:
        self.stopped = True

    def twin(self) -> Renderer:
        return Renderer(self.scene)

    def pick(self, x: float, y: float, width: int, height: int) -> dict[str, Any] | None:
        return None
