# SPDX-License-Identifier: Apache-2.0
r"""Count instructions per shaded hit with valgrind, independent of the load of the machine.

    .venv/bin/python benchmarks/instructions.py cornell.usda                # this tree
    .venv/bin/python benchmarks/instructions.py cornell.usda ../old ../new  # others for comparison

valgrind does not support AVX-512, so a source tree must be built for an older instruction set:

    .venv/bin/python -m pip install --no-build-isolation --no-deps -e . \
        --config-settings=build-dir=build/editable \
        --config-settings=cmake.define.WAVECOMB_ARCH=x86-64-v3

Each source tree renders the stage in its Python environment, at 96 x 96 pixels with one thread and
8 SIMD lanes, once with 4 and once with 20 samples per pixel. The difference in instructions is
divided by the difference in shaded hits, which excludes loading and scene construction. The library
`_core` has the code for camera rays, ordering, shading and film, and `libembree4` that for
traversal.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

SAMPLES = (4, 20)
SHOWN = 3
"""Number of libraries to print, in order of decreasing instruction count."""
RENDER = """
import json, sys, wavecomb
picture = wavecomb.render(sys.argv[1], size=(96, 96), spp=int(sys.argv[2]), threads=1,
                          wave_size=4096, lanes=8, policy="program")
print(json.dumps(picture.stats["counts"]["records"]))
"""


def main() -> None:
    """Count instructions and print a line for each source tree and library."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("stage", type=Path)
    parser.add_argument("trees", type=Path, nargs="*", default=[Path(__file__).parents[1]])
    args = parser.parse_args()
    for tree in args.trees:
        few, many = (count(tree, args.stage, spp) for spp in SAMPLES)
        records = many[0] - few[0]
        each = {name: (n - few[1].get(name, 0)) / records for name, n in many[1].items()}
        for name in sorted(each, key=lambda name: -each[name])[:SHOWN]:
            print(f"{tree}: {name} {each[name]:.0f} instructions a record, {records} records")


def count(tree: Path, stage: Path, spp: int) -> tuple[int, dict[str, int]]:
    """Return the number of hits that one render shades, and the instructions of each library."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "counts"
        done = subprocess.run(
            [
                *("valgrind", "--tool=callgrind", f"--callgrind-out-file={out}"),
                *(str(tree.absolute() / ".venv/bin/python"), "-c", RENDER),
                *(str(stage.resolve()), str(spp)),
            ],
            capture_output=True, text=True, check=False, cwd=tree,
        )  # fmt: skip
        if done.returncode != 0:
            said = [line for line in done.stderr.splitlines() if not line.startswith("==")]
            sys.exit(f"{tree}: {' '.join(said[-1:]) or 'valgrind failed'}")
        return int(json.loads(done.stdout)), self_by_library(out)


def self_by_library(file: Path) -> dict[str, int]:
    """Sum the self cost of functions by library, from a file in callgrind's format."""
    names: dict[str, str] = {}
    total: dict[str, int] = {}
    library, is_call = "", False
    for line in file.read_text(encoding="utf-8", errors="replace").splitlines():
        if found := re.match(r"(c?)ob=\((\d+)\)(?: (.*))?", line):
            if found[3]:
                names[found[2]] = Path(found[3]).name.partition(".")[0]
            if not found[1]:
                library = names[found[2]]
        elif line.startswith("calls="):
            is_call = True  # the next line of a Callgrind file has the callee's cost
        elif line[:1] in "0123456789+-*" and line:
            if not is_call:
                total[library] = total.get(library, 0) + int(line.split()[1])
            is_call = False
    return total


if __name__ == "__main__":
    main()
