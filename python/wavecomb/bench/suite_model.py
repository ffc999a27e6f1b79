# SPDX-License-Identifier: Apache-2.0
"""What a suite is: stages, experiments, converged pictures."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from wavecomb.errors import WavecombError

WAVECOMB = "wavecomb"
PEERS = ("mitsuba-scalar", "mitsuba-llvm", "cycles")
RENDERERS = (WAVECOMB, *PEERS)


@dataclass(frozen=True)
class StageSource:
    """Where a stage comes from: a generated scene with options, or a file.

    Attributes:
        scene: Name of a generated scene, or "".
        options: Its ``SceneOptions``.
        file: Path of a stage, or None.
        camera: Camera prim of a file, or None.
    """

    scene: str = ""
    options: dict[str, Any] = field(default_factory=dict)
    file: Path | None = None
    camera: str | None = None


@dataclass(frozen=True)
class Experiment:
    """Runs that are compared with one another.

    Attributes:
        name: Unique in the suite.
        stages: Names of stages.
        renderers: Of ``RENDERERS``.
        settings: The same in all runs.
        vary: Setting -> values; all combinations are run.
        stage_vary: Option of the stage -> values, likewise.
        cases: Settings that change together; each is combined with all of ``vary``.
        case_names: Of the cases, in their order; "": it has none. Cases that have names are
            compared with the one that is named "off".
        skip: Combinations to leave out: those that agree with all keys of one entry.
        factor: The key of ``vary`` or ``stage_vary`` that a scaling curve is drawn over, or "".
        images: Which repetitions keep their picture: "none", "first" or "all".
        golden: Pictures are compared with a converged one.
    """

    name: str
    stages: tuple[str, ...]
    renderers: tuple[str, ...] = (WAVECOMB,)
    settings: dict[str, Any] = field(default_factory=dict)
    vary: dict[str, list[Any]] = field(default_factory=dict)
    stage_vary: dict[str, list[Any]] = field(default_factory=dict)
    cases: tuple[dict[str, Any], ...] = ({},)
    case_names: tuple[str, ...] = ("",)
    skip: tuple[dict[str, Any], ...] = ()
    factor: str = ""
    images: str = "none"
    golden: bool = False


@dataclass(frozen=True)
class Golden:
    """How converged pictures are made: samples per pixel, integrator, seed."""

    spp: int = 1024
    integrator: str = "reference"
    seed: int = 90001


@dataclass(frozen=True)
class Suite:
    """A suite as its file says it.

    Attributes:
        name: Short.
        title: One line.
        path: The file.
        text: What it holds.
        repetitions: Of each configuration.
        warm_up: Discarded runs of each stage before the first round.
        seed: Of the order of runs.
        golden: See ``Golden``.
        stages: By name.
        experiments: In order.
    """

    name: str
    title: str
    path: Path
    text: str
    repetitions: int
    warm_up: int
    seed: int
    golden: Golden
    stages: dict[str, StageSource]
    experiments: tuple[Experiment, ...]


# ---- Which stages a suite is run on: those of a folder besides, or only some ---------------------


STAGE_SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")


def with_folder(suite: Suite, folder: Path) -> Suite:
    """The suite with the stages of a folder added to each experiment that varies none.

    Raises:
        WavecombError: There is none, or two have one name.
    """
    files = sorted(p for p in folder.glob("*") if p.suffix.lower() in STAGE_SUFFIXES)
    if not folder.is_dir() or not files:
        raise WavecombError(f"stages of {folder}: no {', '.join(STAGE_SUFFIXES)} in this folder")
    more = {path.stem: StageSource(file=path.resolve()) for path in files}
    twice = set(more) & set(suite.stages)
    if twice or len(more) < len(files):
        name = min(twice) if twice else "two of its files"
        raise WavecombError(f"stages of {folder}: {name} has the name of another stage; rename it")
    experiments = tuple(
        experiment
        if experiment.stage_vary
        else replace(experiment, stages=(*experiment.stages, *more))
        for experiment in suite.experiments
    )
    return replace(suite, stages={**suite.stages, **more}, experiments=experiments)


def naming_folder(suite: Suite, folder: Path) -> Suite:
    """``with_folder``, and the suite's text names the folder: what was run can be read from it."""
    more = with_folder(suite, folder)
    # A JSON string is a basic string of TOML.
    key = f"stages_folder = {json.dumps(folder.resolve().as_posix(), ensure_ascii=False)}\n"
    return replace(more, text=key + suite.text)


def only_stages(suite: Suite, names: Sequence[str]) -> Suite:
    """The suite with these stages alone; all of them where no name is given.

    Raises:
        WavecombError: The suite has no such stage.
    """
    if not names:
        return suite
    for name in names:
        if name not in suite.stages:
            there = ", ".join(suite.stages)
            raise WavecombError(f"--stage {name}: no such stage in {suite.path}; it has {there}")
    experiments = (
        replace(experiment, stages=tuple(name for name in experiment.stages if name in names))
        for experiment in suite.experiments
    )
    return replace(suite, experiments=tuple(e for e in experiments if e.stages))
