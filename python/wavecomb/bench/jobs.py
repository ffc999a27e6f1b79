# SPDX-License-Identifier: Apache-2.0
"""What a worker is told, for each kind of run: timed, converged, recording of costs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from wavecomb.bench.oracle import COSTS, ORACLES, policy_of
from wavecomb.bench.plan import Config, Run
from wavecomb.bench.results import ResultFolder
from wavecomb.bench.stages import stage_file
from wavecomb.bench.suite_model import WAVECOMB, Golden, Suite

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
