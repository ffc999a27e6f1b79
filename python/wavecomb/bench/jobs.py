# SPDX-License-Identifier: Apache-2.0
"""What a worker is told, for each kind of run: timed, converged, recording of costs."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

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
from wavecomb.bench.process import run_worker
from wavecomb.bench.results import ResultFolder
from wavecomb.bench.suite_model import WAVECOMB, Golden, StageSource, Suite
from wavecomb.errors import WavecombError
from wavecomb.picture.files import replacing
from wavecomb.run.costs import save_costs


def stage_file(source: StageSource, name: str, folder: Path) -> Path:
    """Where the stage is, or will be once it is generated."""
    if source.file is not None:
        return source.file
    return folder / f"{name}-{digest([source.scene, source.options])}.usdc"


def check_files(configs: Iterable[Config]) -> None:
    """Raises WavecombError unless every stage that is a file is there."""
    for config in configs:
        file = config.source.file
        if file is not None and not file.is_file():
            raise WavecombError(f"{file}: no such file (stage {config.stage} of the suite)")


def generate(source: StageSource, path: Path) -> None:
    """Writes a generated stage, unless it is there."""
    if source.file is not None or path.exists():
        return
    from wavecomb.scenes import write_scene

    try:
        write_scene(source.scene, path, **source.options)
    except (ValueError, TypeError) as error:
        raise WavecombError(f"stage {path.stem}: {error}") from error


RECORDINGS = 3
"""Renders, with different seeds, that the oracle's costs are pooled from."""
ORDERINGS = 12
"""Renders under different orders of materials that an oracle's order is found from."""

Job = dict[str, Any]


class Jobs:
    """Makes the jobs of a sitting."""

    def __init__(self, suite: Suite, folder: ResultFolder, cpus: list[int]) -> None:
        self._suite = suite
        self._folder = folder
        self._cpus = cpus

    def stage(self, config: Config) -> Path:
        """The stage's file."""
        return stage_file(config.source, config.stage, self._folder.path / "stages")

    def golden(self, config: Config) -> Path:
        """The converged picture's file."""
        return self._folder.path / "golden" / f"{config.golden_key()}.npy"

    def profile(self, config: Config) -> Path:
        """What an oracle starts from: true costs, or ranks."""
        policy = config.settings.get("policy")
        which = "" if policy == COSTS else f"-{policy}"
        return self._folder.path / "trace" / f"{config.recording_key()}{which}.json"

    def trace(self, config: Config) -> Path:
        """The recordings that the best and the worst order are found from."""
        return self._folder.path / "trace" / f"{config.recording_key()}-orders.json"

    def image(self, run: Run) -> Path | None:
        """Where the run's picture is kept; None if it is not."""
        keep = {"none": False, "first": run.repetition == 0, "all": True}[run.config.images]
        return self._folder.path / "images" / f"{run.run_id}.npy" if keep else None

    def timed(self, run: Run) -> Job:
        """A run of the plan. Its seed is its repetition, so a round has one picture."""
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
        """A run that fills the file cache and is thrown away."""
        settings = {**config.settings, "policy": "program", "spp": 1}
        return self._job(config, settings)

    def converged(self, config: Config) -> Job:
        """The golden picture of a configuration."""
        golden: Golden = self._suite.golden
        ways = ("policy", "threads", "wave_size", "lanes", "ray_order", "shadow_order", "roulette")
        settings = {key: value for key, value in config.settings.items() if key not in ways}
        settings |= {"spp": golden.spp, "seed": golden.seed, "integrator": golden.integrator}
        return self._job(config, settings, image=str(self.golden(config)))

    def recording(self, config: Config, number: int, ranks: Path | None = None) -> Job:
        """A render that costs are read from: sorted by material, so that batches hold one.

        With ``ranks``, a cost file, materials are shaded in the order of these.
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


# ---- Renders before the sitting that the oracles learn from, and the files that keep them --------


TRACE_SCHEMA = "wavecomb-trace/1"


def make_profile(jobs: Jobs, config: Config, scratch: Path) -> None:
    """Writes the file that the configuration's oracle starts from.

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
    """Recordings under random orders of the materials, and the best and worst that follow."""
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
