# SPDX-License-Identifier: Apache-2.0
"""The plan of a suite: configurations, their short names, and the order of runs."""

from __future__ import annotations

import fnmatch
import hashlib
import itertools
import json
import math
import random
import re
import statistics
import tempfile
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from wavecomb.bench.machine import Limits
from wavecomb.bench.suite_model import WAVECOMB, Experiment, StageSource, Suite
from wavecomb.errors import WavecombError
from wavecomb.options import expectation

FRAMED = {"ray_order": "slot", "shadow_order": "slot", "roulette": "throughput"}
"""Default values of settings that have a column, for suites that do not set these settings."""


@dataclass(frozen=True)
class Config:
    """Configuration of a suite: all inputs of a run except repetition and seed.

    Attributes:
        name: Short name, unique in the suite and usable in file names.
        experiment: Name of the experiment.
        renderer: "wavecomb" or the name of another renderer.
        stage: Name of the stage, with its varied options.
        source: Source of the stage.
        settings: Settings of the render; the policy may be an oracle.
        case: Name of the case, or "".
        factor: Name of the factor of a scaling curve, or "".
        factor_value: Value of the factor, or None.
        images: As in ``Experiment``.
        golden: Whether the image is compared with a converged image.
    """

    name: str
    experiment: str
    renderer: str
    stage: str
    source: StageSource
    settings: dict[str, Any]
    case: str
    factor: str
    factor_value: float | None
    images: str
    golden: bool

    def golden_key(self) -> str:
        """Returns a key for file names.

        The key is equal for configurations that converge to the same image.
        """
        width, height = self.settings["size"]
        names = ("size", *expectation())
        of = {key: self.settings[key] for key in names if key in self.settings}
        # Variants of a renderer share a golden image, since they converge to the same image.
        family = self.renderer.split("-")[0]
        stage = self.stage if self.renderer == WAVECOMB else f"{self.stage}-{family}"
        return f"{stage}-{width}x{height}-{digest(of)}"

    def recording_key(self) -> str:
        """Returns a key that is equal for configurations with the same shading costs.

        The key depends on all settings except policy and roulette.
        """
        left_out = ("policy", "roulette")
        of = {key: value for key, value in self.settings.items() if key not in left_out}
        return f"{self.stage}-{digest(of)}"


@dataclass(frozen=True)
class Run:
    """One run of the plan."""

    config: Config
    repetition: int

    @property
    def run_id(self) -> str:
        """Name of the run, unique in the suite."""
        return f"{self.config.name}-{self.repetition}"


def digest(value: Any) -> str:
    """Returns eight hexadecimal digits of a hash of a JSON value."""
    text = json.dumps(value, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:8]


def configurations(suite: Suite, limits: Limits, threads: int | None = None) -> list[Config]:
    """Lists all configurations that this machine supports, in the order of the file.

    Args:
        suite: The suite.
        limits: Limits of the machine.
        threads: Number of threads of runs that do not vary the thread count; None means the number
            in the suite.
    """
    found: list[Config] = []
    for experiment in suite.experiments:
        found += _of_experiment(suite, experiment, limits, threads)
    names = [config.name for config in found]
    if len(set(names)) < len(names):
        double = next(name for name in names if names.count(name) > 1)
        raise WavecombError(f"{suite.path}: two configurations are named {double}: rename a case")
    return found


def chosen(configs: Sequence[Config], pattern: str | None) -> list[Config]:
    """Returns the configurations whose name matches a shell pattern."""
    if pattern is None:
        return list(configs)
    kept = [config for config in configs if fnmatch.fnmatch(config.name, pattern)]
    if not kept:
        some = ", ".join(config.name for config in configs[:3])
        raise WavecombError(f"--only {pattern}: matches none of the names; an example is {some}")
    return kept


def schedule(configs: Sequence[Config], repetitions: int, seed: int) -> list[Run]:
    """Returns the runs in execution order: rounds of one repetition each, in random order."""
    rng = random.Random(seed)
    runs: list[Run] = []
    for repetition in range(repetitions):
        round_ = [Run(config, repetition) for config in configs]
        rng.shuffle(round_)
        runs += round_
    return runs


def _of_experiment(
    suite: Suite, experiment: Experiment, limits: Limits, threads: int | None
) -> list[Config]:
    found = []
    keys = [*experiment.vary, *(f"stage.{key}" for key in experiment.stage_vary)]
    values = [
        _resolved(suite.path, key, listed, limits)
        for key, listed in [*experiment.vary.items(), *experiment.stage_vary.items()]
    ]
    for renderer, stage, (number, case), picked in itertools.product(
        experiment.renderers,
        experiment.stages,
        enumerate(experiment.cases),
        itertools.product(*values),
    ):
        varied = dict(zip(keys, picked, strict=True))
        settings = {"size": [600, 600], "spp": 64, **FRAMED, **experiment.settings, **case}
        settings |= {key: value for key, value in varied.items() if "." not in key}
        if any(all(settings.get(k) == v for k, v in skip.items()) for skip in experiment.skip):
            continue
        if threads is not None and "threads" not in experiment.vary:
            settings["threads"] = threads
        for key in ("threads", "lanes"):
            settings[key] = _resolve(suite.path, key, settings.get(key, 0), limits)
        source, name = _varied_stage(suite.stages[stage], stage, varied)
        parts = [experiment.name, name]
        parts += [] if renderer == WAVECOMB else [renderer]
        title = experiment.case_names[number]
        parts += [title or _case_name(case, number)] if len(experiment.cases) > 1 else []
        parts += [f"{key}-{value}" for key, value in varied.items() if "." not in key]
        factor = experiment.factor
        value = varied.get(factor, varied.get(f"stage.{factor}"))
        found.append(
            Config(
                name=".".join(_safe(part) for part in parts),
                experiment=experiment.name,
                renderer=renderer,
                stage=name,
                source=source,
                settings=settings,
                case=title,
                factor=factor,
                factor_value=float(value) if isinstance(value, (int, float)) else None,
                images=experiment.images,
                golden=experiment.golden,
            )
        )
    return found


def _case_name(case: Mapping[str, Any], number: int) -> str:
    if "size" in case and "spp" in case:
        width, height = case["size"]
        rest = [f"{value}" for key, value in case.items() if key not in ("size", "spp")]
        return "-".join([f"{width}x{height}", f"{case['spp']}spp", *rest])
    return "-".join(str(value) for value in case.values()) or f"case{number}"


def _varied_stage(
    source: StageSource, name: str, varied: Mapping[str, Any]
) -> tuple[StageSource, str]:
    options = {k.partition(".")[2]: v for k, v in varied.items() if k.startswith("stage.")}
    if not options:
        return source, name
    label = "-".join([name, *(f"{key}-{value}" for key, value in options.items())])
    return replace(source, options={**source.options, **options}), _safe(label)


def _safe(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9_.+-]+", "_", text)


def _resolved(path: Path, key: str, values: Sequence[Any], limits: Limits) -> list[Any]:
    """Returns the distinct values, without thread counts that this machine does not support."""
    found: list[Any] = []
    for value in values:
        number = _resolve(path, key, value, limits)
        above = key == "threads" and number > limits.threads
        if number not in found and not above:
            found.append(number)
    return found


def _resolve(path: Path, key: str, value: Any, limits: Limits) -> Any:
    if value == "all":
        return limits.threads
    if value == "widest":
        return limits.lanes
    if key == "lanes" and value == 0:
        return limits.lanes
    if key == "threads" and value == 0:
        return limits.threads
    if key == "texture_mb" and isinstance(value, str):
        return _cache_mb(path, value, limits)
    return value


def _cache_mb(path: Path, text: str, limits: Limits) -> float:
    """Converts "L2" or "0.5*L3" to megabytes of 10^6 bytes."""
    match = re.fullmatch(r"(?:([0-9.]+) ?\* ?)?(L2|L3)", text)
    if match is None:
        raise WavecombError(
            f"{path}: vary.stage.texture_mb: {text!r} must be a number, or like 'L2' or '4*L3'"
        )
    size = limits.cache_bytes.get(match[2], 0)
    if size <= 0:
        raise WavecombError(f"{path}: the size of {match[2]} is unknown on this machine")
    return round(float(match[1] or 1.0) * size / 1e6, 3)


# ---- Duration of a sitting, estimated from existing results or from a short calibration


_SIZE = 160
_SPP = 8
_BYTES_PER_SECOND = 25e6
"""Assumed rate at which textures are read and tiled during loading, in bytes per second."""
_TRIANGLES_PER_SECOND = 1.5e6
"""Assumed speed of reading meshes and building the BVH, in triangles per second."""


@dataclass
class Estimator:
    """Estimator of the duration of runs.

    Attributes:
        start_s: Wall time in seconds of a process with a small stage, without the render time.
        rate: Samples per second and thread, by number of lanes. Other renderers are assumed to be
            as fast as Wavecomb.
        measured: Wall times in seconds of finished runs, by configuration.
    """

    start_s: float = 1.0
    rate: dict[int, float] = field(default_factory=lambda: {0: 4e5})
    measured: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    _bias: list[float] = field(default_factory=list)

    def learn(self, config: Config, wall_s: float) -> None:
        """Corrects the estimates of all configurations by the wall time of a finished run."""
        guess = self._guess(config)
        self.measured[config.name].append(wall_s)
        if guess > 0.0:
            self._bias.append(wall_s / guess)

    def seconds(self, config: Config) -> float:
        """Returns the estimated seconds of one run."""
        known = self.measured.get(config.name)
        if known:
            return statistics.fmean(known)
        return self._guess(config) * (statistics.median(self._bias) if self._bias else 1.0)

    def total(self, runs: Iterable[Run]) -> float:
        """Returns the estimated seconds of several runs."""
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
    """Estimates the additional seconds for loading a stage, compared with a small stage."""
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
    """Measures renders of a small stage with each lane count in the plan, within seconds."""
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
    """Creates an estimator from finished runs, or returns None if there are none."""
    found = Estimator()
    for entry in objects:
        row = entry["row"]
        if row["status"] == "ok" and row["config"] in configs:
            found.learn(configs[row["config"]], float(row["wall_s"]))
    return found if found.measured else None
