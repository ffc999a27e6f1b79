# SPDX-License-Identifier: Apache-2.0
"""Builds the jobs of a suite: timed runs, converged images, cost measurements, and others."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from wavecomb import processes
from wavecomb.bench.oracle import (
    COSTS,
    ORACLES,
    best_orders,
    policy_of,
    pooled_costs,
    ranks,
    recorded,
    shuffled,
)
from wavecomb.bench.plan import Config, Run, digest
from wavecomb.bench.process import Outcome, run_lines, run_worker
from wavecomb.bench.results import ResultFolder
from wavecomb.bench.suite_model import WAVECOMB, Golden, StageSource, Suite
from wavecomb.errors import WavecombError
from wavecomb.image.files.output_file import replacing
from wavecomb.run.cost_profile import save_costs


def stage_file(source: StageSource, name: str, folder: Path) -> Path:
    """Returns the file of a stage. A generated stage may not have been written yet."""
    if source.file is not None:
        return source.file
    return folder / f"{name}-{digest([source.scene, source.options])}.usdc"


def check_files(configs: Iterable[Config]) -> None:
    """Raises WavecombError unless every stage that is a file exists."""
    for config in configs:
        file = config.source.file
        if file is not None and not file.is_file():
            raise WavecombError(f"{file}: no such file (stage {config.stage} of the suite)")


def generate(source: StageSource, path: Path) -> None:
    """Writes a generated stage, unless the file exists."""
    if source.file is not None or path.exists():
        return
    from wavecomb.scenes import write_scene

    try:
        write_scene(source.scene, path, **source.options)
    except (ValueError, TypeError) as error:
        raise WavecombError(f"stage {path.stem}: {error}") from error


RECORDINGS = 3
"""Number of renders with different seeds whose measured costs are pooled for the oracle."""
ORDERINGS = 12
"""Number of renders with different orders of materials, from which the best order is derived."""

Job = dict[str, Any]


class Jobs:
    """Builder of the jobs for one execution of a suite."""

    def __init__(self, suite: Suite, folder: ResultFolder, cpus: list[int]) -> None:
        self._suite = suite
        self._folder = folder
        self._cpus = cpus

    def stage(self, config: Config) -> Path:
        """Returns the file of the stage."""
        return stage_file(config.source, config.stage, self._folder.path / "stages")

    def golden(self, config: Config) -> Path:
        """Returns the file of the converged image."""
        return self._folder.path / "golden" / f"{config.golden_key()}.npy"

    def profile(self, config: Config) -> Path:
        """Returns the file with the true costs or ranks that an oracle uses."""
        policy = config.settings.get("policy")
        which = "" if policy == COSTS else f"-{policy}"
        return self._folder.path / "trace" / f"{config.recording_key()}{which}.json"

    def trace(self, config: Config) -> Path:
        """Returns the file with the recordings that determine the best and the worst order."""
        return self._folder.path / "trace" / f"{config.recording_key()}-orders.json"

    def image(self, run: Run) -> Path | None:
        """Returns the file for the run's image, or None if the image is not kept."""
        keep = {"none": False, "first": run.repetition == 0, "all": True}[run.config.images]
        return self._folder.path / "images" / f"{run.run_id}.npy" if keep else None

    def timed(self, run: Run) -> Job:
        """Returns the job of a run in the plan.

        The seed is the number of the repetition, so that all runs of a round have equal images.
        """
        config = run.config
        settings = {**config.settings, "seed": run.repetition}
        oracle = settings.get("policy") in ORACLES
        settings |= policy_of(settings)
        image = self.image(run)
        golden = {"file": str(self.golden(config)), "spp": self._suite.golden.spp}
        return self._job(
            config,
            settings,
            warm=1,
            profile=str(self.profile(config)) if oracle else None,
            golden=golden if config.golden else None,
            image=str(image) if image else None,
        )

    def warm_up(self, config: Config) -> Job:
        """Returns a job that fills the file cache.

        The result of the warm-up render is discarded.
        """
        settings = {**config.settings, "policy": "program", "spp": 1}
        return self._job(config, settings)

    def converged(self, config: Config) -> Job:
        """Returns the job that renders the converged image of a configuration."""
        golden: Golden = self._suite.golden
        ways = ("policy", "threads", "wave_size", "lanes", "ray_order", "shadow_order", "roulette")
        settings = {key: value for key, value in config.settings.items() if key not in ways}
        settings |= {"spp": golden.spp, "seed": golden.seed, "integrator": golden.integrator}
        return self._job(config, settings, image=str(self.golden(config)))

    def recording(self, config: Config, number: int, ranks: Path | None = None) -> Job:
        """Returns a job whose render measures the shading costs of materials.

        The render sorts hits by material, so that each batch of hits has one material. ``ranks`` is
        an optional cost file that determines the order of materials.
        """
        settings = {**config.settings, "policy": "material", "roulette": "throughput"}
        settings |= {"seed": self._suite.golden.seed + 1 + number}
        if ranks is None:
            return self._job(config, settings, warm=1)
        return self._job(config, {**settings, "cost_weight": 0.0}, warm=1, profile=str(ranks))

    def _job(self, config: Config, settings: dict[str, Any], **more: Any) -> Job:
        assert config.renderer == WAVECOMB
        threads = int(settings.get("threads", 0)) or len(self._cpus)
        return {
            "stage": str(self.stage(config)),
            "camera": config.source.camera,
            "settings": settings,
            "cpus": self._cpus[:threads],
            **more,
        }


# ---- Renders before the sitting that record costs for the oracles, and their files


TRACE_SCHEMA = "wavecomb-trace/1"


def make_profile(jobs: Jobs, config: Config, scratch: Path) -> None:
    """Writes the file of costs or ranks that the configuration's oracle uses.

    Raises:
        WavecombError: A recording failed.
    """
    if config.settings["policy"] == COSTS:
        answers = [_run(jobs.recording(config, k), config, scratch) for k in range(RECORDINGS)]
        save_costs(jobs.profile(config), pooled_costs(answers))
        return
    trace = jobs.trace(config)
    if not trace.exists():
        _write(trace, _orderings(jobs, config, scratch))
    found = json.loads(trace.read_text(encoding="utf-8"))
    save_costs(jobs.profile(config), ranks(found[config.settings["policy"]]))


def _orderings(jobs: Jobs, config: Config, scratch: Path) -> dict[str, Any]:
    """Records costs in random orders of materials, and derives the best and the worst order."""
    first = _run(jobs.recording(config, 0), config, scratch)
    names = [entry["name"] for entry in first["stats"]["materials"]]
    path = scratch / "trace" / ".ranks.json"
    recordings = []
    try:
        for number in range(ORDERINGS):
            order = shuffled(names, number)
            save_costs(path, ranks(order))
            answer = _run(jobs.recording(config, number, path), config, scratch)
            recordings.append(recorded(order, answer))
    finally:
        path.unlink(missing_ok=True)
    return {"schema": TRACE_SCHEMA, **best_orders(recordings), "recordings": recordings}


def _run(job: Job, config: Config, scratch: Path) -> dict[str, Any]:
    answer = run_worker(job, {}, scratch).answer
    if answer["status"] != "ok":
        raise WavecombError(f"recording of {config.name}: {answer['error']}")
    return answer


def _write(path: Path, document: dict[str, Any]) -> None:
    with replacing(path) as part:
        part.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


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
"""Renderers that compile code for each sample count; only their second render is timed."""


def check_peers(renderers: set[str]) -> None:
    """Raises WavecombError unless the tools for the given other renderers are installed."""
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
    """Writes a stage's arrays for other renderers to a folder beside it, unless they exist."""
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
    """Renders with another renderer in a new process and writes its result to ``image``."""
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
