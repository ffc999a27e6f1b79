# SPDX-License-Identifier: Apache-2.0
"""Tests the edits of faults.py, which reintroduce faults: they match the sources and compile."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest
import syntax
from faults import FAULTS, ROOT, without_fixes

FILES = sorted({change[0] for fault in FAULTS for change in fault.changes})
USE = """#include "wavecomb/light_paths/coupling.h"
#include "wavecomb/material/programs/openpbr.h"
#include "wavecomb/path/vertex.h"
namespace wavecomb {
template VertexResult<float> shade_vertex<OpenPbrBsdf<float>, float, kEverything, LightPaths>(
    const Vertex<float>&, LightPaths::Coupling<float>&);
}
"""


@pytest.mark.parametrize("name", FILES)
def test_each_edit_matches_once(name: str) -> None:
    text = (ROOT / name).read_text("utf-8")
    assert without_fixes(text, name) != text
    for fault in FAULTS:
        for _, fixed, faulty in (change for change in fault.changes if change[0] == name):
            assert fixed != faulty
            with pytest.raises(ValueError, match="adapt"):
                without_fixes(text.replace(fixed, ""), name)


@pytest.mark.slow
def test_edited_sources_compile(tmp_path: Path) -> None:
    """The edited headers compile for a program with transmission and subsurface scattering."""
    shutil.copytree(ROOT / "src", tmp_path / "src")
    for name in FILES:
        path = tmp_path / name
        path.write_text(without_fixes(path.read_text("utf-8"), name), "utf-8")
    (tmp_path / "use.cpp").write_text(USE)
    words = [*syntax.command(), "-I", str(tmp_path / "src"), str(tmp_path / "use.cpp")]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
