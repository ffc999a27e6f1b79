# SPDX-License-Identifier: Apache-2.0
"""Reintroduce known faults of light transport, and check that pairs.py finds each.

    .venv/bin/python tests/statistics/faults.py              # builds in out/faults: 5 to 15 minutes
    .venv/bin/python tests/statistics/faults.py --keep       # uses the existing build

The source tree is copied, one line of each fix is undone, and the program is built once with all
faults, for scalar lanes. Each fault has a stage in which the other faults have no effect. The exit
code is 0 if pairs.py finds all faults.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
OUT = ROOT / "out" / "faults"
TREE, BUILD, VENV = OUT / "tree", OUT / "build", OUT / "venv"
LIBRARIES = (Path(sys.prefix) / "lib", ROOT / ".deps" / "embree" / "lib")
"""Library folders of this environment, where the module built here finds oneTBB and Embree."""


@dataclass(frozen=True)
class Fault:
    """A fault that was fixed.

    Attributes:
        name: Description of the fault, for messages.
        seed: Seed of the stage of pairs.py that reveals the fault.
        changes: (file, text of the fix, text without the fix).
    """

    name: str
    seed: int
    changes: tuple[tuple[str, str, str], ...]


CORE = "src/wavecomb/"
FAULTS = (
    Fault(
        "light samples through a smooth thin wall end in the light itself",
        342,
        (
            (
                CORE + "path/steps/light_connection.h",
                "near.distance = select(crossing, max(F(distance - closer), F(0.f)), distance);",
                "near.distance = select(crossing & (closer > 1e30f), F(0.f), distance);",
            ),
            (
                CORE + "path/steps/light_connection.h",
                "if (any(has_terminator)) {",
                "if (any(has_terminator) && v.depth > 1000) {",
            ),
        ),
    ),
    Fault(
        "light samples pass through the surface of a subsurface body",
        38,
        (
            (
                CORE + "path/steps/sample_light.h",
                "valid = valid & not_(at.bsdf.enters(c.wo, wi));",
                "valid = valid & not_(at.bsdf.enters(c.wo, wi) & Mask<F>(false));",
            ),
        ),
    ),
    Fault(
        "guiding with cosine sampling uses the density of the BSDF",
        29,
        (
            (
                CORE + "guiding/bounce/guided_bounce.h",
                "const F unguided = bounce_pdf(v, c.at.bsdf, c.wo, c.view, wi, e);",
                "const F unguided = e.pdf;",
            ),
        ),
    ),
    Fault(
        "light paths at a maximum depth of 0 show light that is scattered once",
        12,
        (
            (
                CORE + "render/pilots/planner.cpp",
                "if (used.max_depth == 0) used.transport = Transport::kPath;",
                "",
            ),
        ),
    ),
    Fault(
        "absorbing glass dims other segments of light paths than of camera paths",
        27,
        (
            (
                CORE + "medium/description/glass_contents.cpp",
                "> 0 && Search(glasses, objects).finds_objects();",
                "> 1000000 && Search(glasses, objects).finds_objects();",
            ),
            (
                CORE + "medium/description/glass_contents.cpp",
                "> 0 && Search(glasses, objects).finds_lights(lights);",
                "> 1000000 && Search(glasses, objects).finds_lights(lights);",
            ),
        ),
    ),
    Fault(
        "light paths take the bounces of guided camera paths for unguided ones",
        1,
        (
            (
                CORE + "light_paths/camera_density.h",
                "return {mixed_pdf<Bsdf, F>(v, guiding, frame.to_world(l), l, w, p_bsdf), "
                "guiding.bsdf_share};",
                "return {v.depth < 1000 ? p_bsdf : F(0.f), guiding.bsdf_share};",
            ),
        ),
    ),
)


def without_fixes(text: str, name: str) -> str:
    """Returns the text of a source file without the fixes of all faults.

    Args:
        text: Text of the file.
        name: Path of the file in the repository.

    Raises:
        ValueError: The file does not contain the text of a fix exactly once.
    """
    for fault in FAULTS:
        for file, fixed, faulty in fault.changes:
            if file != name:
                continue
            if text.count(fixed) != 1:
                raise ValueError(f"{name} does not contain {fixed!r} once; adapt {fault.name!r}")
            text = text.replace(fixed, faulty)
    return text


def copy_tree() -> None:
    """Copy the tracked files of the working tree, and reintroduce the faults."""
    shutil.rmtree(TREE, ignore_errors=True)
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    for name in filter(None, listed.stdout.split("\0")):
        if (ROOT / name).is_file():
            (TREE / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, TREE / name)
    for name in {change[0] for fault in FAULTS for change in fault.changes}:
        try:
            (TREE / name).write_text(without_fixes((TREE / name).read_text(), name))
        except ValueError as error:
            sys.exit(f"faults: {error}")


def build() -> None:
    """Build the module, and an environment that contains it."""
    tools = Path(sys.prefix) / "bin"
    definitions = {
        "CMAKE_BUILD_TYPE": "Release",
        "CMAKE_CXX_FLAGS_RELEASE": "-O1 -DNDEBUG",
        "WAVECOMB_PYTHON": "ON",
        "WAVECOMB_VDB": "OFF",
        "WAVECOMB_BATCH": "ON",
        "WAVECOMB_LANE_WIDTHS": "1",
    }
    flags = [f"-D{name}={value}" for name, value in definitions.items()]
    (TREE / ".deps").unlink(missing_ok=True)
    for name in (".deps", ".venv"):
        if not (TREE / name).exists():
            (TREE / name).symlink_to(ROOT / name)
    run([tools / "cmake", "-S", TREE, "-B", BUILD, "-G", "Ninja", "--log-level=NOTICE", *flags])
    run([tools / "cmake", "--build", BUILD, "--target", "wavecomb_python", "--", "--quiet"])
    shutil.rmtree(VENV, ignore_errors=True)
    run([sys.executable, "-m", "venv", "--without-pip", VENV])
    folder = "import sysconfig; print(sysconfig.get_path('platlib'))"
    site, others = (
        Path(subprocess.check_output([python, "-c", folder], text=True).strip())
        for python in (VENV / "bin" / "python", sys.executable)
    )
    run([tools / "cmake", "--install", BUILD, "--component", "python", "--prefix", site])
    shutil.copytree(TREE / "python" / "wavecomb", site / "wavecomb", dirs_exist_ok=True)
    # Make the packages of this environment available without its editable Wavecomb, since the .pth
    # files of that folder are not read.
    (site / "others.pth").write_text(f"{others}\n")


def run(words: list[object]) -> None:
    """Run a command; exit with its exit code if it fails."""
    done = subprocess.run([str(word) for word in words], stdout=subprocess.DEVNULL)
    if done.returncode:
        sys.exit(done.returncode)


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--keep", action="store_true", help="take the build that is there")
    if not parser.parse_args().keep:
        copy_tree()
        build()
    missed = 0
    libraries = os.pathsep.join(str(folder) for folder in LIBRARIES)
    for fault in FAULTS:
        pairs = ROOT / "tests" / "statistics" / "pairs.py"
        command = [VENV / "bin" / "python", pairs, str(fault.seed), "--repeats", "1"]
        environment = {**os.environ, "LD_LIBRARY_PATH": libraries}
        done = subprocess.run(command, capture_output=True, text=True, env=environment)
        lines = [line for line in done.stdout.splitlines() if "FAULT" in line]
        missed += not lines
        print(f"{fault.name}: stage {fault.seed}: {'found' if lines else 'MISSED'}")
        for line in lines or [done.stderr[-2000:]]:
            print(f"    {line}", flush=True)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
