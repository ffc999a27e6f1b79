# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the tests that need Blender's wheels (``make test-blender``)."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PYTHONS = sorted(ROOT.glob(".deps/bpy-*/bin/python"))
OUTPUT = Path(os.environ.get("WAVECOMB_PARITY", ROOT / "out" / "blender"))


@pytest.fixture(params=PYTHONS, ids=lambda path: path.parts[-3])
def blender(request: pytest.FixtureRequest) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Returns a function that runs a Python script in Blender, for each Blender version."""

    def run(*words: str, **variables: str) -> subprocess.CompletedProcess[str]:
        environment = {**os.environ, "WAVECOMB": str(Path(sys.prefix, "bin", "wavecomb"))}
        return subprocess.run(
            [str(request.param), "-W", "ignore", *words], text=True, capture_output=True,
            env={**environment, **variables}, timeout=1800, check=False,
        )  # fmt: skip

    return run
