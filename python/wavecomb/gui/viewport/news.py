# SPDX-License-Identifier: Apache-2.0
"""What a render thread has to tell. No Qt: the thread keeps it."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wavecomb._core import Renderer
    from wavecomb.gui.bridge import Port
    from wavecomb.gui.viewport.frames import Frame


class News:
    """An ``engine.Listener`` that keeps the newest of each kind until somebody takes them.

    Args:
        told: Gets None when there are news where there were none.
    """

    def __init__(self, told: Port) -> None:
        self._told = told
        self._lock = threading.Lock()
        self._news: dict[tuple[str, str], Any] = {}

    def take(self) -> list[tuple[str, Any]]:
        """Kind and content, in the order in which they came."""
        with self._lock:
            news, self._news = self._news, {}
        return [(kind, content) for (kind, _), content in news.items()]

    def _put(self, kind: str, content: Any, apart: str = "") -> None:
        with self._lock:
            first = not self._news
            self._news.pop((kind, apart), None)
            self._news[(kind, apart)] = content
        if first:
            self._told.send(None)

    # ---- on the render thread ------------------------------------------------------------------

    def on_frame(self, frame: Frame) -> None:
        """A picture."""
        self._put("frame", frame)

    def on_statistics(self, statistics: dict[str, Any], version: int) -> None:
        """Figures so far, and the version that they are of."""
        self._put("statistics", (statistics, version))

    def on_failed(self, message: str) -> None:
        """An error; others stay."""
        self._put("failed", message, message)

    def on_ready(self, renderer: Renderer) -> None:
        """The renderer of a new scene."""
        self._put("ready", renderer)
