# SPDX-License-Identifier: Apache-2.0
"""Tests the choice of the native library by instruction set, and equal images of all libraries."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from parts import needs, not_here, only_where

import wavecomb
from wavecomb import isa
from wavecomb.errors import WavecombError
from wavecomb.image.files.image import read_layers

V2, V3, V4 = "x86-64-v2", "x86-64-v3", "x86-64-v4"
BUILT = list(isa.libraries(wavecomb.__path__))
portable = only_where(len(BUILT) > 1, "one native library; see make test-wheel")


@pytest.mark.parametrize(
    ("built", "runnable", "forced", "chosen"),
    [
        ([V2, V3, V4], [V4, V3, V2], None, V4),
        ([V2, V3, V4], [V3, V2], None, V3),
        ([V2, V3, V4], [V2], None, V2),
        ([V2, V4], [V3, V2], None, V2),
        ([V2, V3, V4], [V4, V3, V2], V2, V2),
        ([V2, V3, V4], [V4, V3, V2], "", V4),
        (["armv8-a"], ["armv8-a"], None, "armv8-a"),
    ],
)
def test_best_that_runs(
    built: list[str], runnable: list[str], forced: str | None, chosen: str
) -> None:
    assert isa.choose(built, runnable, forced) == chosen


@pytest.mark.parametrize(
    ("built", "runnable", "forced", "message"),
    [
        ([V2, V3], [V3, V2], "avx512", "avx512 is unknown; there are x86-64-v3, x86-64-v2"),
        ([V2, V3], [V4, V3, V2], V4, "x86-64-v4 was not built; there are x86-64-v3, x86-64-v2"),
        ([V2, V3, V4], [V3, V2], V4, "this CPU does not run x86-64-v4; x86-64-v3 is the best"),
        ([V3, V4], [V2], V4, "this CPU does not run x86-64-v4; build Wavecomb on this machine"),
        ([V3, V4], [V2], None, "runs none of the libraries of this build, x86-64-v4, x86-64-v3"),
    ],
)
def test_what_cannot_be_chosen(
    built: list[str], runnable: list[str], forced: str | None, message: str
) -> None:
    with pytest.raises(WavecombError, match=re.escape(message)):
        isa.choose(built, runnable, forced)


def test_import_takes_the_chosen_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (V2, V3, V4):
        library = tmp_path / "lib" / name / f"_core{EXTENSION_SUFFIXES[0]}"
        library.parent.mkdir(parents=True)
        library.touch()
    cpu = SimpleNamespace(isas=lambda: [V3, V2])
    monkeypatch.setitem(sys.modules, "wavecomb._cpu", cpu)  # type: ignore[arg-type]
    monkeypatch.setattr(wavecomb, "_cpu", cpu, raising=False)
    monkeypatch.delenv(isa.VARIABLE, raising=False)
    places = [str(tmp_path / "elsewhere"), str(tmp_path)]
    assert list(isa.libraries(places)) == [V4, V3, V2]
    spec = isa.Finder.find_spec(isa.CORE, places)
    assert spec is not None
    assert (spec.name, Path(str(spec.origin)).parent.name) == (isa.CORE, V3)
    monkeypatch.setenv(isa.VARIABLE, V2)
    spec = isa.Finder.find_spec(isa.CORE, places)
    assert spec is not None
    assert Path(str(spec.origin)).parent.name == V2
    monkeypatch.setenv(isa.VARIABLE, V4)
    with pytest.raises(WavecombError, match="does not run x86-64-v4"):
        isa.Finder.find_spec(isa.CORE, places)


def test_import_of_one_library_is_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(isa.VARIABLE, raising=False)
    assert isa.Finder.find_spec(isa.CORE, [str(tmp_path)]) is None
    assert isa.Finder.find_spec("wavecomb.image.files.image", [str(tmp_path)]) is None
    monkeypatch.setenv(isa.VARIABLE, V3)
    with pytest.raises(WavecombError, match=r"x86-64-v3 was not built; this build has one library"):
        isa.Finder.find_spec(isa.CORE, [str(tmp_path)])


def run(*arguments: Any, library: str | None = None) -> subprocess.CompletedProcess[str]:
    environment = {name: value for name, value in os.environ.items() if name != isa.VARIABLE}
    if library is not None:
        environment[isa.VARIABLE] = library
    return subprocess.run(
        [sys.executable, "-m", "wavecomb", *(str(argument) for argument in arguments)],
        capture_output=True,
        text=True,
        timeout=100,
        env=environment,
    )


def test_one_line_for_a_wrong_name() -> None:
    pytest.importorskip("wavecomb._core")
    done = run("--version", library="x86-64-v9")
    assert (done.returncode, done.stdout) == (2, "")
    assert re.fullmatch(r"error: WAVECOMB_ISA: x86-64-v9 [^\n]+\n", done.stderr)
    assert run("--help", library="x86-64-v9").returncode == 0


def test_version_names_the_library() -> None:
    core = pytest.importorskip("wavecomb._core")
    info = isa.library_info()
    assert info["library"] == core.build_info()["library"]
    assert info["library"] in info["built"]
    assert f"(library {info['library']}" in run("--version").stdout


# ---- a portable build ----------------------------------------------------------------------------


def runnable() -> list[str]:
    from wavecomb import _cpu

    return [name for name in _cpu.isas() if name in BUILT]


@portable
@pytest.mark.parametrize("scene", ["cornell", "mixed"])
def test_pictures_of_every_library(scene: str, tmp_path: Path) -> None:
    stage = tmp_path / "stage.usdc"
    assert run("scene", scene, "-o", stage).returncode == 0
    pictures: dict[str, dict[str, np.ndarray]] = {}
    for library in runnable():
        picture, figures = tmp_path / f"{library}.exr", tmp_path / f"{library}.json"
        done = run(
            *("render", stage, "-o", picture, "--size", 96, 96, "--spp", 16),
            *("--stats", figures),
            library=library,
        )
        assert (done.returncode, done.stderr) == (0, "")
        stats = json.loads(figures.read_text())
        assert stats["machine"]["build"]["library"] == library
        assert stats["lanes"] == {V2: 4, V3: 8, V4: 16, "armv8-a": 4}[library]
        pictures[library] = read_layers(picture)
    if len(pictures) < 2:
        not_here(f"this CPU runs only {', '.join(pictures)}")
    assert {"beauty", "albedo", "normal", "depth"} <= pictures[V2].keys()
    if {V3, V4} <= pictures.keys():
        for name, layer in pictures[V3].items():
            assert layer.tobytes() == pictures[V4][name].tobytes(), name
    # x86-64-v2 has no FMA, so fma() rounds twice.
    for name, most in (("beauty", 0.06), ("albedo", 0.002), ("normal", 0.004), ("depth", 0.002)):
        assert far_apart(pictures[V2][name], pictures[V3][name]) < most, name


def far_apart(a: np.ndarray, b: np.ndarray) -> float:
    """Returns the fraction of values that differ by more than a thousandth."""
    return 1.0 - float(np.isclose(a, b, rtol=1e-3, atol=1e-6).mean())


@portable
def test_lanes_that_a_library_has_not(tmp_path: Path) -> None:
    if V3 not in runnable():
        not_here("this CPU does not run x86-64-v3")
    stage, picture = tmp_path / "stage.usdc", tmp_path / "a.exr"
    assert run("scene", "cornell", "-o", stage).returncode == 0
    done = run("render", stage, "-o", picture, "--size", 8, 8, "--lanes", 16, library=V3)
    assert done.returncode == 2
    assert (
        "lanes is 16, which the x86-64-v3 library has no kernels for; it has 1, 8. A build with "
        "WAVECOMB_LANE_WIDTHS=all (make build LANES=all) has every width"
    ) in done.stderr
    assert not picture.exists()


@portable
@needs("bin:objdump")
def test_no_library_holds_instructions_of_another() -> None:
    avx = r"%ymm|%zmm|\tv[a-z]"
    avx512 = r"%zmm|%[xy]mm(1[6-9]|2\d|3[01])|%k[0-7]"
    libraries = isa.libraries(wavecomb.__path__)
    probe = [file for place in wavecomb.__path__ for file in Path(place).glob("_cpu.*.so")]
    assert found(avx512, libraries[V4]), "the patterns find nothing where there is something"
    assert found(avx, libraries[V3])
    assert not found(avx512, libraries[V3])
    assert not found(avx, libraries[V2])
    assert not found(avx, probe[0])


def found(pattern: str, library: Path) -> bool:
    """Returns whether a line of the library's disassembly matches."""
    code = subprocess.run(
        ["objdump", "-d", "--no-show-raw-insn", library], capture_output=True, text=True, check=True
    ).stdout
    return re.search(pattern, code) is not None
