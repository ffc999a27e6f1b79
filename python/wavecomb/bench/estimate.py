# SPDX-License-Identifier: Apache-2.0
"""How long a sitting takes: from results that are there, else from a short calibration."""

from __future__ import annotations

import math
import statistics
import tempfile
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from wavecomb.bench.plan import Config, Run
from wavecomb.bench.suite_model import WAVECOMB

_SIZE = 160
_SPP = 8
_BYTES_PER_SECOND = 25e6
"""Speed at which textures are read and tiled while a stage is loaded; rough."""
_TRIANGLES_PER_SECOND = 1.5e6
"""Speed at which meshes are read and their acceleration structure is built; rough."""


@dataclass
class Estimator:
    """Seconds of a run.

    Attributes:
        start_s: Of a process that renders next to nothing of a small stage.
        rate: Samples per second and thread, by lanes; other renderers are taken to be as quick.
        measured: Wall times of runs that are done, by configuration.
    """

    start_s: float = 1.0
    rate: dict[int, float] = field(default_factory=lambda: {0: 4e5})
    measured: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    _bias: list[float] = field(default_factory=list)

    def learn(self, config: Config, wall_s: float) -> None:
        """Takes a run that is done into account; it tells of others that are like it, too."""
        guess = self._guess(config)
        self.measured[config.name].append(wall_s)
        if guess > 0.0:
            self._bias.append(wall_s / guess)

    def seconds(self, config: Config) -> float:
        """Seconds of one run."""
        known = self.measured.get(config.name)
        if known:
            return statistics.fmean(known)
        return self._guess(config) * (statistics.median(self._bias) if self._bias else 1.0)

    def total(self, runs: Iterable[Run]) -> float:
        """Seconds of all of them."""
        return sum(self.seconds(run.config) for run in runs)

    def _guess(self, config: Config) -> float:
        settings = config.settings
        width, height = settings["size"]
        lanes = int(settings["lanes"])
        rate = self.rate.get(lanes) or statistics.fmean(self.rate.values())
        samples = width * height * int(settings["spp"])
        render_s = samples / (rate * max(1, int(settings["threads"])))
        limit_s = float(settings.get("time_limit", 0)) or math.inf
        return self.start_s + _load_s(config) + min(render_s, limit_s)


def _load_s(config: Config) -> float:
    """Seconds that loading a generated stage takes, beyond those of the small one."""
    if not config.source.scene:
        return 0.0
    from wavecomb.scenes import SceneOptions

    options = SceneOptions(**config.source.options)
    if config.source.scene == "spread":
        texture_bytes = 1e6 * options.texture_mb
    elif config.source.scene in ("mixed", "dragon"):
        texture_bytes = 100e6 * (options.texture_size / 2048.0) ** 2
    else:
        texture_bytes = 0.0
    return texture_bytes / _BYTES_PER_SECOND / 3.0 + options.triangles / _TRIANGLES_PER_SECOND


def calibrate(configs: Sequence[Config], cpus: Sequence[int]) -> Estimator:
    """Renders a small stage with each number of lanes that the plan has; takes seconds."""
    from wavecomb.bench.process import run_worker
    from wavecomb.scenes import write_scene

    rates: dict[int, float] = {}
    starts: list[float] = []
    ours = [config for config in configs if config.renderer == WAVECOMB]
    with tempfile.TemporaryDirectory(prefix="wavecomb-bench-") as scratch:
        stage = Path(scratch) / "small.usdc"
        write_scene("dragon", stage, triangles=12_000, texture_size=64)
        for lanes in sorted({int(config.settings["lanes"]) for config in ours}):
            settings = {"size": [_SIZE, _SIZE], "spp": _SPP, "lanes": lanes, "threads": len(cpus)}
            job = {"stage": str(stage), "settings": settings, "cpus": list(cpus), "warm": 1}
            outcome = run_worker(job, {}, Path(scratch))
            if outcome.answer["status"] == "ok":
                render = float(outcome.answer["stats"]["seconds"]["render"])
                rates[lanes] = _SIZE * _SIZE * _SPP / render / len(cpus)
                starts.append(max(0.1, outcome.wall_s - render))
    if not rates:
        return Estimator()
    return Estimator(statistics.fmean(starts), rates)


def from_results(
    objects: Iterable[Mapping[str, Any]], configs: Mapping[str, Config]
) -> Estimator | None:
    """From runs that are done; None without any."""
    found = Estimator()
    for entry in objects:
        row = entry["row"]
        if row["status"] == "ok" and row["config"] in configs:
            found.learn(configs[row["config"]], float(row["wall_s"]))
    return found if found.measured else None
