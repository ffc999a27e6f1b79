# SPDX-License-Identifier: Apache-2.0
"""Test files in .nvdb format, written by NanoVDB (tests/nanovdb)."""

from __future__ import annotations

import functools
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from wavecomb import vdb

ROOT = Path(__file__).resolve().parents[2]


@functools.cache
def writer() -> Path | None:
    """Returns the program that writes .nvdb files, or None if it is not built."""
    found = sorted(ROOT.glob("build/*/tests/nanovdb/wavecomb_nvdb_writer"))
    return found[0] if found else None


def needs_nvdb() -> pytest.MarkDecorator:
    """Returns a mark for tests that read .nvdb files, skipped in builds without NanoVDB."""
    from parts import NOT_HERE

    if not vdb.nano_version():
        return pytest.mark.skip(reason=NOT_HERE + "this build is without NanoVDB")
    reason = "needs wavecomb_nvdb_writer: make build-test-tools"
    return pytest.mark.skipif(writer() is None, reason=reason)


def write(path: str | Path, grids: Sequence[Mapping[str, Any]], packed: str = "none") -> None:
    """Writes grids given as for ``vdb.write``. Equal grids give equal bytes.

    Args:
        path: Output file.
        grids: Grids as for ``vdb.write``. The entry ``bits`` ("4", "8", "16" or "n") quantises the
            values of each leaf. Half-precision grids are not supported.
        packed: Compression, which is "none", "zip" or "blosc".
    """
    program = writer()
    assert program is not None
    with tempfile.TemporaryDirectory() as folder:
        words: list[str] = []
        for number, grid in enumerate(grids):
            part = Path(folder, f"{number}.vdb")
            vdb.write(part, [grid])
            words += [str(grid.get("bits", "32")), str(part)]
        subprocess.run([program, str(path), packed, *words], check=True, timeout=120)
