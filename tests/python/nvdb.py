# SPDX-License-Identifier: Apache-2.0
""".nvdb files for tests, written by NanoVDB's own code (tests/nanovdb)."""

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
    """The program that writes them; None: it is not built."""
    found = sorted(ROOT.glob("build/*/tests/nanovdb/wavecomb_nvdb_writer"))
    return found[0] if found else None


def needs_nvdb() -> pytest.MarkDecorator:
    """Marks tests that read .nvdb files; those of a build without NanoVDB may skip them."""
    from parts import NOT_HERE

    if not vdb.nano_version():
        return pytest.mark.skip(reason=NOT_HERE + "this build is without NanoVDB")
    reason = "needs wavecomb_nvdb_writer: make build-test-tools"
    return pytest.mark.skipif(writer() is None, reason=reason)


def write(path: str | Path, grids: Sequence[Mapping[str, Any]], packed: str = "none") -> None:
    """Writes grids as ``vdb.write`` takes them; the same grids give the same bytes.

    Args:
        path: Of the file.
        grids: With ``bits`` ("4", "8", "16", "n") numbers are quantised by leaf. There are no
            halves.
        packed: "none", "zip" or "blosc".
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
