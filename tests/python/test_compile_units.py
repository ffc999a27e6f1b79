# SPDX-License-Identifier: Apache-2.0
"""Tests which compilation units depend on each shading program, by build dependencies."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

import pytest
from parts import not_here

from wavecomb import _core

ROOT = Path(__file__).resolve().parents[2]
BUILD = ROOT / "build" / "editable"
HEADERS = ROOT / "src" / "wavecomb" / "material" / "programs"
PROGRAMS = ROOT / "src" / "wavecomb" / "material" / "description" / "programs.h"
MATRIX = ROOT / "src" / "wavecomb" / "wave" / "kernels" / "kernel_matrix.h"
WALLS = {"openpbr": {"openpbr_wall.cpp.o"}}
"""Units besides kernels that depend on a program."""
OBJECT = re.compile(r"_(\d+)(?:_cxx\.cxx|\.cpp)\.o$")
"""Name of the object file of a kernel, with its lane width."""
VARIANTS = ROOT / "src" / "wavecomb" / "material" / "description" / "variants.h"


@pytest.fixture(scope="module")
def units_with(tmp_path_factory: pytest.TempPathFactory) -> dict[str, set[str]]:
    """Maps each source file of the core to the object files that include it."""
    ninja = Path(sys.executable).with_name("ninja")
    if not ninja.exists() or not (BUILD / ".ninja_deps").exists():
        not_here("the library was not built by make build")
    # Ninja repairs logs that it opens, and another Ninja may be building the C++ tests, so use a
    # copy of the logs.
    folder = tmp_path_factory.mktemp("build")
    for entry in BUILD.iterdir():
        if entry.name.startswith(".ninja_"):
            shutil.copyfile(entry, folder / entry.name)
        else:
            (folder / entry.name).symlink_to(entry)
    deps = subprocess.run([ninja, "-C", folder, "-t", "deps"], capture_output=True, text=True)
    found: dict[str, set[str]] = defaultdict(set)
    unit = ""
    for line in deps.stdout.splitlines():
        if line and not line.startswith(" "):
            name, _, state = line.partition(": ")
            unit = name if "(VALID)" in state and name.startswith("CMakeFiles/") else ""
        elif unit and "/src/wavecomb/" in line:
            found[line.partition("/src/wavecomb/")[2].strip()].add(Path(unit).name)
    return found


@pytest.fixture(scope="module")
def units_of(units_with: dict[str, set[str]]) -> dict[str, set[str]]:
    """Maps each shading program to the object files that include it."""
    folder = "material/programs/"
    return {
        name.removeprefix(folder).removesuffix(".h"): units
        for name, units in units_with.items()
        if name.startswith(folder)
    }


def kernel_rows() -> list[tuple[str, str, str, str]]:
    """Returns kind, set, widths and sanitizer widths of each row of WAVECOMB_KERNELS."""
    text = MATRIX.read_text("utf-8")
    rows = re.findall(r"^ *X\((\w+), (\w+), (\w+), (\w+), \"", text, re.MULTILINE)
    assert {row[0] for row in rows} == {"program", "light", "plain"}
    return rows


@pytest.mark.parametrize("program", sorted(path.stem for path in HEADERS.glob("*.h")))
def test_a_program_is_in_its_own_units_alone(units_of: dict[str, set[str]], program: str) -> None:
    widths = {1, *_core.lane_widths()}
    of_word = {"every": widths, "ends": {1, max(widths)}, "widest": {max(widths)}, "scalar": {1}}
    rows = re.findall(r"^ *X\((\w+), (\w+),", VARIANTS.read_text("utf-8"), re.MULTILINE)
    listed = re.findall(r"^ *[XP]\((\w+), ", PROGRAMS.read_text("utf-8"), re.MULTILINE)
    assert set(listed) == {path.stem for path in HEADERS.glob("*.h")}
    members = {"programs": [program], "variants": [program]}
    members["variants"] += [name for name, of in rows if of == program]
    kernels = {
        f"{kind}_{member}_{width}.cpp"
        for kind, among, word, _ in kernel_rows()
        for member in members[among]
        for width in of_word[word]
    }
    others = WALLS.get(program, set())
    # Objects of other lane widths remain in the build folder after make build LANES=all.
    objects = {
        unit
        for unit in units_of[program] - others
        if (found := OBJECT.search(unit)) is None or int(found[1]) in widths
    }
    assert objects | others <= units_of[program]
    folders = BUILD.glob("CMakeFiles/wavecomb_core_*.dir/Unity")
    unity = [path for name in folders for path in name.glob(f"unity_{program}_*_cxx.cxx")]
    if not unity:  # WAVECOMB_BATCH=OFF
        assert objects == {f"{kernel}.o" for kernel in kernels}
        return
    # The kernels of a program and a lane width are one unity file. Each kernel defines
    # WAVECOMB_LANES, so that a file of two widths does not compile.
    of_widths = {f"unity_{program}_{kernel.rpartition('_')[2]}" for kernel in kernels}
    assert objects == {name.replace(".cpp", "_cxx.cxx.o") for name in of_widths}
    for path in unity:
        width = path.name.split("_")[-2]
        included = re.findall(r'^#include ".*/lanes/(.*)"', path.read_text("utf-8"), re.MULTILINE)
        assert included and all(unit.endswith(f"_{width}.cpp") for unit in included)


def test_kernels_of_all_lane_widths_are_separate_units(tmp_path: Path) -> None:
    # make test compiles two widths only. Each unit defines WAVECOMB_LANES, so that a unity file of
    # two widths does not compile.
    cmake = Path(sys.executable).with_name("cmake")
    if not cmake.exists():
        not_here("the library was not built by make build")
    options = ["-DWAVECOMB_LANE_WIDTHS=all", "-DWAVECOMB_BATCH=ON", "--log-level=ERROR"]
    subprocess.run([cmake, "-S", ROOT, "-B", tmp_path, "-G", "Ninja", *options], check=True)
    included: dict[str, set[str]] = defaultdict(set)
    for path in tmp_path.glob("CMakeFiles/wavecomb_core_*.dir/Unity/unity_*_cxx.cxx"):
        for width in re.findall(
            r'^#include ".*/lanes/.*_(\d+)\.cpp"', path.read_text(), re.MULTILINE
        ):
            included[path.name].add(width)
    assert {"1", "4"} <= set.union(*included.values())
    assert all(len(widths) == 1 for widths in included.values()), included


BODIES = ("guiding/lookup.inl", "graph/run.inl", "material/inputs/graph_inputs.inl",
          "texture/lookup.inl", "material/inputs/inputs.inl", "geometry/hit/motion.inl",
          "light/sampling/light_sample.inl", "light/emission/emission.inl",
          "geometry/hit/curve_surface.inl")  # fmt: skip


@pytest.mark.parametrize("body", BODIES)
def test_a_shared_body_is_compiled_once_per_width(
    units_with: dict[str, set[str]], body: str
) -> None:
    units = {unit for unit in units_with[body] if "/tests/" not in unit}
    widths = {1, *_core.lane_widths()}
    few = {"guiding/lookup.inl": 1, "texture/lookup.inl": 1, "graph/run.inl": 1}
    assert units >= {f"all_shared_{width}.cpp.o" for width in widths}
    assert len(units) <= len(widths) + few.get(body, 0), units
