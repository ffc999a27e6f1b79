# SPDX-License-Identifier: Apache-2.0
"""Commands ``wavecomb bench ...``, which measure and report benchmark suites."""

from __future__ import annotations

import contextlib
import json
import signal
import threading
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import click

from wavecomb.cli.options import examples
from wavecomb.cli.setting_options import add_options, option
from wavecomb.terminal import say

_METRICS = (
    *("render_s", "shade_and_order_s", "shade_s", "load_s", "build_s"),
    *("samples_per_s", "peak_rss_mb", "rel_mse", "efficiency"),
)


@click.group(
    "bench",
    epilog=examples(
        "wavecomb bench list",
        "wavecomb bench run quick -o results --dry-run",
        "wavecomb bench run quick -o results",
        "wavecomb bench run quick -o results --resume",
        "wavecomb bench run my.toml -o results --only 'orders.*'",
        "wavecomb bench report results",
        "wavecomb bench report results --markdown out/quick.md",
        "wavecomb bench compare results-before results-after",
    ),
)
def bench_command() -> None:
    """Run benchmark suites and record the state of the machine.

    Runs of different configurations are interleaved. See docs/bench.md.
    """


@bench_command.command("list")
def list_command() -> None:
    """List the suites that come with Wavecomb."""
    from wavecomb.bench.machine import limits
    from wavecomb.bench.plan import configurations
    from wavecomb.bench.suite import find_suite, load_suite, suite_names

    here = limits()
    for name in suite_names():
        suite = load_suite(find_suite(name))
        runs = len(configurations(suite, here)) * suite.repetitions
        say(f"{name:17} {runs:6} runs  {suite.title}")


@bench_command.command("run")
@click.argument("suite")
@add_options(
    option("-o --output DIR", "path", "Folder to write the results to.", required=True),
    option(
        "--dry-run", "flag",
        "Print the runs of the suite and their estimated time, but run nothing.",
    ),
    option("--resume", "flag", "Continue an interrupted suite with the results in DIR."),
    option(
        "--repetitions N", "count",
        "Number of repetitions of each run.  [default: the suite's number]",
    ),
    option("--only GLOB", "text", "Run only configurations whose name matches GLOB."),
    option(
        "--stage NAME", "text", "Run only the stage NAME (repeatable).",
        name="only_these", multiple=True,
    ),
    option("--threads N", "count", "Number of render threads.  [default: the suite's number]"),
    option("--seed N", click.IntRange(min=0), "Seed of the random order of runs."),
    option(
        "--time-limit MINUTES", "positive",
        "Stop before the first run that would exceed this total time.",
    ),
    option("--stages FOLDER", "path", "Folder with additional stages for the suite."),
    option(
        "--progress", click.Choice(["text", "json"]),
        "Format of progress; json also prints one JSON object per line on standard output "
        "(docs/bench.md).",
        default="text", show_default=True,
    ),
    option("--quiet", "flag", "Print only warnings and errors."),
)  # fmt: skip
def run_command(
    *,
    suite: str,
    output: str,
    dry_run: bool,
    resume: bool,
    repetitions: int | None,
    only: str | None,
    only_these: tuple[str, ...],
    threads: int | None,
    seed: int | None,
    time_limit: float | None,
    stages: str | None,
    progress: str,
    quiet: bool,
) -> None:
    """Run SUITE, a name from `wavecomb bench list` or a TOML file.

    Each run of the suite is a separate process, pinned to its cores. Results are written to DIR
    after each run. After Ctrl-C, SIGTERM or a kill, --resume continues.
    """
    from wavecomb.bench.results import ResultFolder
    from wavecomb.bench.runner import Options, Sitting
    from wavecomb.bench.suite import find_suite, load_suite
    from wavecomb.bench.suite_model import naming_folder

    chosen = load_suite(find_suite(suite))
    if stages is not None:
        chosen = naming_folder(chosen, Path(stages))
    limit = time_limit * 60.0 if time_limit is not None else None
    options = Options(repetitions, only, threads, seed, limit, resume, only_these)

    def tell(line: str) -> None:
        if not quiet or line.startswith("warning"):
            say(line, err=True)

    sitting = Sitting(chosen, ResultFolder(Path(output)), options, tell)
    if progress == "json":
        sitting.event = _event
    if dry_run:
        _dry_run(sitting)
        return
    with _stopped_by_sigterm():
        sitting.run()
    if not quiet and progress == "text":
        say(f"results are in {output}; `wavecomb bench report {output}` shows them")


def _event(name: str, /, **values: object) -> None:
    """Prints a line of JSON on standard output."""
    click.echo(json.dumps({"event": name, **values}))


@contextlib.contextmanager
def _stopped_by_sigterm() -> Iterator[None]:
    """Makes SIGTERM end the suite as Ctrl-C does, so that the current run also ends."""

    def stop(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _dry_run(sitting: object) -> None:
    from wavecomb.bench.results import read_objects
    from wavecomb.bench.runner import Sitting
    from wavecomb.run.progress import time_text

    assert isinstance(sitting, Sitting)
    sitting.folder.objects = read_objects(sitting.folder.runs_jsonl)
    estimator = sitting.estimator()
    left = sitting.left() if sitting.options.resume else sitting.plan
    for config in sitting.configs:
        runs = sum(run.config is config for run in left)
        say(f"{config.name}: {runs} x {time_text(estimator.seconds(config))}")
    basis = "results in the folder" if estimator.measured else "a short calibration; rough"
    say(
        f"{len(left)} runs of {len(sitting.configs)} configurations, "
        f"about {time_text(estimator.total(left))} (from {basis}), "
        "plus the time for making stages and golden images"
    )


@bench_command.command("report")
@click.argument("folder", type=click.Path(), metavar="DIR")
@option(
    "--markdown FILE.md", "path",
    "Also write the report as a Markdown page, with its figures in a folder beside it.",
)  # fmt: skip
def report_command(folder: str, markdown: str | None) -> None:
    """Write DIR/report.html and DIR/figures from the results in DIR."""
    from wavecomb.errors import WavecombError
    from wavecomb.extras import install_command

    if markdown is not None and not markdown.endswith(".md"):
        raise WavecombError(f"--markdown {markdown}: give a file whose name ends in .md")
    if not (Path(folder) / "runs.csv").is_file():
        raise WavecombError(f"{folder}: holds no runs.csv; `wavecomb bench run` makes it")
    try:
        build = import_module("wavecomb.bench.reports.page").build
    except ImportError as error:
        raise WavecombError(
            f"bench report: {error.name} is missing; run `{install_command('bench')}`"
        ) from error
    page = Path(markdown) if markdown is not None else None
    say(f"wrote {build(Path(folder), page)}")
    if page is not None:
        say(f"wrote {page}")


@bench_command.command("compare")
@click.argument("before", type=click.Path(), metavar="BEFORE")
@click.argument("after", type=click.Path(), metavar="AFTER")
@option(
    "--metric", click.Choice(_METRICS), "Column of runs.csv to compare.",
    default="render_s", show_default=True,
)  # fmt: skip
@option("--json", "flag", "Print JSON on standard output.", name="as_json")
def compare_command(before: str, after: str, metric: str, as_json: bool) -> None:
    """Report what changed from the results in BEFORE to those in AFTER.

    Prints the ratio AFTER / BEFORE with a 95 % interval for each configuration that both have. The
    two folders do not share their rounds, so changes of the machine between them affect the ratios;
    warnings name the known ones.
    """
    from wavecomb.bench.analysis.folder_changes import compare_folders, lines_of

    found = compare_folders(Path(before), Path(after), metric)
    if as_json:
        click.echo(json.dumps(found.to_dict(), indent=2))
        return
    for line in lines_of(found):
        say(line)
