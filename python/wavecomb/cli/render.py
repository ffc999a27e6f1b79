# SPDX-License-Identifier: Apache-2.0
"""Command ``wavecomb render``."""

from __future__ import annotations

import sys
from typing import Any

import click

from wavecomb.blend import is_blend
from wavecomb.blend import render as render_blend
from wavecomb.cli.aovs import aov_options
from wavecomb.cli.command import SettingCommand
from wavecomb.cli.farm_tiles import TILE, check_tile, render_tile, tile_name
from wavecomb.cli.frames import frame_options, open_frames, render_sequence
from wavecomb.cli.job import how_far
from wavecomb.cli.options import examples, isolation_options, stage_options
from wavecomb.cli.planning import Asked, prepare
from wavecomb.cli.purpose import purpose_options
from wavecomb.cli.reporting import Done
from wavecomb.cli.sandbox import enter_to_render
from wavecomb.cli.setting_options import add_options, option, setting_options
from wavecomb.cli.shots import Shot, Still
from wavecomb.cli.size import SizeType
from wavecomb.run.guiding_file import save_learned

picture_options = add_options(
    option(
        "-o --output FILE.exr|.png", "path",
        "Image with all layers, or only a PNG.  [default: the productName of render products]",
    ),
    option(
        "--output-dir DIR", "path",
        "Folder that relative productNames start from and must stay in.  "
        "[default: the working folder]",
    ),
    aov_options,
    option("--png FILE.png", "path", "Also write an image for display."),
    option(
        "--deep FILE.exr", "path", "Also write colour and alpha by depth (docs/deep.md)."
    ),
    option(
        "--stats FILE.json", "path", "Also write statistics (docs/statistics.md).",
        name="stats_file",
    ),
    option(
        "--size WxH|N%", SizeType(),
        "Image size in pixels, such as 640x360, or a part of the stage's.  "
        "[default: of the render settings, else 600x600]",
    ),
    option(
        "--region X0 Y0 X1 Y1", click.INT,
        "Rectangle of pixels to render; X1 and Y1 are exclusive.  "
        "[default: the render settings' data window, else all]", nargs=4,
    ),
    option(
        "--spp N", click.INT,
        "Samples per pixel; the most of them with --adaptive or --noise.  [default: 64]",
    ),
    purpose_options,
    setting_options(),
    option(
        "--costs auto|measured|model|FILE.json", "text",
        "Source of scheduling costs. A file is read if it exists, and written at the end.  "
        "[default: auto]",
    ),
    option(
        "--learn-from FILE|before", "text",
        "Use the guiding data of another render instead of training; before: each of --frames "
        "uses the data of the previous frame.",
    ),
    option(
        "--learn-to FILE.learned", "path", "Save the guiding data of this render for --learn-from."
    ),
    option(
        "--film-memory MB", "positive",
        "Memory for an image, in MB; a larger one is rendered in bands of rows.  "
        "[default: half of the machine's memory]",
    ),
    option("--exposure EV", "number", "Exposure of the PNG, in stops.  [default: 0]", default=0.0),
    option(
        "--tone-map", click.Choice(["clamp", "neutral"]),
        "Tone mapping of the PNG: clip, or roll off highlights.  [default: clamp]", default="clamp",
    ),
    option(
        "--ocio-view NAME", "text",
        "Show the PNG and previews through a view of $OCIO, such as AgX or an ACES view.",
    ),
    option(
        "--ocio-display NAME", "text", "Display of --ocio-view.  [default: an sRGB screen]"
    ),
    option("--quiet", "flag", "Print only warnings and errors."),
    option("--verbose", "flag", "Also print phases, materials and predictions at the end."),
)  # fmt: skip
"""Image, duration and files: options of all commands that render images."""


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
@frame_options
@isolation_options
@TILE
@picture_options
def render_command(part: str | None, **options: Any) -> None:
    """Render STAGE to an OpenEXR file, or several frames to one file each.

    The file has the layers beauty (R, G, B), albedo, normal, depth and samples, or those that --aov
    selects. Adaptive renders add error and variance, --denoise adds denoised. Ctrl-C and SIGTERM
    stop the render and write the samples so far (exit codes 130 and 143). Files are never written
    partially. See docs/render.md and docs/aovs.md.
    """
    if is_blend(options["stage"]):
        frame = options["frame"]
        raise click.exceptions.Exit(render_blend(options["stage"], frame, sys.argv[2:]))
    chosen_tile = None if part is None else check_tile(part, options)
    asked = Asked.take(options)
    written = asked.written()
    if chosen_tile is not None:
        written = (*written, tile_name(str(asked.output), *chosen_tile))
    enter_to_render(
        written, asked.image, asked.output_dir, asked.frames, asked.source.frame,
        split=asked.layers.split, gpu=asked.purpose.denoise,
    )  # fmt: skip
    prepared = prepare(asked)
    asked = prepared.asked
    purpose, costs_file, stage = asked.purpose, asked.costs_file, asked.stage
    if chosen_tile is not None:
        files = render_tile(prepared, asked, chosen_tile)
        if not asked.quiet:
            click.echo(f"wrote {', '.join(files)}" if files else "all images exist")
        return
    jobs, source, resumed, reporter = (
        prepared.jobs, prepared.source, prepared.resumed, prepared.reporter,
    )  # fmt: skip
    learning = prepared.learning
    opened, prepared.opened = prepared.opened, None
    shared = open_frames(jobs[0][2], source) if len(jobs) > 1 and asked.frames is None else None
    for plan, numbers, job in jobs:
        here = plan.source(source)
        if numbers is not None:
            opened = None
            last, _ = render_sequence(job, numbers, plan.names, here, purpose, asked.skip_existing)
            if last is not None and costs_file is not None:
                _save_costs(costs_file, last)
            if last is not None and asked.learn_to is not None:
                save_learned(asked.learn_to, learning.last)
            continue
        shot: Shot = Still(here, stage, job.settings, opened)
        if shared is not None:
            shot = plan.shot(shared, source.frame, job.settings)
        opened = None
        done = job.run(shot, here, purpose, plan.names, resumed)
        del shot  # frees the scene, which writing files does not need
        if done.stopped is not None and not done.samples:
            click.echo("stopped before the first sample; nothing was written", err=True)
            raise click.exceptions.Exit(128 + done.stopped)
        done, files = job.write(done, plan.names, denoise=purpose.denoise)
        if costs_file is not None:
            _save_costs(costs_file, done)
            files.append(costs_file)
        if asked.learn_to is not None and done.stopped is None:
            save_learned(asked.learn_to, learning.last)
            files.append(asked.learn_to)
        reporter.finished(done, done.report, files)
        if done.stopped is not None:
            kept = f"{plan.names.image} holds what was done"
            click.echo(f"stopped {how_far(done)}; {kept}", err=True)
            raise click.exceptions.Exit(128 + done.stopped)


def _save_costs(costs_file: str, done: Done) -> None:
    from wavecomb.run.cost_profile import save_costs

    save_costs(costs_file, done.costs)
