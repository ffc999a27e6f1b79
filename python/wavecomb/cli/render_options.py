# SPDX-License-Identifier: Apache-2.0
"""Options of commands that render, declared as the fields of a dataclass."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

import click
from click.shell_completion import CompletionItem

from wavecomb.cli.options import StageOptions
from wavecomb.cli.setting_options import (
    ImageSize,
    SizeType,
    add_options,
    declared,
    option,
    options_of,
    setting_options,
)
from wavecomb.errors import WavecombError
from wavecomb.options import settings as known_settings
from wavecomb.run import aovs as aov_names
from wavecomb.run import expressions
from wavecomb.run.frame_names import fill

F = TypeVar("F", bound=Callable[..., Any])
Own = TypeVar("Own", bound="FileOptions")

_COMPRESSIONS = ("none", "rle", "zips", "zip", "piz", "pxr24", "b44", "b44a", "dwaa", "dwab")

WRITTEN = ("output", "png", "deep", "stats_file", "costs", "learn_to", "preview", "checkpoint")
"""Fields of ``RenderOptions`` that name files which the command writes."""
NAMED = (*WRITTEN, "image", "learn_from", "resume")
"""Fields of ``RenderOptions`` whose file names may have a placeholder for the frame."""


class _AovOption(click.Option):
    """Option --aov. The help text is built on demand, because listing the AOVs loads the core."""

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Returns the names of AOVs, groups and expressions that begin with ``incomplete``."""
        named = (f"{expressions.PREFIX}{name}" for name in expressions.NAMED)
        names = (*aov_names.names(), *aov_names.groups(), *named)
        return [CompletionItem(name) for name in names if name.startswith(incomplete)]

    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        """Returns the option and its help text, as ``click`` expects them."""
        self.help = (
            f"AOV to write as a layer; repeat for more: {', '.join(aov_names.names()[1:])}, "
            f"{aov_names.LIGHT}NAME, lpe:NAME=EXPRESSION, crypto, techniques, all; "
            "beauty is always written (docs/aovs.md).  "
            f"[default: {', '.join(aov_names.DEFAULT[1:])}]"
        )
        return super().get_help_record(ctx)


@dataclass(frozen=True, kw_only=True)
class FileOptions:
    """Options of EXR files."""

    half: bool = declared("--half", "flag", "Store colours and normals as 16-bit floats.")
    compression: str = declared(
        "--compression", click.Choice(_COMPRESSIONS), "Compression of the EXR file.", default="zip",
        show_default=True,
    )  # fmt: skip
    tile: int = declared(
        "--exr-tile N", click.IntRange(min=0),
        "Write the EXR in tiles of N x N pixels, with N a multiple of 16.  [default: "
        "scanlines]",
        default=0,
    )  # fmt: skip
    split: bool = declared(
        "--split-aovs", "flag",
        "Write each AOV to a separate file FILE.NAME.exr, and the beauty to FILE.exr.",
    )  # fmt: skip

    @classmethod
    def take(cls: type[Own], options: dict[str, Any], **more: Any) -> Own:
        """Builds an object from the arguments of a command, and removes those from ``options``."""
        own = [one.name for one in fields(cls) if "option" in one.metadata]
        return cls(**{name: options.pop(name) for name in own}, **more)

    def file_options(self) -> dict[str, Any]:
        """Returns keyword arguments for ``Picture.save``."""
        return {one.name: getattr(self, one.name) for one in fields(FileOptions)}


@dataclass(frozen=True, kw_only=True)
class RenderOptions(FileOptions):
    """Options of ``wavecomb render``, and values that are derived from them.

    Attributes:
        stage: File of the stage.
        image: The image that -o names, an EXR or a PNG; None if the stage names it.
        source: Options that load the stage.
        settings: Values of the render settings that were given.
        whole: Name of a given option that needs the whole image in memory; "" if there is none.
    """

    output: str | None = declared(
        "-o --output FILE.exr|.png",
        "path",
        "Image file to write: an EXR with all layers, or only a PNG.  [default: the productName "
        "of render products]",
    )
    output_dir: str | None = declared(
        "--output-dir DIR",
        "path",
        "Folder for render products with relative productNames, which must stay inside it.  "
        "[default: the working folder]",
    )
    aovs: tuple[str, ...] = declared("--aov NAME", "text", "", cls=_AovOption, multiple=True)
    png: str | None = declared("--png FILE.png", "path", "Also write a PNG for display.")
    deep: str | None = declared(
        "--deep FILE.exr",
        "path",
        "Also write a deep EXR with colour and alpha by depth (docs/deep.md).",
    )
    stats_file: str | None = declared(
        "--stats FILE.json", "path", "Also write statistics of the render (docs/statistics.md)."
    )
    size: ImageSize | None = declared(
        "--size WxH|N%",
        SizeType(),
        "Image size in pixels, such as 640x360, or in percent of the stage's.  [default: of the "
        "render settings, else 600x600]",
    )
    spp: int | None = declared(
        "--spp N",
        click.INT,
        "Samples per pixel, or their maximum with --adaptive or --noise.  [default: 64]",
    )
    frames: str | None = declared(
        "--frames RANGE",
        "text",
        "Frames to render, such as 1-48, 1-48x2 or 1,5,9; file names need a placeholder, as in "
        "shot.####.exr.",
    )
    skip_existing: bool = declared(
        "--skip-existing", "flag", "With --frames, skip frames whose files already exist."
    )
    adaptive: float | None = declared(
        "--adaptive X",
        "positive",
        "Sample each pixel until its relative error is below X (0.02 is a good value).",
    )
    noise: float | None = declared(
        "--noise X",
        "positive",
        "Sample adaptively until the mean relative error of the image is X (0.02 is 2 %).",
    )
    min_spp: int | None = declared(
        "--min-spp N",
        "count",
        "Samples per pixel before the first error estimate of adaptive renders.  [default: 16]",
    )
    max_spp: int | None = declared(
        "--max-spp N",
        "count",
        "Maximum number of samples per pixel in adaptive renders.  [default: 1024]",
    )
    time_limit: float | None = declared(
        "--time-limit S",
        "positive",
        "Stop after S seconds of rendering, or earlier at --spp if given.",
    )
    checkpoint: str | None = declared(
        "--checkpoint FILE",
        "path",
        "Save the state of the render regularly, and on Ctrl-C and SIGTERM.",
    )
    every: float = declared(
        "--every S", "positive", "Interval between checkpoints in seconds.  [default: 120]"
    )
    resume: str | None = declared(
        "--resume FILE",
        "path",
        "Continue from a checkpoint, and save to it unless --checkpoint is given.",
    )
    preview: str | None = declared(
        "--preview FILE.png|.exr", "path", "Regularly write an image of the render in progress."
    )
    preview_every: float = declared(
        "--preview-every S", "positive", "Interval between previews in seconds.  [default: 10]"
    )
    denoise: bool = declared(
        "--denoise", "flag", "Add a denoised layer, which PNGs then show (extra 'denoise')."
    )
    progress: str | None = declared(
        "--progress",
        click.Choice(["bar", "json", "off"]),
        "How progress is shown; json prints one line per second on standard output.  [default: "
        "bar]",
    )
    costs: str | None = declared(
        "--costs auto|measured|model|FILE.json",
        "text",
        "Source of material costs for scheduling; FILE.json is read if it exists, and written at "
        "the end.  [default: auto]",
    )
    learn_from: str | None = declared(
        "--learn-from FILE|before",
        "text",
        "Use the guiding data of another render, or with `before` of the previous frame, instead "
        "of training.",
    )
    learn_to: str | None = declared(
        "--learn-to FILE.learned", "path", "Save the guiding data of this render for --learn-from."
    )
    film_memory: float | None = declared(
        "--film-memory MB",
        "positive",
        "Memory limit of the image in MB; a larger image is rendered in bands of rows.  "
        "[default: half of the machine's memory]",
    )
    exposure: float = declared(
        "--exposure EV", "number", "Exposure of the PNG, in stops.  [default: 0]", default=0.0
    )
    tone_map: Any = declared(
        "--tone-map",
        click.Choice(["clamp", "neutral"]),
        "Tone mapping of the PNG: clamp clips at 1, neutral rolls off highlights.  [default: "
        "clamp]",
        default="clamp",
    )
    ocio_view: str | None = declared(
        "--ocio-view NAME",
        "text",
        "Show the PNG and previews through a view of $OCIO, such as AgX or an ACES view.",
    )
    ocio_display: str | None = declared(
        "--ocio-display NAME",
        "text",
        "OpenColorIO display of --ocio-view.  [default: an sRGB screen]",
    )
    quiet: bool = declared("--quiet", "flag", "Print only warnings and errors.")
    verbose: bool = declared(
        "--verbose", "flag", "Also print times of phases, materials and predicted costs at the end."
    )
    stage: str
    image: str | None
    source: StageOptions
    settings: dict[str, Any]
    whole: str  # fmt: skip

    @classmethod
    def parse(cls, options: dict[str, Any]) -> RenderOptions:
        """Builds an object from all arguments of a command, which are removed from ``options``.

        Raises WavecombError if options contradict each other.
        """
        whole = [name for name in ("denoise", "checkpoint", "resume", "preview", "deep")
                 if options[name]]  # fmt: skip
        source = StageOptions.take(options)
        options["every"] = _interval(options, "every", ("checkpoint", "resume"), 120.0)
        options["preview_every"] = _interval(options, "preview_every", ("preview",), 10.0)
        image = options["output"]
        if image is not None and image.lower().endswith(".png"):
            if options["png"] is not None:
                raise WavecombError(
                    f"-o {image}: is a PNG, and so is --png {options['png']}; give "
                    "-o FILE.exr, or leave out one of them"
                )
            options |= {"png": image, "output": None}
        if image is not None and options["output_dir"] is not None:
            raise WavecombError("--output-dir is for pictures that the stage names; -o names one")
        options["tone_map"] = _tone_map(options)
        if options["checkpoint"] is None:
            options["checkpoint"] = options["resume"]
        if aov_names.DEEP in options["aovs"]:
            raise WavecombError("--aov deep: is not a layer; give --deep FILE.exr")
        settings: dict[str, Any] = {}
        if options["costs"] in known_settings()["costs"].choices:
            settings["costs"], options["costs"] = options["costs"], None
        asked = cls.take(
            options, stage=options.pop("stage"), image=image, source=source,
            whole=f"--{whole[0]}" if whole else "", settings=settings,
        )  # fmt: skip
        settings |= {name: value for name, value in options.items() if value is not None}
        return asked

    def at(self, frame: float) -> RenderOptions:
        """Returns a copy with the frame filled into all file names that have a placeholder."""
        names: dict[str, Any] = {name: getattr(self, name) for name in NAMED}
        names = {name: fill(text, frame) for name, text in names.items() if text is not None}
        return replace(self, **names)

    def exist(self) -> bool:
        """Returns whether all files of the image exist."""
        names = (self.output, self.png, self.deep, self.stats_file)
        return all(name is None or os.path.exists(name) for name in names)


def _interval(options: dict[str, Any], name: str, files: Sequence[str], default: float) -> float:
    """Returns an interval in seconds; raises WavecombError if no file that uses it is written."""
    seconds: float | None = options[name]
    if seconds is not None and all(options[file] is None for file in files):
        needed = " or ".join(f"--{file}" for file in files)
        raise WavecombError(
            f"--{name.replace('_', '-')} applies to {files[0]}s: also give {needed}"
        )
    return default if seconds is None else seconds


def _tone_map(options: dict[str, Any]) -> Any:
    """Returns the tone mapping of PNGs from --tone-map, --ocio-view and --ocio-display."""
    view, display = options["ocio_view"], options["ocio_display"]
    if view is not None:
        from wavecomb import ocio

        if options["tone_map"] not in (None, "clamp"):
            raise WavecombError("--ocio-view and --tone-map are both for the PNG; give one")
        return ocio.tone_map(view, display)
    if display is not None:
        raise WavecombError("--ocio-display is for --ocio-view: give that, too")
    return options["tone_map"]


render_options = add_options(
    options_of(RenderOptions),
    option(
        "--region X0 Y0 X1 Y1", click.INT,
        "Rectangle of pixels to render; X1 and Y1 are exclusive.  "
        "[default: the render settings' data window, else the whole image]", nargs=4,
    ),
    setting_options(),
)  # fmt: skip
"""Options of all commands that render images, such as image size, time limit and files."""
