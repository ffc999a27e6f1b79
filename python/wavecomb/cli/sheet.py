# SPDX-License-Identifier: Apache-2.0
"""Command ``wavecomb sheet``."""

from __future__ import annotations

import os
from typing import Any

import click

from wavecomb.cli.options import examples, isolate_option
from wavecomb.cli.sandbox import enter_to_read
from wavecomb.cli.setting_options import Real
from wavecomb.terminal import say


@click.command(
    "sheet",
    epilog=examples(
        "wavecomb sheet out/shot.####.exr -o sheet.png --columns 8",
        "wavecomb sheet out/shot.####.exr -o shot.html --fps 24",
        "wavecomb sheet out/ -o depth.png --layer depth",
        "wavecomb sheet before.exr after.exr -o both.png --width 480 --exposure 1",
    ),
)
@click.argument("pictures", nargs=-1, required=True, type=click.Path())
@click.option(
    "-o", "--output", required=True, type=click.Path(), metavar="FILE",
    help="File to write: a contact sheet (.png), or a page that plays the images (.html).",
)  # fmt: skip
@click.option(
    "--layer",
    default="",
    metavar="NAME",
    help="Layer of EXR files to show.  [default: denoised if present, else beauty]",
)
@click.option(
    "--width", type=click.IntRange(16, 8192), metavar="PX",
    help="Maximum width of each image in the sheet or page, in pixels.  [default: 240; .html: "
    "960]",
)  # fmt: skip
@click.option("--columns", type=click.IntRange(1), metavar="N",
              help="Number of image columns in the contact sheet.  [default: a landscape "
                   "layout]")  # fmt: skip
@click.option("--fps", type=Real(0, above=True), default=24.0, metavar="X",
              help="Playback rate of the page, in frames per second.  [default: 24]")  # fmt: skip
@click.option(
    "--title",
    metavar="TEXT",
    help="Title of the page that plays the images.  [default: the first argument's name]",
)
@click.option("--lossless", is_flag=True, help="Embed images in the page as PNG instead of JPEG.")
@click.option(
    "--exposure",
    type=Real(),
    default=0.0,
    metavar="EV",
    help="Exposure at which HDR images are shown, in stops.",
)
@click.option(
    "--tone-map", type=click.Choice(["clamp", "neutral"]), default="clamp",
    help="Tone mapping of HDR images: clamp clips at 1, neutral rolls off highlights.  [default: "
    "clamp]",
)  # fmt: skip
@isolate_option
def sheet_command(pictures: tuple[str, ...], output: str, **options: Any) -> None:
    """Show PICTURES side by side: files, folders, or names with a placeholder for the frame.

    A page (.html) embeds all images and plays them; it needs no other file.
    """
    enter_to_read((output,))
    from wavecomb.errors import WavecombError
    from wavecomb.image.compare.folders import collect
    from wavecomb.image.files.output_file import check_writable
    from wavecomb.image.thumbnails import DisplayOptions

    ending = os.path.splitext(output)[1].lower()
    if ending not in (".png", ".html"):
        raise WavecombError(f"-o {output}: the name must end in .png or .html")
    found = collect(pictures)
    if os.path.realpath(output) in map(os.path.realpath, found.values()):
        raise WavecombError(f"-o {output}: is one of the pictures")
    check_writable(output)
    look = DisplayOptions(
        options["layer"], exposure=options["exposure"], tone_map=options["tone_map"]
    )
    if ending == ".png":
        _write_sheet(found, output, look, options)
    else:
        title = options["title"] or os.path.basename(os.path.normpath(pictures[0]))
        _write_page(found, output, look, title, options)
    say(f"{len(found)} images; wrote {output}")


def _write_sheet(found: dict[str, str], output: str, look: Any, options: dict[str, Any]) -> None:
    from wavecomb.errors import WavecombError
    from wavecomb.image.files.image import write_png_codes
    from wavecomb.image.thumbnails import MAX_IMAGES, contact_sheet

    if len(found) > MAX_IMAGES:
        raise WavecombError(f"{len(found)} images: a sheet holds at most {MAX_IMAGES}")
    columns, width = options["columns"] or 0, options["width"] or 240
    write_png_codes(output, contact_sheet(found, look, width=width, columns=columns))


def _write_page(
    found: dict[str, str], output: str, look: Any, title: str, options: dict[str, Any]
) -> None:
    from wavecomb.errors import WavecombError
    from wavecomb.image.files.output_file import replacing
    from wavecomb.image.pages import MAX_FRAMES, sequence_page

    if len(found) > MAX_FRAMES:
        raise WavecombError(f"{len(found)} images: a page holds at most {MAX_FRAMES}")
    text = sequence_page(
        found, look, title=title, fps=options["fps"], width=options["width"] or 960,
        kind="png" if options["lossless"] else "jpeg",
    )  # fmt: skip
    with replacing(output) as part:
        part.write_text(text, encoding="utf-8")
