# SPDX-License-Identifier: Apache-2.0
"""Tests that a C++ program can find, compile and run the installed core as in the README."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from parts import not_here

from wavecomb.image.files.image import read_image

ROOT = Path(__file__).resolve().parents[2]
BUILD = ROOT / "build" / "editable"
TOOLS = ROOT / ".venv" / "bin"


def run(*words: object, cwd: Path = ROOT) -> str:
    done = subprocess.run(
        [str(word) for word in words], capture_output=True, text=True, cwd=cwd, check=False
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return done.stdout


@pytest.mark.slow
def test_the_example_of_the_readme(tmp_path: Path) -> None:
    cmake = TOOLS / "cmake"
    if not (cmake.exists() and (BUILD / "libwavecomb.a").exists() and shutil.which("g++")):
        not_here("the core that make build makes")
    prefix, folder = tmp_path / "prefix", tmp_path / "build"
    run(cmake, "--install", BUILD, "--component", "dev", "--prefix", prefix)
    example = tmp_path / "cpp"
    shutil.copytree(ROOT / "examples" / "cpp", example)
    source = (example / "render_sphere.cpp").read_text("utf-8")
    assert source.count("settings.spp = 64;") == 1
    fewer = source.replace("settings.spp = 64;", "settings.spp = 8;")
    (example / "render_sphere.cpp").write_text(fewer, "utf-8")
    # The example only calls the library, so that optimising it takes longer than it saves.
    flags = "-DCMAKE_CXX_FLAGS_RELEASE=-O0 -DNDEBUG"
    run(cmake, "-S", example, "-B", folder, f"-DCMAKE_PREFIX_PATH={prefix}", flags)
    run(cmake, "--build", folder)
    said = run(folder / "example_render_sphere", cwd=tmp_path)
    assert "million samples/s" in said
    picture = read_image(tmp_path / "sphere.ppm")
    assert picture.shape == (256, 256, 3) and np.isfinite(picture).all()
    red, floor = picture[100:150, 100:150].mean((0, 1)), picture[230:250, 20:60].mean((0, 1))
    assert red[0] > 2 * red[2] and np.ptp(floor) < 0.2 * floor.max()
