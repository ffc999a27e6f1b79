# SPDX-License-Identifier: Apache-2.0
"""Which units of the library a change in one program compiles, as the build has written it down."""

from __future__ import annotations

import re
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
PROGRAMS = ROOT / "src" / "wavecomb" / "scene" / "programs.h"
VARIANTS = ROOT / "src" / "wavecomb" / "scene" / "material_parts.h"


@pytest.fixture(scope="module")
def units_of() -> dict[str, set[str]]:
    """Objects of the library by each header of a program that they include."""
    ninja = Path(sys.executable).with_name("ninja")
    if not ninja.exists() or not (BUILD / ".ninja_deps").exists():
        not_here("the library was not built by make build")
    deps = subprocess.run([ninja, "-C", BUILD, "-t", "deps"], capture_output=True, text=True)
    found: dict[str, set[str]] = defaultdict(set)
    unit = ""
    for line in deps.stdout.splitlines():
        if line and not line.startswith(" "):
            name, _, state = line.partition(": ")
            unit = name if "(VALID)" in state and name.startswith("CMakeFiles/") else ""
        elif unit and "/material/programs/" in line:
            found[Path(line.strip()).stem].add(Path(unit).name)
    return found


@pytest.mark.parametrize("program", sorted(path.stem for path in HEADERS.glob("*.h")))
def test_a_program_is_in_its_own_units_alone(units_of: dict[str, set[str]], program: str) -> None:
    widths = {1, *_core.lane_widths()}
    full = {f"{program}_{width}.cpp.o" for width in widths}
    rows = re.findall(r"^ *X\((\w+), (\w+),", VARIANTS.read_text("utf-8"), re.MULTILINE)
    listed = re.findall(r"^ *[XP]\((\w+), ", PROGRAMS.read_text("utf-8"), re.MULTILINE)
    assert set(listed) == {path.stem for path in HEADERS.glob("*.h")}
    rows += [(name, name) for name in listed]
    plain = {f"plain_{name}_{max(widths)}.cpp.o" for name, of in rows if of == program}
    assert plain
    joint = {f"joint_{program}_{width}.cpp.o" for width in (1, max(widths))}
    assert units_of[program] == full | plain | joint
