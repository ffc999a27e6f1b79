# SPDX-License-Identifier: Apache-2.0
"""Suites to choose from, and the command that runs one. No Qt."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from wavecomb.errors import WavecombError


@dataclass(frozen=True)
class SuiteInfo:
    """Facts about a suite.

    Attributes:
        name: A name of `wavecomb bench list`, or the path of a TOML file.
        title: One line.
        stages: Names of its stages.
        repetitions: Default number of repetitions.
        configurations: Number of configurations on this machine.
        seconds: Rough time of one repetition of all configurations, at 0.4 million samples per
            second and thread; without making stages and golden pictures.
        experiments: Name and number of configurations of each experiment.
    """

    name: str
    title: str
    stages: tuple[str, ...]
    repetitions: int
    configurations: int
    seconds: float
    experiments: tuple[tuple[str, int], ...]


def suite_infos() -> list[SuiteInfo]:
    """Returns the suites that come with Wavecomb, the fastest first."""
    from wavecomb.bench.suite import suite_names

    found = []
    for name in suite_names():
        try:
            found.append(suite_info(name))
        except WavecombError:
            continue  # the suite needs a property of the machine that is unknown here
    return sorted(found, key=lambda info: info.seconds * info.repetitions)


def suite_info(name: str, stages: tuple[str, ...] = ()) -> SuiteInfo:
    """Reads a suite by name or TOML file, restricted to some stages.

    Raises:
        WavecombError: The suite is invalid; one line.
    """
    from wavecomb.bench.machine import limits
    from wavecomb.bench.plan import Estimator, configurations
    from wavecomb.bench.suite import find_suite, load_suite
    from wavecomb.bench.suite_model import only_stages

    suite = load_suite(find_suite(name))
    configs = configurations(only_stages(suite, stages), limits())
    estimator = Estimator()
    names = [config.experiment for config in configs]
    return SuiteInfo(
        name=name,
        title=suite.title or suite.name,
        stages=tuple(suite.stages),
        repetitions=suite.repetitions,
        configurations=len(configs),
        seconds=sum(estimator.seconds(config) for config in configs),
        experiments=tuple((name, names.count(name)) for name in dict.fromkeys(names)),
    )


@dataclass(frozen=True)
class Choice:
    """Arguments of a benchmark.

    Attributes:
        suite: Name or TOML file.
        folder: Results folder.
        stages: Stages to run; empty means all.
        repetitions: None means the suite's default.
    """

    suite: str
    folder: Path
    stages: tuple[str, ...] = ()
    repetitions: int | None = None

    @property
    def resumes(self) -> bool:
        """Whether the folder holds results that the suite would resume."""
        return (self.folder / "runs.csv").is_file()

    def arguments(self, *, dry: bool = False) -> list[str]:
        """Returns the arguments of the `wavecomb` command."""
        words = ["bench", "run", self.suite, "-o", str(self.folder)]
        for stage in self.stages:
            words += ["--stage", stage]
        if self.repetitions is not None:
            words += ["--repetitions", str(self.repetitions)]
        if self.resumes:
            words.append("--resume")
        return [*words, "--dry-run"] if dry else [*words, "--progress", "json"]
