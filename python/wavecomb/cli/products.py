# SPDX-License-Identifier: Apache-2.0
"""Determines the images of ``wavecomb render`` and their files."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

from wavecomb.cli.render_options import RenderOptions
from wavecomb.cli.setting_options import Percent
from wavecomb.errors import WavecombError
from wavecomb.image import cryptomatte
from wavecomb.image.files import exr
from wavecomb.image.files.output_file import check_writable
from wavecomb.image.files.render_output import split_names
from wavecomb.options import settings as known_settings
from wavecomb.run import aovs as aov_names
from wavecomb.run.bands import band_rows
from wavecomb.run.expressions import layer_of
from wavecomb.run.frame_names import has_place, parse_frames
from wavecomb.run.guiding_file import ENDING
from wavecomb.run.settings import DEFAULT_SIZE, make_settings

if TYPE_CHECKING:
    from wavecomb.usd.render_settings.reader import ProductSettings


@dataclass(frozen=True)
class Product:
    """An image to render.

    Attributes:
        choice: Settings of the render product in the stage.
        options: Options of the command, with the image's file names and render product.
        frames: Frames of a sequence; None for a single image.
        folder: Folder that the image must stay in if the stage chose its name; None if the user
            chose the name.
    """

    choice: ProductSettings
    options: RenderOptions
    frames: tuple[float, ...] | None
    folder: str | None = None

    def aovs(self, before: Sequence[str] | None) -> tuple[str, ...]:
        """Returns the AOVs to render.

        The AOVs come from the options, else from the resumed render, else from the render
        product.
        """
        if self.options.aovs:
            return aov_names.expand(self.options.aovs)
        if before is not None:
            return tuple(before)
        own = self.choice.aovs
        return aov_names.DEFAULT if own is None else aov_names.expand(own)

    def settings(self, chosen: Mapping[str, Any], aovs: Sequence[str], resumed: bool) -> Any:
        """Builds render settings and checks them.

        Args:
            chosen: Settings from the options and from the resumed render. The entry "size" is the
                value of --size.
            aovs: AOVs to keep.
            resumed: Whether a render is resumed, which fixes size and region.
        """
        chosen = dict(chosen)
        width, height = self.choice.resolution or DEFAULT_SIZE
        size = chosen.pop("width", width), chosen.pop("height", height)
        asked = chosen.pop("size", size)
        size = asked.of((width, height)) if isinstance(asked, Percent) else asked
        if "region" not in chosen and not resumed and (region := self.choice.region(*size)):
            chosen["region"] = region
            chosen["crop"] = True  # the files keep the data window that the stage defines

        options = self.options
        fits = partial(
            band_rows, megabytes=options.film_memory, whole=options.whole, tile=options.tile
        )
        try:
            return make_settings(size, chosen.pop("spp"), aovs=aovs, fits=fits, **chosen)
        except WavecombError as error:
            if size != self.choice.resolution:
                raise
            prim = self.choice.product or self.choice.settings
            raise WavecombError(f"{prim}: {error}; --size overrides it") from None

    def check_layers(self, aovs: Sequence[str]) -> None:
        """Raises WavecombError if EXR files do not support these layers and options.

        Light groups are known only after the stage is loaded, so the file names of ``light_groups``
        are not checked here.
        """
        options, output = self.options, self.options.output
        if output is None:
            for option, given in (
                ("--aov", options.aovs),
                ("--half", options.half),
                ("--split-aovs", options.split),
                ("--exr-tile", options.tile),
            ):
                if given:
                    raise WavecombError(
                        f"{option}: is for EXR files, and {options.png} is the only image: give "
                        "-o FILE.exr"
                    )
            return
        layers = [cryptomatte.LEVELS.get(name, name) for name in aovs]
        layers = [f"{name}00" if name in cryptomatte.LEVELS.values() else name for name in layers]
        exr.check_options(
            output, () if options.split else layers, options.compression, options.tile
        )
        if not options.split:
            return
        known = [layer_of(name) for name in aovs]
        for file in split_names(output, [n for n in known if n != "light_groups"]).values():
            check_writable(file)
        for here in [options] if self.frames is None else map(options.at, self.frames):
            for file in split_names(str(here.output), known).values():
                self.check_place(str(file))

    def check_place(self, image: str) -> None:
        """Raises WavecombError if a file lies outside ``folder``, even through symbolic links."""
        if self.folder is None:
            return
        within, target = os.path.realpath(self.folder), os.path.realpath(image)
        if os.path.commonpath([within, target]) != within or within == target:
            name = self.choice.output or image
            raise WavecombError(
                f"{self.choice.product}: productName {name} leaves the folder {within}: give "
                "-o FILE.exr, or --output-dir with the folder for images"
            )


def plan_products(choices: Sequence[ProductSettings], options: RenderOptions) -> list[Product]:
    """Returns the images that the stage defines, one per render product, and checks their files.

    Raises:
        WavecombError: An image has no file name, or an option applies to one image only.
    """
    products = [_product(choice, options, len(choices) == 1) for choice in choices]
    if len(products) > 1:
        _check_several(products, options)
    if options.frames is None and any(has_place(str(one.options.image)) for one in products):
        frame = (
            choices[0].first_frame
            if options.source.values["frame"] is None
            else options.source.values["frame"]
        )
        products = [replace(one, options=one.options.at(frame)) for one in products]
    return [replace(one, frames=checked_frames(one.options, one)) for one in products]


def _product(choice: ProductSettings, options: RenderOptions, is_single: bool) -> Product:
    """Returns the image of a render product; raises WavecombError if it has no file name."""
    if choice.output is None:
        if options.png is not None and is_single:
            return Product(choice, replace(options, image=options.png), None)
        prim = choice.product
        where = f"{prim} has no productName" if prim else "the stage has no render product"
        raise WavecombError(f"-o is missing, and {where}: give -o FILE.exr or -o FILE.png")
    if not choice.output.lower().endswith(".exr"):
        raise WavecombError(
            f"{choice.product}: productName {choice.output} must end in .exr; give -o FILE.exr"
        )
    if "\0" in choice.output:
        raise WavecombError(f"{choice.product}: productName is no file name; give -o FILE.exr")
    folder = options.output_dir
    name = choice.output if folder is None else os.path.join(folder, choice.output)
    return Product(choice, replace(options, output=name, image=name), None, folder or os.curdir)


def _check_several(products: Sequence[Product], options: RenderOptions) -> None:
    """Raises WavecombError for options that apply to one image only, or for equal file names."""
    single = {
        "--png": options.png, "--deep": options.deep, "--stats": options.stats_file,
        "--resume": options.resume, "--checkpoint": options.checkpoint,
        "--preview": options.preview,
    }  # fmt: skip
    for option, given in single.items():
        if given is not None:
            raise WavecombError(
                f"{option} {given}: is of one picture and the stage has {len(products)} render "
                "products; choose one by --product"
            )
    seen: set[str] = set()
    for one in products:
        target = os.path.realpath(str(one.options.image))
        if target in seen:
            raise WavecombError(
                f"productName {one.choice.output} is used by several render products; "
                "choose one by --product"
            )
        seen.add(target)


def checked_frames(
    options: RenderOptions, product: Product | None = None
) -> tuple[float, ...] | None:
    """Returns the frames of a sequence, or None for a single image; checks all output files.

    Args:
        options: Options with the file names.
        product: The render product that names the image; None if the user names the image.

    Raises:
        WavecombError: Options contradict each other, or a file cannot be written.
    """
    frames = _frames(options)
    for here in [options] if frames is None else map(options.at, frames):
        if product is not None:
            product.check_place(str(here.image))
        _check_outputs(here)
    return frames


def _frames(options: RenderOptions) -> tuple[float, ...] | None:
    if options.frames is None:
        if options.skip_existing:
            raise WavecombError("--skip-existing applies to sequences: also give --frames")
        return None
    if options.source.values["frame"] is not None:
        raise WavecombError("--frame is one frame and --frames are several; give one of them")
    if options.resume is not None:
        raise WavecombError(
            "--resume continues one image: give its --frame, and then all other --frames "
            "with --skip-existing"
        )
    frames = parse_frames(options.frames)
    for option, name in (
        ("-o", options.output),
        ("--png", options.png),
        ("--deep", options.deep),
        ("--stats", options.stats_file),
        ("--checkpoint", options.checkpoint),
    ):
        if len(frames) > 1 and name is not None and not has_place(name):
            stem, ending = os.path.splitext(name)
            raise WavecombError(
                f"{option} {name}: would be written {len(frames)} times; "
                f"say where the frame goes: {stem}.####{ending}"
            )
    return frames


def _check_outputs(options: RenderOptions) -> None:
    """Raises WavecombError if an output file cannot be written or is named twice."""
    outputs: list[tuple[str | None, str, Any]] = [
        (options.output, "-o", ".exr"),
        (options.png, "--png", ".png"),
        (options.deep, "--deep", ".exr"),
        (options.stats_file, "--stats", None),
        (options.costs, "--costs", None),
        (options.learn_to, "--learn-to", ENDING),
        (options.preview, "--preview", (".exr", ".png")),
        (options.checkpoint, "--checkpoint", None),
    ]
    for name, option, ending in outputs:
        if name is not None and ending is not None and not name.lower().endswith(ending):
            several = option == "-o" or not isinstance(ending, str)
            endings = ".exr or .png" if several else ending
            raise WavecombError(f"{option} {name}: the name must end in {endings}")
    if options.costs is not None and not options.costs.lower().endswith(".json"):
        sources = known_settings()["costs"].choices
        raise WavecombError(
            f"--costs {options.costs}: must be one of {', '.join(sources)}, "
            "or a file whose name ends in .json"
        )
    seen = {os.path.realpath(options.stage): "the stage"}
    for name, option, _ in outputs:
        if name is None:
            continue
        other = seen.setdefault(os.path.realpath(name), option)
        if other != option:
            raise WavecombError(f"{option} {name}: is the same file as {other}")
        check_writable(name)
