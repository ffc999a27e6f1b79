# SPDX-License-Identifier: Apache-2.0
"""Runs of other renderers, by scripts in benchmarks/peers, which only a checkout has."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

from wavecomb import processes
from wavecomb.bench.plan import Config
from wavecomb.bench.process import Outcome, run_lines
from wavecomb.errors import WavecombError

ROOT = Path(__file__).resolve().parents[3]
TOOLS = ROOT / "benchmarks" / "peers"
WORKER = TOOLS / "worker.py"
CYCLES_PYTHON = ROOT / ".deps" / "cycles" / "bin" / "python"
_KINDS: dict[str, tuple[str, dict[str, Any]]] = {
    "mitsuba-scalar": ("mitsuba", {"variant": "scalar_rgb"}),
    "mitsuba-llvm": ("mitsuba", {"variant": "llvm_ad_rgb"}),
    "cycles": ("cycles", {"light_tree": True}),
}
_COMPILES = ("mitsuba-llvm",)
"""Renderers that compile code for each sample count. Such renderers render twice, and the second
render is timed."""


def check(renderers: set[str]) -> None:
    """Raises WavecombError unless the tools for these peers are installed."""
    if not renderers:
        return
    if not WORKER.is_file():
        raise WavecombError(
            f"renderer {min(renderers)}: needs benchmarks/peers/worker.py of a checkout of "
            "Wavecomb, which is missing; leave the peers out with --only"
        )
    if "cycles" in renderers and not CYCLES_PYTHON.exists():
        raise WavecombError("renderer cycles: is not installed; run benchmarks/peers/setup first")
    if any(name.startswith("mitsuba") for name in renderers):
        from importlib.util import find_spec

        if find_spec("mitsuba") is None:
            raise WavecombError("renderer mitsuba: is not installed; run `pip install mitsuba`")


def record(stage: Path) -> Path:
    """Exports the arrays of a stage for the peers, once, to a folder beside the stage."""
    folder = stage.with_name(f"{stage.stem}-recorded")
    if folder.is_dir() and any(folder.iterdir()):
        return folder
    code = (
        "import sys; from pathlib import Path; from recording import record; "
        "record(Path(sys.argv[1])).save(Path(sys.argv[2]))"
    )
    words = ("-c", code, str(stage.resolve()), str(folder.resolve()))
    process = processes.popen(
        processes.command(*words, parent=os.getpid(), path=[str(TOOLS)]),
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    _, err = process.communicate()
    if process.returncode != 0:
        said = err.strip().splitlines()[-1:] or ["no message"]
        raise WavecombError(f"{stage}: cannot be exported to the peers: {said[0]}")
    return folder


def run_peer(
    config: Config, stage: Path, spp: int, seed: int, image: Path, threads: int
) -> Outcome:
    """Renders with a peer in a fresh process and writes the image to ``image``."""
    width, height = config.settings["size"]
    if width != height:
        raise WavecombError(f"{config.name}: peers render square images only; change its size")
    kind, options = _KINDS[config.renderer]
    depth = config.settings.get("max_depth", 8)
    command = processes.command(
        *(WORKER.stem, kind, "--options", json.dumps(options)),
        *("--stage", str(stage.resolve()), "--recorded", str(record(stage).resolve())),
        *("--size", str(width), "--threads", str(threads), "--max-depth", str(depth)),
        parent=os.getpid(),
        path=[str(TOOLS)],
        python=str(CYCLES_PYTHON) if kind == "cycles" else None,
        flags=["-W", "ignore"],
    )
    times = 2 if config.renderer in _COMPILES else 1
    jobs = [
        {"spp": spp, "seed": seed + 1000 * k, "image": str(image.resolve()) if k == 0 else None}
        for k in reversed(range(times))
    ]
    done = run_lines(command, "".join(json.dumps(job) + "\n" for job in jobs))
    if len(done.lines) == 1 + times and done.outcome.code == 0:
        facts, answer = done.lines[0], done.lines[-1]
        seconds = float(answer["seconds"])
        done.outcome.answer = {
            "status": "ok",
            "error": "",
            "stats": {
                "seconds": {"load": float(facts["load_s"]), "build": None, "render": seconds},
                "settings": {**facts["settings"], "max_depth": depth},
                "threads": threads,
                "version": facts["version"],
                "samples_per_s": width * height * float(answer["spp"]) / seconds,
                "rays": answer["rays"],
                "peak_rss_bytes": float(answer["peak_mb"]) * 2**20,
            },
        }
    return done.outcome
