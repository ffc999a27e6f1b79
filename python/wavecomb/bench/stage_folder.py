# SPDX-License-Identifier: Apache-2.0
"""Which stages a suite is run on: those of a folder besides, or only some."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from wavecomb.bench.suite_model import StageSource, Suite
from wavecomb.errors import WavecombError

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
