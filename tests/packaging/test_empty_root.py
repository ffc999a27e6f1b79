# SPDX-License-Identifier: Apache-2.0
"""Tests the wheel in a root file system with only Python, glibc and libstdc++.

The root has no compiler, shell, pip or network. The wheel installs from a folder of wheels. Each of
its libraries renders the same images inside the root as outside, even with a different Python
version. `make test-wheel` runs this; it needs `apt-get`.
"""

from __future__ import annotations

import json
import os
import platform
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from parts import not_here
from wheels import RENDER, ROOT, package, succeed

import wavecomb
from wavecomb import isa
from wavecomb.image.files.image import read_layers

TOOL = ROOT / "tools" / "empty_root"
NEWER = {"bookworm": "trixie", "jammy": "noble"}


def suites() -> list[str]:
    """Debian or Ubuntu suites to test: this machine's, and one with a newer Python."""
    if not (shutil.which("apt-get") and shutil.which("dpkg-deb")):
        return []
    own = succeed([ROOT / "tools" / "debs", "suite"]).strip()
    return [own, *([NEWER[own]] if own in NEWER else [])]


class Empty:
    """An empty root with Wavecomb in `/env`; `/out` is the folder `out`."""

    def __init__(self, suite: str, folder: Path) -> None:
        self.root, self.out, wheels = folder / "root", folder / "out", folder / "wheels"
        self.out.mkdir()
        succeed([TOOL, "make", self.root, suite])
        (interpreter,) = (self.root / "usr/bin").glob("python3.[0-9]*")
        collect(interpreter.name.removeprefix("python"), wheels)
        (pip,) = wheels.glob("pip-*.whl")
        self.run("/usr/bin/python3", "-m", "venv", "--without-pip", "/env")
        install = ("install", "-q", "--no-index", "--find-links", "/wheels", "wavecomb")
        self.run("/env/bin/python", f"/wheels/{pip.name}/pip", *install, binds=(wheels, "/wheels"))
        shutil.rmtree(wheels)

    def run(self, *command: str, binds: tuple[Path, str] | None = None, library: str = "") -> str:
        bound = (self.out, "/out") if binds is None else binds
        sets = ("--set", f"{isa.VARIABLE}={library}") if library else ()
        return succeed([TOOL, "run", self.root, "--bind", *bound, *sets, *command])


def collect(python: str, folder: Path) -> None:
    """Download the wheel's dependencies for a Python version, and pip."""
    newest = int(platform.libc_ver()[1].split(".")[1])
    named = (1, 2010, 2014)
    tags = [f"manylinux{n}" for n in named] + [f"manylinux_2_{n}" for n in range(5, newest + 1)]
    platforms = [f"--platform={tag}_{platform.machine()}" for tag in tags]
    options = ["-q", "--only-binary=:all:", *platforms, f"--python-version={python}"]
    wanted = ["pip", package("wavecomb-*.whl")]
    succeed(
        [sys.executable, "-m", "pip", "download", *options, "-d", folder, *wanted],
        env={**os.environ, "PIP_CONSTRAINT": str(ROOT / "constraints.txt")},
    )


def runnable() -> list[str]:
    """Names of the libraries that this CPU can run; "" if the wheel has only one library."""
    built = isa.libraries(wavecomb.__path__)
    if not built:
        return [""]
    from wavecomb import _cpu

    return [name for name in built if name in _cpu.isas()]


@pytest.fixture(scope="module", params=suites() or [""])
def empty(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Empty:
    if not request.param:
        not_here("no apt-get, of whose packages the root is made")
    return Empty(request.param, tmp_path_factory.mktemp(request.param))


def test_it_is_empty(empty: Empty) -> None:
    programs = {path.name for path in (empty.root / "usr/bin").iterdir()}
    assert not programs & {"sh", "bash", "cc", "gcc", "g++", "ld", "pip", "apt-get"}
    names = [path.name for path in (empty.root / "usr/lib").rglob("*.so*")]
    strange = (
        "libGL",
        "libX11",
        "libgomp",
        "libtbb",
        "libembree",
        "libosd",
        "libopenvdb",
        "libboost",
    )
    assert not [name for name in names if name.startswith(strange)]


def test_it_says_what_it_is(empty: Empty) -> None:
    assert wavecomb.__version__ in empty.run("/env/bin/wavecomb", "--version")


def test_pictures_are_those_of_outside(empty: Empty, tmp_path: Path) -> None:
    stage = tmp_path / "cornell.usdc"
    succeed([sys.executable, "-m", "wavecomb", "scene", "cornell", "-o", stage])
    empty.run("/env/bin/wavecomb", "scene", "cornell", "-o", "/out/cornell.usdc")
    for library in runnable():
        theirs, ours = empty.out / f"{library or 'one'}.exr", tmp_path / "ours.exr"
        outputs = (
            "-o",
            f"/out/{theirs.name}",
            "--png",
            "/out/cornell.png",
            "--stats",
            "/out/stats.json",
        )
        empty.run(
            "/env/bin/wavecomb", "render", "/out/cornell.usdc", *outputs, *RENDER, library=library
        )
        succeed(
            [sys.executable, "-m", "wavecomb", "render", stage, "-o", ours, *RENDER],
            env={**os.environ, **({isa.VARIABLE: library} if library else {})},
        )
        stats = json.loads((empty.out / "stats.json").read_text())
        assert library in ("", stats["machine"]["build"]["library"])
        assert (empty.out / "cornell.png").stat().st_size > 4000
        layers, others = read_layers(ours), read_layers(theirs)
        assert layers.keys() == others.keys()
        for name, layer in layers.items():
            assert np.array_equal(layer, others[name], equal_nan=True), f"{library}: {name}"
