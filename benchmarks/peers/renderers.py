# SPDX-License-Identifier: Apache-2.0
"""The compared renderers and their processes."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
CYCLES_PYTHON = ROOT / ".deps" / "cycles" / "bin" / "python"


@dataclass(frozen=True)
class Renderer:
    """A renderer of the comparison, with its options.

    Attributes:
        kind: Name of the renderer in worker.py.
        options: Options of the renderer.
        spp: Samples per pixel of the short and of the long timed render. Slower renderers take
            fewer samples, so that all renders take a similar time. Mitsuba's multijitter requires
            squares.
        warm: Whether to render both sample counts before timing, since Dr.Jit compiles for each.
    """

    kind: str
    options: dict[str, Any] = field(default_factory=dict)
    spp: tuple[int, int] = (16, 64)
    warm: bool = False

    @property
    def family(self) -> str:
        """Name shared by renderers that converge to the same image."""
        return self.kind


RENDERERS = {
    "wavecomb": Renderer("wavecomb"),
    "mitsuba-scalar": Renderer("mitsuba", {"variant": "scalar_rgb"}, (4, 16)),
    "mitsuba-llvm": Renderer("mitsuba", {"variant": "llvm_ad_rgb"}, warm=True),
    "mitsuba-llvm-multijitter": Renderer(
        "mitsuba", {"variant": "llvm_ad_rgb", "sampler": "multijitter"}, warm=True
    ),
    "mitsuba-llvm-volpath": Renderer(
        "mitsuba",
        {"variant": "llvm_ad_rgb", "sampler": "multijitter", "integrator": "volpath"},
        warm=True,
    ),
    "mitsuba-llvm-same": Renderer(
        "mitsuba",
        {"variant": "llvm_ad_rgb", "sampler": "multijitter", "same_preview": True},
        warm=True,
    ),
    "mitsuba-llvm-ptracer": Renderer(
        "mitsuba", {"variant": "llvm_ad_rgb", "integrator": "ptracer"}, warm=True
    ),
    "cycles": Renderer("cycles", {"light_tree": True}, (9, 36)),
    "cycles-no-tree": Renderer("cycles", {"light_tree": False}, (9, 36)),
    "cycles-shadow-caustics": Renderer(
        "cycles", {"light_tree": True, "shadow_caustics": True}, (9, 36)
    ),
}
_APART = (
    "mitsuba-llvm-volpath",
    "mitsuba-llvm-same",
    "mitsuba-llvm-ptracer",
    "cycles-shadow-caustics",
)
USUAL = tuple(name for name in RENDERERS if name not in _APART)
"""All renderers except those that are compared only on volumes, brightness or caustics."""


@dataclass(frozen=True)
class Job:
    """Stage and arrays that all renderers use. ``digest`` is a hash of the recorded arrays."""

    stage: Path
    recorded: Path
    digest: str
    size: int
    threads: int
    max_depth: int


class Process:
    """Process of a renderer; ``start_s`` is the time from its start to its first image."""

    def __init__(self, name: str, job: Job, log: Path, options: dict[str, Any]) -> None:
        chosen = RENDERERS[name]
        self.name = name
        python = str(CYCLES_PYTHON) if chosen.kind == "cycles" else sys.executable
        if not Path(python).exists():
            raise SystemExit(f"{name}: there is no {python}; run benchmarks/peers/setup")
        command = [python, "-W", "ignore", str(Path(__file__).with_name("worker.py")), chosen.kind]
        command += ["--options", json.dumps({**chosen.options, **options})]
        command += ["--stage", str(job.stage), "--recorded", str(job.recorded)]
        command += ["--size", str(job.size), "--threads", str(job.threads)]
        command += ["--max-depth", str(job.max_depth)]
        self._log = log
        with log.open("w") as errors:
            begin = time.perf_counter()
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, text=True
            )
        self.facts = self._read()
        self.start_s = time.perf_counter() - begin

    def _read(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            code = self._process.wait()
            tail = self._log.read_text().strip().splitlines()[-1:]
            raise SystemExit(f"{self.name} ended with {code}: {' '.join(tail)} (see {self._log})")
        answer: dict[str, Any] = json.loads(line)
        return answer

    def render(self, spp: int, seed: int, image: Path | None = None) -> dict[str, Any]:
        """Request a render; return the answer of worker.py."""
        assert self._process.stdin is not None
        job = {"spp": spp, "seed": seed, "image": str(image) if image else None}
        self._process.stdin.write(json.dumps(job) + "\n")
        self._process.stdin.flush()
        return self._read()

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()
