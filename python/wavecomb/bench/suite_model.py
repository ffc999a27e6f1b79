# SPDX-License-Identifier: Apache-2.0
"""Data classes of a suite: stages, experiments, converged images."""

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
    """Source of a stage: a generated scene with options, or a file.

    Attributes:
        scene: Name of a generated scene, or "".
        options: Fields of ``SceneOptions`` for the scene.
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
        name: Name of the experiment, unique in the suite.
        stages: Names of stages.
        renderers: Names from ``RENDERERS``.
        settings: Settings that all runs share.
        vary: For each setting, the values to run; all combinations are run.
        stage_vary: Values of each varied option of generated stages; all combinations are run.
        cases: Groups of settings that change together. Each case is combined with all values of
            ``vary``.
        case_names: Name of each case, or "" for a case without a name. Named cases are compared
            with the case named "off".
        skip: Combinations that are not run. A combination is skipped if it has all values of an
            entry.
        factor: Key of ``vary`` or ``stage_vary`` over which a scaling curve is drawn, or "".
        images: Repetitions whose images are kept: "none", "first" or "all".
        golden: Whether images are compared with a converged image.
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
    """Settings of converged images: samples per pixel, integrator, seed."""

    spp: int = 1024
    integrator: str = "reference"
    seed: int = 90001


@dataclass(frozen=True)
class Suite:
    """A suite, as its file describes it.

    Attributes:
        name: Short name.
        title: Title in one line.
        path: File of the suite.
        text: Contents of the file.
        repetitions: Repetitions of each configuration.
        warm_up: Number of discarded runs of each stage before the first round.
        seed: Seed for the random order of runs.
        golden: See ``Golden``.
        stages: Sources of stages by name.
        experiments: Experiments in the order of the file.
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


# ---- Choice of stages: additional ones from a folder, or only some of the suite


STAGE_SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")


def with_folder(suite: Suite, folder: Path) -> Suite:
    """Adds the stages of a folder to each experiment without varied stage options.

    Raises:
        WavecombError: The folder has no stages, or two stages have the same name.
    """
    files = sorted(p for p in folder.glob("*") if p.suffix.lower() in STAGE_SUFFIXES)
    if not folder.is_dir() or not files:
        raise WavecombError(f"stages of {folder}: no {', '.join(STAGE_SUFFIXES)} in this folder")
    more = {path.stem: StageSource(file=path.resolve()) for path in files}
    twice = set(more) & set(suite.stages)
    if twice or len(more) < len(files):
        name = min(twice) if twice else "two of its files"
        raise WavecombError(
            f"stages of {folder}: {name} has the same name as another stage; rename it"
        )
    experiments = tuple(
        experiment
        if experiment.stage_vary
        else replace(experiment, stages=(*experiment.stages, *more))
        for experiment in suite.experiments
    )
    return replace(suite, stages={**suite.stages, **more}, experiments=experiments)


def naming_folder(suite: Suite, folder: Path) -> Suite:
    """Adds the stages of a folder to a suite, and adds the folder's path to the suite's text."""
    more = with_folder(suite, folder)
    # Write the path as a JSON string, which is also a valid basic string of TOML.
    key = f"stages_folder = {json.dumps(folder.resolve().as_posix(), ensure_ascii=False)}\n"
    return replace(more, text=key + suite.text)


def only_stages(suite: Suite, names: Sequence[str]) -> Suite:
    """Restricts the suite to the given stages; keeps all of them if no name is given.

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
