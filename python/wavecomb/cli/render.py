# SPDX-License-Identifier: Apache-2.0
"""``wavecomb render``."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import click

from wavecomb.cli.group import INTERRUPTED
from wavecomb.cli.options import Real, StageOptions, examples, stage_options, stage_warnings, warn

if TYPE_CHECKING:
    from rich.console import Console

_INTEGERS = click.IntRange(min=0)


@click.command(
    "render",
    epilog=examples(
        "wavecomb render shot.usd -o shot.exr",
        "wavecomb render shot.usd -o shot.exr --png shot.png --size 1920 1080 --spp 256",
        "wavecomb render shot.usd -o shot.exr --camera /World/Cam --frame 101 --stats shot.json",
    ),
)
@stage_options
@click.option(
    "-o",
    "--output",
    required=True,
    type=click.Path(),
    metavar="FILE.exr",
    help="Picture, all layers.",
)
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
    default=(600, 600),
    metavar="W H",
    help="Pixels.  [default: 600 600]",
)
@click.option(
    "--spp", type=int, default=64, show_default=True, metavar="N", help="Samples per pixel."
)
@click.option("--max-depth", type=_INTEGERS, metavar="N", help="Longest path, in scatterings.")
@click.option(
    "--integrator",
    type=click.Choice(["wavefront", "reference"]),
    help="reference: scalar and slow, the oracle.  [default: wavefront]",
)
@click.option("--threads", type=_INTEGERS, metavar="N", help="0 is all.  [default: 0]")
@click.option("--wave-size", type=_INTEGERS, metavar="N", help="Paths of a wave; 0 is automatic.")
@click.option(
    "--traversal",
    type=click.Choice(["packets", "single"]),
    help="single: exact also where surfaces lie in one another.  [default: packets]",
)
@click.option(
    "--lanes", type=click.Choice(["auto", "1", "4", "8", "16"]), help="SIMD width.  [default: auto]"
)
@click.option("--sampler", type=click.Choice(["sobol", "independent"]), help="[default: sobol]")
@click.option("--seed", type=_INTEGERS, metavar="N", help="[default: 0]")
@click.option(
    "--filter",
    "filter_",
    type=click.Choice(["blackman-harris", "gaussian", "box"]),
    help="Pixel filter.  [default: blackman-harris]",
)
@click.option("--filter-width", type=Real(0, above=True), metavar="X", help="In pixels.")
@click.option("--roulette", type=click.Choice(["off", "throughput"]), help="[default: throughput]")
@click.option(
    "--clamp-indirect",
    type=Real(0),
    metavar="X",
    help="Limit of a sample's indirect light; biased; 0 is off.  [default: 0]",
)
@click.option("--fresnel", type=click.Choice(["exact", "schlick"]), help="[default: exact]")
@click.option("--half", is_flag=True, help="16 bit colours and normals in the EXR.")
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
    output: str,
    png: str | None,
    stats_file: str | None,
    size: tuple[int, int],
    spp: int,
    half: bool,
    exposure: float,
    tone_map: Any,
    quiet: bool,
    lanes: str | None,
    filter_: str | None,
    **options: Any,
) -> None:
    """Render STAGE to an OpenEXR file.

    The file has the layers beauty (R, G, B), albedo, normal, depth and samples. Ctrl-C stops and
    writes what is done (exit code 130). Files are written whole or not at all.
    """
    from wavecomb.api import make_settings

    _check_outputs(stage, output, png, stats_file)
    source = StageOptions.take(options)
    chosen = {name: value for name, value in options.items() if value is not None}
    if lanes is not None:
        chosen["lanes"] = 0 if lanes == "auto" else int(lanes)
    if filter_ is not None:
        chosen["filter"] = filter_
    settings = make_settings(size, spp, **chosen)

    console = _console()
    loaded = _load(source, stage, console, quiet)
    warn(stage_warnings(loaded))
    picture, done = _render(loaded, stage, settings, console, quiet)
    if picture.cancelled and done <= 0.0:
        click.echo("stopped before the first sample; nothing was written", err=True)
        raise click.exceptions.Exit(INTERRUPTED)
    warn(_picture_warnings(picture))
    _write(picture, output, png, stats_file, half, exposure, tone_map)
    if not quiet:
        _summary(picture, loaded, [name for name in (output, png, stats_file) if name])
    if picture.cancelled:
        click.echo(f"stopped at {100.0 * done:.0f} %; {output} holds what was done", err=True)
        raise click.exceptions.Exit(INTERRUPTED)


def _console() -> Console:
    from rich.console import Console

    return Console(stderr=True, emoji=False)


def _check_outputs(stage: str, output: str, png: str | None, stats_file: str | None) -> None:
    """Everything that can be known to fail before the work begins."""
    from wavecomb.errors import WavecombError
    from wavecomb.files import check_writable

    for name, option, ending in ((output, "-o", ".exr"), (png, "--png", ".png")):
        if name is not None and not name.lower().endswith(ending):
            raise WavecombError(f"{option} {name}: the name must end in {ending}")
    seen = {os.path.realpath(stage): "the stage"}
    for name, option in ((output, "-o"), (png, "--png"), (stats_file, "--stats")):
        if name is None:
            continue
        other = seen.setdefault(os.path.realpath(name), option)
        if other != option:
            raise WavecombError(f"{option} {name}: is the same file as {other}")
        check_writable(name)


def _load(source: StageOptions, stage: str, console: Console, quiet: bool) -> Any:
    if quiet or not console.is_terminal:
        return source.load(stage)
    from rich.markup import escape

    with console.status(f"loading {escape(os.path.basename(stage))}"):
        return source.load(stage)


def _render(
    loaded: Any, stage: str, settings: Any, console: Console, quiet: bool
) -> tuple[Any, float]:
    """The picture, and how much of it was done, from 0 to 1."""
    from wavecomb import _core
    from wavecomb.api import picture_of
    from wavecomb.progress import Interrupt, RenderProgress
    from wavecomb.stats import make_stats

    with (
        Interrupt() as interrupt,
        RenderProgress(console, interrupt, visible=not quiet) as progress,
    ):
        result = _core.render(loaded.scene, settings, progress)
    stats = make_stats(result, stage=stage, loaded=loaded)
    total = int(settings.width) * int(settings.height) * int(settings.spp)
    return picture_of(result, stats), float(stats["counts"]["samples"]) / total


def _picture_warnings(picture: Any) -> list[str]:
    import numpy as np

    broken = int((~np.isfinite(picture.beauty).all(axis=2)).sum())
    return [f"{broken} pixels of the picture are not finite"] if broken else []


def _write(
    picture: Any,
    output: str,
    png: str | None,
    stats_file: str | None,
    half: bool,
    exposure: float,
    tone_map: Any,
) -> None:
    from wavecomb.stats import write_stats

    picture.save(output, half=half)
    if png is not None:
        picture.save(png, exposure=exposure, tone_map=tone_map)
    if stats_file is not None:
        write_stats(stats_file, picture.stats)


def _summary(picture: Any, loaded: Any, files: list[str]) -> None:
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    from wavecomb.progress import count_text, time_text

    stats = picture.stats
    console = Console(highlight=False, emoji=False, soft_wrap=True)
    seconds, counts = stats["seconds"], stats["counts"]
    rays = counts["rays"] + counts["shadow_rays"]
    console.print(
        ", ".join(f"{name} {time_text(seconds[name])}" for name in ("load", "build", "render"))
    )
    console.print(
        f"{count_text(counts['samples'])} samples, {count_text(stats['samples_per_s'])}/s; "
        f"{count_text(rays)} rays, {count_text(stats['rays_per_s'])}/s; "
        f"peak memory {stats['peak_rss_bytes'] / 1e6:,.0f} MB"
    )
    phases = {name: value for name, value in stats["phases_s"].items() if value > 0.0}
    if phases:
        total = sum(phases.values())
        table = Table(box=None, pad_edge=False)
        table.add_column("phase")
        table.add_column("thread s", justify="right")
        table.add_column("%", justify="right")
        for name, value in phases.items():
            table.add_row(name, f"{value:.3f}", f"{100.0 * value / total:.1f}")
        console.print(table)
    if loaded.report.unsupported:
        console.print("not supported, and left out:")
        for finding in loaded.report.unsupported:
            console.print(f"  {escape(finding.line())}")
    for finding in loaded.report.notes:
        console.print(f"note: {escape(finding.line())}")
    console.print("wrote " + escape(", ".join(files)))
