# SPDX-License-Identifier: Apache-2.0
"""Renders that are stopped on their way."""

from __future__ import annotations

from typing import Any


class StopAt:
    """Stops a render after so many snapshots, and keeps the state of the last."""

    def __init__(self, snapshots: int) -> None:
        self._left = snapshots
        self.state: dict[str, Any] = {}

    def progress(self, status: dict[str, Any]) -> str:
        """Asks for a snapshot, or for the end."""
        return "snapshot" if self._left > 0 else "stop"

    def snapshot(self, snapshot: Any) -> None:
        """Keeps copies of what it holds."""
        self._left -= 1
        self.state = {
            name: value.copy() if hasattr(value, "copy") else value
            for name, value in snapshot.state().items()
        }
