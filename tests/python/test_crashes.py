# SPDX-License-Identifier: Apache-2.0
"""Tests that the output of a test run says where a worker crashed or a test hung."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BODIES = {
    "crash": ("os.abort()", "Fatal Python error: Aborted"),
    "hang": ("time.sleep(100)", "Timeout (0:00:02)!"),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", BODIES)
def test_the_stacks_are_at_the_end(tmp_path: Path, kind: str) -> None:
    body, message = BODIES[kind]
    test = tmp_path / "test_it.py"
    test.write_text(f"import os, time\n\ndef test_it():\n    {body}\n")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-n", "1", "-c", str(ROOT / "pyproject.toml"),
         "--rootdir", str(tmp_path), "--confcutdir", str(ROOT / "tests"), "-p", "conftest",
         "-o", "faulthandler_timeout=2", "--max-worker-restart", "0", str(test)],
        cwd=ROOT / "tests", capture_output=True, text=True, timeout=100,
        env={"PATH": "/usr/bin:/bin", "PYTHONPATH": str(ROOT / "tests")},
    )  # fmt: skip
    assert done.returncode == 1, done.stdout + done.stderr
    end = done.stdout.partition("= lost workers =")[2]
    assert "worker gw0:" in end and message in end, done.stdout + done.stderr
    assert "in test_it" in end
