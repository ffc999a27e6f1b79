# SPDX-License-Identifier: Apache-2.0
"""``wavecomb render``."""

from __future__ import annotations

import os
from typing import Any

import click

from wavecomb.cli.aovs import AovOptions, aov_options
from wavecomb.cli.done import Done
from wavecomb.cli.frames import check_frames, frame_options, open_frames, render_sequence
from wavecomb.cli.job import Job, Names, Shot, Still, how_far, purpose_at
from wavecomb.cli.options import StageOptions, examples, isolation_options, stage_options
from wavecomb.cli.products import Plan, plan_products
from wavecomb.cli.purpose import PurposeOptions, purpose_options
from wavecomb.cli.reporting import make_reporter
from wavecomb.cli.row_options import Real
from wavecomb.cli.sandbox import enter_to_render
from wavecomb.cli.setting_options import SettingCommand, setting_options
from wavecomb.options import settings as known_settings
from wavecomb.run import aovs as aov_names


@click.command(
    "render",
    cls=SettingCommand,
    epilog=examples(
        "wavecomb render shot.usd -o shot.exr",
        "wavecomb render shot.usd -o shot.exr --png shot.png --size 1920 1080 --spp 256",
        "wavecomb render shot.usd -o shot.exr --camera /World/Cam --frame 101 --stats shot.json",
        "wavecomb render shot.usd -o shot.####.exr --frames 1-48 --skip-existing",
        "wavecomb render shot.usd -o shot.exr --noise 0.02 --denoise --png shot.png",
        "wavecomb render shot.usd -o shot.exr --time-limit 60 --preview preview.png",
        "wavecomb render shot.usd -o shot.exr --spp 4096 --checkpoint shot.ckpt",
        "wavecomb render shot.usd -o shot.exr --resume shot.ckpt",
        "wavecomb render shot.usd -o shot.exr --policy adaptive --costs shot-costs.json",
    ),
)
@stage_options
@frame_options
@isolation_options
@click.option(
    "-o",
    "--output",
    type=click.Path(),
    metavar="FILE.exr",
    help="Picture, all layers.  [default: the productName of each render product]",
)
@click.option(
    "--output-dir",
    type=click.Path(),
    metavar="DIR",
    help="Without -o: the folder that the stage's pictures go to, and may not leave.  "
    "[default: the working folder]",
)
@aov_options
@click.option("--png", type=click.Path(), metavar="FILE", help="Picture for display, too.")
@click.option(
    "--stats",
    "stats_file",
    type=click.Path(),
    metavar="FILE.json",
    help="Statistics (docs/statistics.md).",
)
@click.option(
    "--size",
    nargs=2,
    type=int,
    metavar="W H",
    help="Pixels.  [default: of the render settings, else 600 600]",
)
@click.option(
    "--region",
    nargs=4,
    type=int,
    metavar="X0 Y0 X1 Y1",
    help="Pixels to render, the end excluded; others have no samples.  "
    "[default: the render settings' data window, else all]",
)
@click.option(
    "--spp",
    type=int,
    metavar="N",
    help="Samples per pixel; with --adaptive and --noise the most of them.  [default: 64]",
)
@purpose_options
@setting_options()
@click.option(
    "--costs",
    metavar="auto|measured|model|FILE.json",
    help="Costs of materials. A file is read if it is there, and written at the end.  "
    "[default: auto]",
)
@click.option(
    "--film-memory",
    type=Real(0, above=True),
    metavar="MB",
    help="A picture that takes more is rendered and written in bands of rows.  "
    "[default: half of the machine's memory]",
)
@click.option("--exposure", type=Real(), default=0.0, metavar="EV", help="Of the PNG, in stops.")
@click.option(
    "--tone-map",
    type=click.Choice(["clamp", "neutral"]),
    default="clamp",
    help="Of the PNG: cut at 1, or roll highlights off.  [default: clamp]",
)
@click.option("--quiet", is_flag=True, help="Only warnings and errors.")
def render_command(
    stage: str,
    output: str | None,
    output_dir: str | None,
    png: str | None,
    stats_file: str | None,
    size: tuple[int, int] | None,
    spp: int | None,
    exposure: float,
    tone_map: Any,
    quiet: bool,
    costs: str | None,
    frames: str | None,
    skip_existing: bool,
    film_memory: float | None,
    **options: Any,
) -> None:
    """Render STAGE to an OpenEXR file, or its frames to one each.

    The file has the layers beauty (R, G, B), albedo, normal, depth and samples, or those that --aov
    asks for; error and variance where the render is adaptive; denoised with --denoise. Ctrl-C and
    SIGTERM stop and write what is done (exit codes 130 and 143). Files are written whole or not at
    all. docs/render.md and docs/aovs.md say more.
    """
    from wavecomb.run.bands import band_rows
    from wavecomb.run.settings import keeps_error

    source = StageOptions.take(options)
    purpose = PurposeOptions.take(options)
    layers = AovOptions.take(options)
    sources = known_settings()["costs"].choices
    costs_file = costs if costs is not None and costs not in sources else None
    written = (output, png, stats_file, costs_file, purpose.preview, purpose.checkpoint_file)
    enter_to_render(written, output, output_dir, frames, split=layers.split, gpu=purpose.denoise)

    def checked(names: Names, plan: Plan | None = None) -> tuple[float, ...] | None:
        """The frames of a sequence; what can be known to fail fails here."""
        numbers = check_frames(frames, skip_existing, source, names, purpose)
        for frame in (None,) if numbers is None else numbers:
            here = names if frame is None else names.at(frame)
            if plan is not None:
                plan.check_place(here)
            _check_outputs(
                stage,
                here,
                purpose if frame is None else purpose_at(purpose, frame),
                costs_file,
            )
        return numbers

    if output is not None:
        checked(Names(output, png, stats_file))
    if purpose.denoise:
        from wavecomb.picture.denoise import check_denoiser

        check_denoiser()
    resumed = purpose.load()
    chosen = {name: value for name, value in options.items() if value is not None}
    if costs is not None and costs_file is None:
        chosen["costs"] = costs
    profile = _read_costs(costs_file)
    chosen |= purpose.settings(spp, resumed)
    if size is not None:
        chosen["width"], chosen["height"] = size
    if resumed is not None:
        chosen = {**resumed.settings, **chosen}
        source = source.completed(resumed.source)
    kept = chosen.pop("aovs", aov_names.for_core(aov_names.DEFAULT))
    before = None if resumed is None else resumed.aovs
    choices, opened = source.peek(stage)
    plans = plan_products(choices, output, png, stats_file, purpose, frames, output_dir)
    reporter = make_reporter(purpose.progress, quiet)

    def fits(settings: Any, aovs: Any) -> None:
        band_rows(settings, aovs, film_memory, whole=purpose.whole, tile=layers.tile)

    def job_of(plan: Plan, numbers: tuple[float, ...] | None) -> Job:
        aovs = plan.aovs(layers, before)
        guides = [name for name in aov_names.GUIDES if purpose.denoise or name in kept]
        settings = plan.settings(
            chosen, aov_names.with_guides(aovs, guides), resumed is not None, fits
        )
        shows_errors = keeps_error(settings) and aovs == aov_names.DEFAULT
        further = (*("denoised",) * purpose.denoise, *aov_names.ERRORS * shows_errors)
        layers.check(plan.names.output, (*aovs, *further))
        if layers.split:
            plan.check_split((*aovs, *further), numbers)
        return Job(
            stage, settings, aovs, profile, layers, reporter, exposure, tone_map, film_memory
        )

    # All is checked before the first is rendered.
    all_numbers = [checked(plan.names, plan) for plan in plans]
    jobs = [
        (plan, numbers, job_of(plan, numbers))
        for plan, numbers in zip(plans, all_numbers, strict=True)
    ]
    shared = open_frames(jobs[0][2], source) if len(jobs) > 1 and frames is None else None
    for plan, numbers, job in jobs:
        here = plan.source(source)
        if numbers is not None:
            opened = None
            last, _ = render_sequence(job, numbers, plan.names, here, purpose, skip_existing)
            if last is not None and costs_file is not None:
                _save_costs(costs_file, last)
            continue
        shot: Shot = Still(here, stage, job.settings, opened)
        if shared is not None:
            shot = plan.shot(shared, source.frame, job.settings)
        opened = None
        done = job.run(shot, here, purpose, plan.names, resumed)
        del shot  # the scene: nothing needs it while files are written
        if done.stopped is not None and not done.samples:
            click.echo("stopped before the first sample; nothing was written", err=True)
            raise click.exceptions.Exit(128 + done.stopped)
        done, files = job.write(done, plan.names, denoise=purpose.denoise)
        if costs_file is not None:
            _save_costs(costs_file, done)
            files.append(costs_file)
        reporter.finished(done, done.report, files)
        if done.stopped is not None:
            kept = f"{plan.names.output} holds what was done"
            click.echo(f"stopped {how_far(done)}; {kept}", err=True)
            raise click.exceptions.Exit(128 + done.stopped)


def _save_costs(costs_file: str, done: Done) -> None:
    from wavecomb.run.costs import save_costs

    save_costs(costs_file, done.costs)


def _check_outputs(
    stage: str, names: Names, purpose: PurposeOptions, costs_file: str | None
) -> None:
    """Everything that can be known to fail before the work begins."""
    from wavecomb.errors import WavecombError
    from wavecomb.picture.files import check_writable

    outputs = [
        (names.output, "-o", ".exr"),
        (names.png, "--png", ".png"),
        (names.stats, "--stats", None),
        (costs_file, "--costs", None),
        (purpose.preview, "--preview", ".png"),
        (purpose.checkpoint_file, "--checkpoint", None),
    ]
    for name, option, ending in outputs:
        if name is not None and ending is not None and not name.lower().endswith(ending):
            raise WavecombError(f"{option} {name}: the name must end in {ending}")
        if option == "--costs" and name is not None and not name.lower().endswith(".json"):
            sources = known_settings()["costs"].choices
            raise WavecombError(
                f"--costs {name}: must be one of {', '.join(sources)}, "
                "or a file whose name ends in .json"
            )
    seen = {os.path.realpath(stage): "the stage"}
    for name, option, _ in outputs:
        if name is None:
            continue
        other = seen.setdefault(os.path.realpath(name), option)
        if other != option:
            raise WavecombError(f"{option} {name}: is the same file as {other}")
        check_writable(name)


def _read_costs(costs_file: str | None) -> dict[str, dict[str, float]] | None:
    """The profile to start from, if there is one yet."""
    if costs_file is None or not os.path.exists(costs_file):
        return None
    from wavecomb.run.costs import load_costs

    return load_costs(costs_file)
