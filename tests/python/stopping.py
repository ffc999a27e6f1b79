# SPDX-License-Identifier: Apache-2.0
"""Watchers that stop renders early."""

from __future__ import annotations

from typing import Any


class StopAt:
    """Stops a render after a number of snapshots and keeps the last state."""

    def __init__(self, snapshots: int) -> None:
        self._left = snapshots
        self.state: dict[str, Any] = {}

    def progress(self, status: dict[str, Any]) -> str:
        """Requests a snapshot, or stops the render."""
        return "snapshot" if self._left > 0 else "stop"

    def snapshot(self, snapshot: Any) -> None:
        """Copies the state of the render."""
        self._left -= 1
        self.state = {
            name: value.copy() if hasattr(value, "copy") else value
            for name, value in snapshot.state().items()
        }
