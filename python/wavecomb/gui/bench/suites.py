# SPDX-License-Identifier: Apache-2.0
"""The suites that a benchmark can be chosen from, and the command that runs one. No Qt."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from wavecomb.errors import WavecombError


@dataclass(frozen=True)
class SuiteInfo:
    """A suite.

    Attributes:
        name: Of one of ours, or the path of a TOML file.
        title: One line.
        stages: Their names.
        repetitions: Its own.
        configurations: On this machine.
        seconds: Of one repetition of all, rough: a thread is taken to make 0.4 million samples a
            second, and stages and golden pictures are left out.
        experiments: Name and number of configurations of each.
    """

    name: str
    title: str
    stages: tuple[str, ...]
    repetitions: int
    configurations: int
    seconds: float
    experiments: tuple[tuple[str, int], ...]


def suite_infos() -> list[SuiteInfo]:
    """Those that come with Wavecomb, the quickest first."""
    from wavecomb.bench.suite import suite_names

    found = []
    for name in suite_names():
        try:
            found.append(suite_info(name))
        except WavecombError:
            continue  # one that asks for what this machine does not say
    return sorted(found, key=lambda info: info.seconds * info.repetitions)


def suite_info(name: str, stages: tuple[str, ...] = ()) -> SuiteInfo:
    """One of them, or a TOML file; of these stages only.

    Raises:
        WavecombError: It is no good; one line.
    """
    from wavecomb.bench.estimate import Estimator
    from wavecomb.bench.machine import limits
    from wavecomb.bench.plan import configurations
    from wavecomb.bench.stage_folder import only_stages
    from wavecomb.bench.suite import find_suite, load_suite

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
    """What a benchmark is started with.

    Attributes:
        suite: Name or TOML file.
        folder: For results.
        stages: Only these; all of them where it is empty.
        more_stages: A folder of further stages, or None.
        repetitions: In place of the suite's; None: its own.
    """

    suite: str
    folder: Path
    stages: tuple[str, ...] = ()
    more_stages: Path | None = None
    repetitions: int | None = None

    @property
    def resumes(self) -> bool:
        """Whether the folder holds results to go on with."""
        return (self.folder / "runs.csv").is_file()

    def arguments(self, *, dry: bool = False) -> list[str]:
        """Arguments of `wavecomb`."""
        words = ["bench", "run", self.suite, "-o", str(self.folder)]
        for stage in self.stages:
            words += ["--stage", stage]
        if self.more_stages is not None:
            words += ["--stages", str(self.more_stages)]
        if self.repetitions is not None:
            words += ["--repetitions", str(self.repetitions)]
        if self.resumes:
            words.append("--resume")
        return [*words, "--dry-run"] if dry else [*words, "--progress", "json"]
