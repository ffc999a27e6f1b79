# SPDX-License-Identifier: Apache-2.0
"""Tests that the source distribution of `make sdist` builds in a separate folder.

The installed package renders the same image as this build. `make test-sdist` runs this.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from parts import needs
from wheels import RENDER, ROOT, package, succeed

from wavecomb.image.files.image import read_layers


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sdist")
    shutil.unpack_archive(package("wavecomb-*.tar.gz"), folder)
    (unpacked,) = folder.iterdir()
    return unpacked


def test_it_holds_the_sources_and_no_more(sources: Path) -> None:
    for name in (
        "LICENSE",
        "README.md",
        "CMakeLists.txt",
        "tools/setup_embree",
        "src",
        "bindings",
        "python",
        "tests",
    ):
        assert (sources / name).exists(), name
    for name in (".deps", ".venv", ".git", "build", "out", "dist"):
        assert not (sources / name).exists(), name


def test_without_a_compiler_it_says_what_to_install(sources: Path, tmp_path: Path) -> None:
    pip = [sys.executable, "-m", "pip"]
    done = subprocess.run(
        [*pip, "wheel", "--no-build-isolation", "--no-deps", "-w", tmp_path, "."],
        cwd=sources,
        env={**os.environ, "CXX": "/nowhere/c++"},
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode != 0
    said = " ".join((done.stdout + done.stderr).split())
    assert "No C++ compiler was found." in said, said
    assert "install g++" in said


@needs("wavecomb._core")
def test_it_builds_and_renders(sources: Path, tmp_path: Path) -> None:
    # Reuse the dependencies that tools/setup_embree would stage again.
    (sources / ".deps").symlink_to(ROOT / ".deps")
    # Build one lane width with little optimisation, because only the build matters here.
    defines = {
        "WAVECOMB_LANE_WIDTHS": "1",
        "WAVECOMB_BATCH": "ON",
        "CMAKE_CXX_FLAGS_RELEASE": "-O1 -DNDEBUG",
    }
    if shutil.which("ccache"):
        defines["CMAKE_CXX_COMPILER_LAUNCHER"] = "ccache"
    settings = [f"--config-settings=cmake.define.{name}={value}" for name, value in defines.items()]
    pip = [sys.executable, "-m", "pip"]
    succeed(
        [*pip, "wheel", "-q", "--no-build-isolation", "--no-deps", "-w", tmp_path, ".", *settings],
        cwd=sources,
    )
    (wheel,) = tmp_path.glob("wavecomb-*.whl")
    # Create a new environment with its dependencies: oneTBB is in the environment's lib folder.
    environment = tmp_path / "env"
    succeed([sys.executable, "-m", "venv", "--without-pip", environment])
    python = environment / "bin/python"
    succeed([*pip, "--python", python, "install", "-q", "-c", ROOT / "constraints.txt", wheel])
    stage, picture, ours = (tmp_path / name for name in ("cornell.usdc", "theirs.exr", "ours.exr"))
    succeed([python, "-m", "wavecomb", "scene", "cornell", "-o", stage], cwd=tmp_path)
    succeed([python, "-m", "wavecomb", "render", stage, "-o", picture, *RENDER], cwd=tmp_path)
    succeed([sys.executable, "-m", "wavecomb", "render", stage, "-o", ours, *RENDER], cwd=tmp_path)
    layers, others = read_layers(ours), read_layers(picture)
    assert layers.keys() == others.keys()
    for name, layer in layers.items():
        assert np.array_equal(layer, others[name], equal_nan=True), name
