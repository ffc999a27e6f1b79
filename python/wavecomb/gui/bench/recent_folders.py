# SPDX-License-Identifier: Apache-2.0
"""Results folders that were opened before."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from PySide6.QtCore import QSettings

_KEY = "bench/folders"
MOST = 10


def recent_folders() -> list[Path]:
    """Those that are still there, newest first."""
    stored: Any = QSettings("Wavecomb", "Wavecomb").value(_KEY, [])
    names = [stored] if isinstance(stored, str) else list(stored or [])
    return [Path(name) for name in names if (Path(name) / "runs.csv").is_file()]


def remember_folder(path: Path) -> None:
    """Puts it first."""
    kept = [path.resolve(), *(p for p in recent_folders() if p != path.resolve())]
    QSettings("Wavecomb", "Wavecomb").setValue(_KEY, [str(p) for p in kept[:MOST]])
