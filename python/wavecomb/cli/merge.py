# SPDX-License-Identifier: Apache-2.0
"""Command ``wavecomb merge``."""

from __future__ import annotations

import os
from typing import Any

import click

from wavecomb.cli.options import examples, isolate_option
from wavecomb.cli.render_options import FileOptions
from wavecomb.cli.sandbox import enter_to_read
from wavecomb.cli.setting_options import option, options_of
from wavecomb.terminal import say


@click.command(
    "merge",
    epilog=examples(
        "wavecomb render shot.usd -o a.exr --seed 1",
        "wavecomb render shot.usd -o b.exr --seed 2",
        "wavecomb merge a.exr b.exr -o shot.exr",
    ),
)
@click.argument("pictures", nargs=-1, required=True, type=click.Path(), metavar="A B ...")
@option("-o --output FILE.exr", "path", "Merged image.", required=True)
@option("--png FILE", "path", "Also write a PNG for display.")
@options_of(FileOptions)
@isolate_option
def merge_command(pictures: tuple[str, ...], output: str, png: str | None, **options: Any) -> None:
    """Merge images of one stage that were rendered with different seeds.

    Each pixel is the mean of A, B ... weighted by sample count. Sample counts add up; variances and
    errors become those of the merged image. Images that do not match in size, stage, settings or
    layers, or that have the same seed, are refused.
    """
    from wavecomb.errors import WavecombError
    from wavecomb.image.files.image import write_png
    from wavecomb.image.files.output_file import check_writable
    from wavecomb.image.files.render_output import save_layers
    from wavecomb.image.merge import merge
    from wavecomb.image.working_space import to_rec709

    layers = FileOptions.take(options)
    enter_to_read((output, png), split=output if layers.split else None)
    seen = {os.path.realpath(name) for name in pictures}
    for name, flag, ending in ((output, "-o", ".exr"), (png, "--png", ".png")):
        if name is None:
            continue
        if not name.lower().endswith(ending):
            raise WavecombError(f"{flag} {name}: the name must end in {ending}")
        if os.path.realpath(name) in seen:
            raise WavecombError(f"{flag} {name}: is one of the pictures that are merged")
        check_writable(name)
    merged = merge(pictures)
    written = save_layers(
        output, merged.layers, merged.metadata, merged.manifests, window=merged.window,
        **layers.file_options(),
    )  # fmt: skip
    if png is not None:
        working = str(merged.metadata.get("wavecomb:working_space", "rec709"))
        write_png(png, to_rec709(merged.layers["beauty"], working))
    samples = merged.layers["samples"]
    say(
        f"{len(pictures)} images, seeds {', '.join(map(str, merged.seeds))}: "
        f"{samples.mean():.0f} samples per pixel; wrote "
        + ", ".join([*map(str, written), *([png] if png else [])])
    )
