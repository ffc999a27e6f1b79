# SPDX-License-Identifier: Apache-2.0
"""Command ``wavecomb render``."""

from __future__ import annotations

import sys
from typing import Any

import click

from wavecomb.cli.command import SettingCommand
from wavecomb.cli.options import examples, isolation_options, stage_options
from wavecomb.cli.render_options import RenderOptions, render_options
from wavecomb.cli.sandbox import enter_to_render
from wavecomb.cli.setting_options import option
from wavecomb.terminal import say


@click.command(
    "render",
    cls=SettingCommand,
    epilog=examples(
        "wavecomb render shot.usd -o shot.png",
        "wavecomb render shot.usd -o shot.exr --png shot.png --size 1920x1080 --spp 256",
        "wavecomb render shot.usd -o shot.exr --camera /World/Cam --frame 101 --stats shot.json",
        "wavecomb render shot.usd -o shot.####.exr --frames 1-48 --skip-existing",
        "wavecomb render shot.usd -o shot.exr --noise 0.02 --denoise --png shot.png",
        "wavecomb render shot.usd -o shot.exr --time-limit 60 --preview preview.png",
        "wavecomb render shot.usd -o shot.exr --spp 4096 --checkpoint shot.ckpt",
        "wavecomb render shot.usd -o shot.exr --resume shot.ckpt",
        "wavecomb render shot.usd -o shot.exr --policy adaptive --costs shot-costs.json",
        "wavecomb render shot.usd -o shot.exr --size 7680x4320 --tile 3/8",
    ),
)
@stage_options
@isolation_options
@option(
    "--tile I/N", "text",
    "Render only tile I of N and write NAME.tile-I-of-N.exr; `wavecomb farm assemble NAME.exr` "
    "joins the tiles.", name="part",
)  # fmt: skip
@render_options
def render_command(part: str | None, **values: Any) -> None:
    """Render STAGE to an OpenEXR file, or several frames to one file each.

    The file has the layers beauty (R, G, B), albedo, normal, depth and samples, or those that --aov
    selects. Adaptive renders add error and variance, --denoise adds denoised. Ctrl-C and SIGTERM
    stop the render and write the samples so far (exit codes 130 and 143). Files are never written
    partially. See docs/render.md and docs/aovs.md.
    """
    if str(values["stage"]).lower().endswith(".blend"):
        from wavecomb import blend

        raise click.exceptions.Exit(blend.render(values["stage"], values["frame"], sys.argv[2:]))
    options = RenderOptions.parse(values)
    if part is not None:
        from wavecomb.cli.farm.tiles import render_tile

        render_tile(options, part)
        return
    enter_to_render(options)
    # Import large modules here, after the child process has started, so that the parent process
    # stays small.
    from wavecomb.cli.frames import open_frames, render_sequence
    from wavecomb.cli.job import FrameShot, Still, how_far
    from wavecomb.cli.planning import prepare
    from wavecomb.run.cost_profile import save_costs
    from wavecomb.run.guiding_file import save_learned

    prepared = prepare(options)
    jobs, frame = prepared.jobs, options.source.values["frame"]
    shared = open_frames(jobs[0]) if len(jobs) > 1 and options.frames is None else None
    for job in jobs:
        options = job.options
        if job.frames is not None:
            prepared.opened = None
            done, files = render_sequence(job)
        else:
            shot: Any = Still(job, prepared.opened)
            if shared is not None:
                size = job.settings.width, job.settings.height
                product = options.source.values["product"]
                shot = FrameShot(shared, frame, product=product, size=size)
            prepared.opened = None
            done = job.run(shot, prepared.resumed)
            del shot  # free the scene's memory before the files are written
            if done.stopped is not None and not done.samples:
                say("stopped before the first sample; nothing was written", err=True)
                raise click.exceptions.Exit(128 + done.stopped)
            done, files = job.write(done)
        if done is not None and options.costs is not None:
            save_costs(options.costs, done.costs)
            files.append(options.costs)
        if done is not None and options.learn_to is not None and done.stopped is None:
            save_learned(options.learn_to, job.learning.last)
            files.append(options.learn_to)
        if done is None or job.frames is not None:
            continue
        job.reporter.finished(done, done.report, files)
        if done.stopped is not None:
            kept = f"{options.image} holds what was done"
            say(f"stopped {how_far(done)}; {kept}", err=True)
            raise click.exceptions.Exit(128 + done.stopped)
