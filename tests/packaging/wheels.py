# SPDX-License-Identifier: Apache-2.0
"""What tests of packages share: where packages are, and renders by an installed Wavecomb."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
RENDER = ("--size", "96", "96", "--spp", "16")


def package(pattern: str) -> Path:
    """The one package in `dist` that matches."""
    found = sorted((ROOT / "dist").glob(pattern))
    names = [path.name for path in found]
    assert len(found) == 1, f"dist/{pattern}: {names}; make wheels, make sdist"
    return found[0]


def succeed(command: Sequence[str | Path], **options: object) -> str:
    """What a command prints, which has to end well."""
    done = subprocess.run(command, capture_output=True, text=True, timeout=3000, **options)  # type: ignore[call-overload]
    assert done.returncode == 0, f"{command}\n{done.stdout[-3000:]}\n{done.stderr[-6000:]}"
    return str(done.stdout)
