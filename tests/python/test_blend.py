# SPDX-License-Identifier: Apache-2.0
"""``wavecomb render scene.blend`` without Blender: search for Blender, and a fake Blender.

``tests/blender`` has the tests with Blender.
"""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from wavecomb import blend
from wavecomb.errors import WavecombError

FAKE = """#!{python}
import json, sys
words = sys.argv[sys.argv.index("--") + 1:]
assert "--disable-autoexec" in sys.argv
open(words[1] + "/stage.usda", "w").write('#usda 1.0\\n\\ndef Sphere "ball" {{}}\\n')
row = {{"stage": words[1] + "/stage.usda", "options": [], "messages": ["not supported: bump: m"]}}
json.dump(row, open(words[1] + "/stage.json", "w"))
"""


def _render(folder: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "-m", "wavecomb", "render", "a.blend", "-o", "a.exr", "--spp", "1"]
    return subprocess.run(
        [*words, "--size", "16x16"], cwd=folder, env={**os.environ, **variables},
        capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_a_missing_blender_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "a.blend").write_bytes(b"")
    done = _render(tmp_path, WAVECOMB_BLENDER=str(tmp_path / "none"))
    assert done.returncode == 2
    assert done.stderr.strip().splitlines() == [
        f"error: WAVECOMB_BLENDER: {tmp_path / 'none'} is not a program"
    ]


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(WavecombError, match="no such file"):
        blend.export(str(tmp_path / "a.blend"), str(tmp_path), None)


@pytest.mark.slow
def test_renders_the_exported_stage(tmp_path: Path) -> None:
    program = tmp_path / "blender"
    program.write_text(FAKE.format(python=sys.executable))
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    (tmp_path / "a.blend").write_bytes(b"")
    done = _render(tmp_path, WAVECOMB_BLENDER=str(program))
    assert done.returncode == 0, done.stderr
    assert "not supported: bump: m" in done.stderr
    assert (tmp_path / "a.exr").exists()
