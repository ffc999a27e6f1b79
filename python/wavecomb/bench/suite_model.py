# SPDX-License-Identifier: Apache-2.0
"""What a suite is: stages, experiments, converged pictures."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

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
