# SPDX-License-Identifier: Apache-2.0
"""Watcher of a full-size render, which sends its frames and can pause and stop it."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from wavecomb.gui.setup import Setup
from wavecomb.gui.viewport.frames import Frame, layers_of_snapshot
from wavecomb.gui.viewport.previews import Filler

if TYPE_CHECKING:
    from wavecomb._core import Snapshot

LOOK_S = 0.03
STATISTICS_S = 0.5


Host = Any
"""Type of an ``engine.Engine``. This module cannot import the class, since ``engine`` imports this
module."""


class Watch:
    """Watcher of a full-size render, which sends its frames and can pause and stop it."""

    def __init__(self, engine: Host, setup: Setup, version: int, filler: Filler) -> None:
        self._engine = engine
        self._setup, self._version = setup, version
        self._filler = filler
        self.held_s = 0.0
        """Total time for which the render was paused, in seconds."""
        self._next = 0.0
        self._next_statistics = time.perf_counter() + 0.25
        self._begun = time.perf_counter()

    def progress(self, status: Mapping[str, Any]) -> str | None:
        """Render callback: requests that the render stops, that it takes a snapshot, or neither."""
        engine = self._engine
        if engine.superseded:
            return "stop"
        if engine.paused or time.perf_counter() >= self._next:
            return "snapshot" if status["samples_done"] else None
        return None

    def snapshot(self, snapshot: Snapshot) -> None:
        """Snapshot callback: sends a frame, and waits while the engine is paused."""
        if snapshot.finished or self._engine.superseded:
            return
        start = time.perf_counter()
        said = self._send(snapshot)
        now = time.perf_counter()
        # Limit the time for making snapshots to a tenth of the render time, but make at least one
        # snapshot per second.
        pause = max(10.0 * (now - start), 0.1 if now - self._begun < 5.0 else 0.4)
        self._next = now + min(pause, 1.0)
        if self._engine.paused:
            # The render was paused while the last frame was made, so send a frame that states the
            # pause.
            if not said:
                self._send(snapshot)
            self._stand_still()

    def _stand_still(self) -> None:
        start = time.perf_counter()
        while self._engine.paused and not self._engine.superseded:
            self._engine.wait(0.02)
        self.held_s += time.perf_counter() - start

    def _send(self, snapshot: Snapshot) -> bool:
        """Sends a frame. Returns whether the frame's status is paused."""
        paused = self._engine.paused
        layers = layers_of_snapshot(snapshot, self._setup.layers())
        status = {**snapshot.status, "paused": paused}
        frame = Frame(snapshot.beauty(), layers, None, status, self._version, 1, False, self._setup)
        self._engine.listener.on_frame(self._filler.fill(frame))
        now = time.perf_counter()
        if now >= self._next_statistics or paused:
            self._next_statistics = now + STATISTICS_S
            statistics = self._engine.statistics_of(_SoFar(snapshot), self.held_s)
            self._engine.listener.on_statistics(statistics, self._version)
        return paused


class _SoFar:
    """Adapter that gives a snapshot the attributes of a result that ``make_stats`` reads."""

    cancelled = False

    def __init__(self, snapshot: Snapshot) -> None:
        self.stats = snapshot.stats
