# SPDX-License-Identifier: Apache-2.0
"""Shared code of packaging tests: location of packages, and renders by an installed Wavecomb."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RENDER = ("--size", "96", "96", "--spp", "16")


def package(pattern: str) -> Path:
    """Return the only package in `dist` that matches."""
    found = sorted((ROOT / "dist").glob(pattern))
    names = [path.name for path in found]
    assert len(found) == 1, f"dist/{pattern}: {names}; make wheels, make sdist"
    return found[0]


def succeed(command: Sequence[str | Path], **options: object) -> str:
    """Run a command that must succeed, and return its output."""
    done = subprocess.run(command, capture_output=True, text=True, timeout=3000, **options)  # type: ignore[call-overload]
    assert done.returncode == 0, f"{command}\n{done.stdout[-3000:]}\n{done.stderr[-6000:]}"
    return str(done.stdout)
