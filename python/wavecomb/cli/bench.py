# SPDX-License-Identifier: Apache-2.0
"""``wavecomb bench``."""

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
    """Measure: suites of runs, interleaved, with the state of the machine (docs/bench.md)."""


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
        click.echo(f"{name:17} {runs:6} runs  {suite.title}")


@bench_command.command("run")
@click.argument("suite")
@add_options(
    option("-o --output DIR", "path", "Folder for results.", required=True),
    option("--dry-run", "flag", "Say what would be run, and for how long."),
    option("--resume", "flag", "Go on with the results in DIR."),
    option("--repetitions N", "count", "In place of the suite's."),
    option("--only GLOB", "text", "Only configurations whose name matches."),
    option(
        "--stage NAME", "text", "Only this stage; repeat for more.",
        name="only_these", multiple=True,
    ),
    option("--threads N", "count", "In place of the suite's."),
    option("--seed N", click.IntRange(min=0), "Of the order of the runs."),
    option("--time-limit MINUTES", "positive", "Begin no run past it."),
    option("--stages FOLDER", "path", "More stages, of a folder."),
    option(
        "--progress", click.Choice(["text", "json"]),
        "json: also lines on stdout, for programs (docs/bench.md).",
        default="text", show_default=True,
    ),
    option("--quiet", "flag", "Only warnings and errors."),
)  # fmt: skip
def run_command(
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
    """Run SUITE, a name of `wavecomb bench list` or a TOML file.

    Each run is a process of its own, on cores of its own. Results are in DIR as soon as a run is
    done; after Ctrl-C, SIGTERM or a kill, --resume goes on.
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

    def say(line: str) -> None:
        if not quiet or line.startswith("warning"):
            click.echo(line, err=True)

    sitting = Sitting(chosen, ResultFolder(Path(output)), options, say)
    if progress == "json":
        sitting.event = _event
    if dry_run:
        _dry_run(sitting)
        return
    with _stopped_by_sigterm():
        sitting.run()
    if not quiet and progress == "text":
        click.echo(f"results are in {output}; `wavecomb bench report {output}` shows them")


def _event(name: str, /, **values: object) -> None:
    """A line of JSON on stdout."""
    click.echo(json.dumps({"event": name, **values}))


@contextlib.contextmanager
def _stopped_by_sigterm() -> Iterator[None]:
    """SIGTERM ends a sitting as Ctrl-C does, so that the run that goes on ends with it."""

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
        click.echo(f"{config.name}: {runs} x {time_text(estimator.seconds(config))}")
    basis = "results in the folder" if estimator.measured else "a short calibration; rough"
    click.echo(
        f"{len(left)} runs of {len(sitting.configs)} configurations, "
        f"about {time_text(estimator.total(left))} (from {basis}), "
        "and what stages and golden pictures take to make"
    )


@bench_command.command("report")
@click.argument("folder", type=click.Path(), metavar="DIR")
@option(
    "--markdown FILE.md", "path",
    "Also a page of Markdown, with its figures in a folder FILE beside it.",
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
        build = import_module("wavecomb.bench.report").build
    except ImportError as error:
        raise WavecombError(
            f"bench report: {error.name} is missing; run `{install_command('bench')}`"
        ) from error
    page = Path(markdown) if markdown is not None else None
    click.echo(f"wrote {build(Path(folder), page)}")
    if page is not None:
        click.echo(f"wrote {page}")


@bench_command.command("compare")
@click.argument("before", type=click.Path(), metavar="BEFORE")
@click.argument("after", type=click.Path(), metavar="AFTER")
@option(
    "--metric", click.Choice(_METRICS), "The column of runs.csv that is compared.",
    default="render_s", show_default=True,
)  # fmt: skip
@option("--json", "flag", "For programs.", name="as_json")
def compare_command(before: str, after: str, metric: str, as_json: bool) -> None:
    """Say what changed from the results in BEFORE to those in AFTER.

    Configurations that both have are compared, AFTER / BEFORE, with 95 % intervals. Two sittings
    do not share their rounds: what the machine did between them is in the ratios, and warnings say
    what is known of it.
    """
    from wavecomb.bench.folders import compare_folders, lines_of

    found = compare_folders(Path(before), Path(after), metric)
    if as_json:
        click.echo(json.dumps(found.to_dict(), indent=2))
        return
    for line in lines_of(found):
        click.echo(line)
