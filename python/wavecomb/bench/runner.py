# SPDX-License-Identifier: Apache-2.0
"""Runs a suite: prepares stages, converged images and true costs, then executes the runs."""

from __future__ import annotations

import os
import shlex
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from wavecomb.bench import machine
from wavecomb.bench.jobs import Jobs, check_files, check_peers, generate, make_profile, run_peer
from wavecomb.bench.oracle import ORACLES
from wavecomb.bench.plan import (
    Config,
    Estimator,
    Run,
    calibrate,
    chosen,
    configurations,
    from_results,
    schedule,
)
from wavecomb.bench.process import Outcome, available, run_worker
from wavecomb.bench.results import ResultFolder, run_row
from wavecomb.bench.suite_model import WAVECOMB, Suite, only_stages
from wavecomb.bench.worker import judge_picture
from wavecomb.errors import WavecombError
from wavecomb.run.progress import time_text

Say = Callable[[str], None]


def _no_event(name: str, /, **values: Any) -> None:
    """Ignores an event."""


@dataclass(frozen=True)
class Options:
    """Options of ``wavecomb bench run``.

    Attributes:
        repetitions: Overrides the suite's repetitions.
        only: Pattern for names of configurations.
        threads: Overrides the suite's thread count in runs that do not vary the thread count.
        seed: Overrides the suite's seed for the order of runs.
        time_limit_s: Time limit in seconds; a run that would probably end later is not started.
        resume: Whether to continue with the results in the folder.
        stages: Names of stages to run; empty means all.
    """

    repetitions: int | None = None
    only: str | None = None
    threads: int | None = None
    seed: int | None = None
    time_limit_s: float | None = None
    resume: bool = False
    stages: tuple[str, ...] = ()


@dataclass
class Sitting:
    """One call of ``wavecomb bench run``.

    ``say`` receives messages for users, and ``event`` receives the same messages as named values
    for programs (docs/bench.md).

    The method ``run`` may be stopped at any moment, for example by a signal. The results of
    finished runs are kept.
    """

    suite: Suite
    folder: ResultFolder
    options: Options
    say: Say
    event: Callable[..., None] = _no_event
    events: dict[str, str] = field(default_factory=dict)
    spins: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Builds the plan."""
        limits = machine.limits()
        if self.options.threads is not None and self.options.threads > limits.threads:
            raise WavecombError(
                f"--threads {self.options.threads}: this process may use {limits.threads} cores"
            )
        suite = only_stages(self.suite, self.options.stages)
        every = configurations(suite, limits, self.options.threads)
        self.configs = chosen(every, self.options.only)
        repetitions = self.options.repetitions or self.suite.repetitions
        seed = self.suite.seed if self.options.seed is None else self.options.seed
        self.plan = schedule(self.configs, repetitions, seed)
        self.cpus = machine.cores()
        self.jobs = Jobs(self.suite, self.folder, self.cpus)

    def estimator(self) -> Estimator:
        """Returns an estimator of run times, based on earlier results or else on a calibration."""
        by_name = {config.name: config for config in self.configs}
        known = from_results(self.folder.objects, by_name)
        return known or calibrate(self.configs, self.cpus)

    def left(self) -> list[Run]:
        """Returns the runs of the plan that are not done."""
        done = self.folder.done()
        return [run for run in self.plan if run.run_id not in done]

    def run(self) -> bool:
        """Executes the remaining runs. Returns False if the time limit stopped the runs."""
        check_files(self.configs)
        check_peers({config.renderer for config in self.configs} - {WAVECOMB})
        if self.options.resume:
            self.folder.resume(self.suite)
        else:
            self.folder.create(self.suite)
        begun = time.monotonic()
        self._begin()
        left = self.left()
        if left:
            self._prepare(left)
            estimator = self.estimator()
            total = estimator.total(left)
            self.say(f"{len(left)} runs, about {time_text(total)}")
            self.event("plan", runs=len(left), done=len(self.plan) - len(left), seconds_left=total)
        whole = True
        for index, run in enumerate(left):
            rest = estimator.seconds(run.config)
            limit = self.options.time_limit_s
            if limit is not None and time.monotonic() - begun + rest > limit:
                self.say(f"time limit: {len(left) - index} runs are left; --resume continues")
                whole = False
                break
            self.event("begin", number=index + 1, run=run.run_id, seconds=rest)
            row = self._one(run)
            estimator.learn(run.config, row["wall_s"])
            self._report_run(row, index + 1, left, estimator)
        self._end()
        self.event("done", folder=str(self.folder.path), whole=whole, failed=self._failed())
        return whole

    # ---- before the first run ------------------------------------------------------------------

    def _begin(self) -> None:
        """Records the machine. Raises WavecombError if the results come from another build."""
        document = self.folder.machine()
        state = machine.machine_state()
        if document and document.get("native_sha256") != state["native_sha256"]:
            raise WavecombError(
                f"{self.folder.path}: its results are of another build of Wavecomb; "
                "choose another folder"
            )
        if document and document.get("commit") != state["commit"]:
            self.say(f"note: results so far are of commit {document.get('commit')}")
        counters = available()
        self.events = counters.events
        if counters.missing:
            (reason, _), *_ = Counter(counters.missing.values()).most_common(1)
            self.say(f"no hardware counters for {', '.join(counters.missing)}: {reason}")
        threads = len(self.cpus)
        self.spins = list(document.get("spins_s", []))[-200:]
        self.spins += [machine.spin(threads) for _ in range(5)]
        sitting = {
            "started": machine.now(),
            "command": shlex.join(["wavecomb", *sys.argv[1:]]),
            "load_before": state["load_before"],
            "commit": state["commit"],
            "dirty": state["dirty"],
        }
        self._document: dict[str, Any] = {
            **state,
            **{key: document[key] for key in ("time", "load_before") if key in document},
            "pinning": _pinning(self.cpus),
            "counters": {"events": counters.events, "missing": counters.missing},
            "sittings": [*document.get("sittings", []), sitting],
        }
        self._keep_machine()

    def _prepare(self, left: Sequence[Run]) -> None:
        """Prepares stages, converged images and true costs, then executes the warm-up runs."""
        configs = list({run.config.name: run.config for run in left}.values())
        stages = {self.jobs.stage(config): config for config in configs}
        for path, config in stages.items():
            if not path.exists():
                self._prepares("stage", config.stage)
                generate(config.source, path)
        # Variants of a renderer share one golden image, which the variant that comes last in
        # alphabetical order renders. For Mitsuba, this is the variant llvm, which is faster than
        # scalar.
        by_name = sorted(configs, key=lambda config: config.renderer, reverse=True)
        goldens = {self.jobs.golden(c): c for c in by_name if c.golden}
        for path, config in goldens.items():
            if not path.exists():
                spp = self.suite.golden.spp
                self._prepares("golden", f"{path.stem}: {spp} samples per pixel")
                self._converge(config, path)
        profiles = {self.jobs.profile(c): c for c in configs if c.settings.get("policy") in ORACLES}
        for path, config in profiles.items():
            if not path.exists():
                self._prepares("trace", path.stem)
                make_profile(self.jobs, config, self.folder.path)
        for _ in range(self.suite.warm_up):
            for config in stages.values():
                if config.renderer == WAVECOMB:
                    self.event("prepare", what="warm-up", name=config.stage)
                    run_worker(self.jobs.warm_up(config), {}, self.folder.path)

    def _prepares(self, what: str, name: str) -> None:
        self.say(f"{what} {name}")
        self.event("prepare", what=what, name=name)

    def _converge(self, config: Config, path: Path) -> None:
        if config.renderer == WAVECOMB:
            outcome = run_worker(self.jobs.converged(config), {}, self.folder.path)
        else:
            golden, threads = self.suite.golden, self._threads(config)
            stage = self.jobs.stage(config)
            outcome = run_peer(config, stage, golden.spp, golden.seed, path, threads)
        if outcome.answer["status"] != "ok":
            raise WavecombError(f"golden image of {config.stage}: {outcome.answer['error']}")

    # ---- runs ----------------------------------------------------------------------------------

    def _threads(self, config: Config) -> int:
        return int(config.settings.get("threads", 0)) or len(self.cpus)

    def _start(self, run: Run) -> Outcome:
        if run.config.renderer == WAVECOMB:
            return run_worker(self.jobs.timed(run), self.events, self.folder.path)
        return self._start_peer(run)

    def _start_peer(self, run: Run) -> Outcome:
        import numpy as np

        config = run.config
        kept = self.jobs.image(run)
        image = kept or self.folder.path / "images" / f".{run.config.name}.npy"
        spp = int(config.settings["spp"])
        stage, threads = self.jobs.stage(config), self._threads(config)
        outcome = run_peer(config, stage, spp, run.repetition, image, threads)
        if outcome.answer["status"] == "ok":
            golden = {"file": str(self.jobs.golden(config)), "spp": self.suite.golden.spp}
            outcome.answer |= judge_picture(np.load(image), spp, golden if config.golden else None)
        if kept is None:
            image.unlink(missing_ok=True)
        return outcome

    def _one(self, run: Run) -> dict[str, Any]:
        """Executes a run between two tests of the machine's speed, and returns its row."""
        threads = len(self.cpus)
        before = machine.spin(threads)
        outcome = self._start(run)
        after = machine.spin(threads)
        self.spins += [before, after]
        spin_s = 0.5 * (before + after)
        reference = machine.spin_reference(self.spins)
        row = run_row(self.suite, run, len(self.folder.objects), outcome.answer)
        row |= {
            "wall_s": outcome.wall_s,
            "others_share": outcome.others_share,
            "spin_s": spin_s,
            "noisy": machine.is_noisy(outcome.others_share, spin_s, reference),
            "load_average": outcome.load_average,
            "started": outcome.started,
        }
        job = {"settings": run.config.settings, "stage": str(self.jobs.stage(run.config))}
        if run.config.golden:
            job["golden"] = self._relative(self.jobs.golden(run.config))
        image = self.jobs.image(run)
        if image is not None:
            job["image"] = self._relative(image)
        self.folder.append({"row": row, "job": job, "spins_s": [before, after], **outcome.answer})
        return row

    def _relative(self, path: Path) -> str:
        return path.relative_to(self.folder.path).as_posix()

    def _report_run(
        self, row: dict[str, Any], number: int, left: Sequence[Run], estimator: Estimator
    ) -> None:
        seconds_left = estimator.total(left[number:])
        rest = time_text(seconds_left)
        what = f"{row['render_s']:.3f} s" if row["status"] == "ok" else f"FAILED: {row['error']}"
        busy = " (noisy)" if row["noisy"] else ""
        self.say(f"{number}/{len(left)} {row['run_id']}: {what}{busy}; {rest} left")
        told = {key: row[key] for key in ("status", "render_s", "error", "noisy") if key in row}
        self.event("run", number=number, run=row["run_id"], seconds_left=seconds_left, **told)

    # ---- after the last ------------------------------------------------------------------------

    def _end(self) -> None:
        verdict = machine.judge(entry["row"] for entry in self.folder.objects)
        self._document["noise"] = verdict.to_dict()
        self._document["sittings"][-1]["ended"] = machine.now()
        self._keep_machine()
        for line in verdict.lines:
            self.say(f"warning: noisy machine: {line}")
        failed = self._failed()
        if failed:
            self.say(f"warning: {failed} runs failed; --resume tries them again")

    def _failed(self) -> int:
        """Counts the runs in the results folder that failed and have not succeeded since."""
        failed = {o["row"]["run_id"] for o in self.folder.objects if o["row"]["status"] != "ok"}
        return len(failed - self.folder.done())

    def _keep_machine(self) -> None:
        self._document["spins_s"] = self.spins[-200:]
        self.folder.write_machine(self._document)


def _pinning(cpus: list[int]) -> dict[str, Any]:
    if hasattr(os, "sched_setaffinity"):
        return {"cores": cpus, "how": "each process stays on the first `threads` of these cores"}
    return {"cores": None, "how": "not possible on this system"}
