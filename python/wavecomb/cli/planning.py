# SPDX-License-Identifier: Apache-2.0
"""Arguments of commands that render, and the checks made before rendering starts."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

from wavecomb.cli.aovs import AovOptions
from wavecomb.cli.frames import check_frames
from wavecomb.cli.job import Job, Names, purpose_at
from wavecomb.cli.options import StageOptions
from wavecomb.cli.products import Plan, plan_products
from wavecomb.cli.purpose import PurposeOptions
from wavecomb.cli.reporting import Reporter, make_reporter
from wavecomb.cli.size import ImageSize, Percent, is_png
from wavecomb.errors import WavecombError
from wavecomb.options import settings as known_settings
from wavecomb.run import aovs as aov_names
from wavecomb.run.frame_names import fill, has_place
from wavecomb.run.guiding_file import BEFORE, ENDING, Learning, check_trains_field, learned_of

if TYPE_CHECKING:
    from wavecomb.run.checkpoint import Checkpoint
    from wavecomb.usd.render_settings.reader import ProductSettings

Peek = Callable[[StageOptions, str], "tuple[list[ProductSettings], Any]"]
"""Type of ``StageOptions.peek``: reads the render settings of a stage."""


@dataclass
class Asked:
    """Arguments of a command that renders.

    Attributes:
        stage: File of the stage.
        output: -o.
        output_dir: --output-dir.
        png: --png, or -o if that is a PNG.
        png_alone: Whether -o is a PNG, so that no EXR is written.
        deep: --deep.
        stats_file: --stats.
        size: --size.
        spp: --spp.
        exposure: --exposure.
        tone_map: --tone-map.
        quiet: --quiet.
        verbose: --verbose.
        costs: --costs.
        learn_from: --learn-from.
        learn_to: --learn-to.
        frames: --frames.
        skip_existing: --skip-existing.
        film_memory: --film-memory.
        source: Options that load the stage.
        purpose: Options of ``purpose_options``.
        layers: Options of ``aov_options``.
        chosen: Values of the render settings that were given.
    """

    stage: str
    output: str | None
    output_dir: str | None
    png: str | None
    deep: str | None
    stats_file: str | None
    size: ImageSize | None
    spp: int | None
    exposure: float
    tone_map: Any
    quiet: bool
    verbose: bool
    costs: str | None
    learn_from: str | None
    learn_to: str | None
    frames: str | None
    skip_existing: bool
    film_memory: float | None
    source: StageOptions
    purpose: PurposeOptions
    layers: AovOptions
    chosen: dict[str, Any]
    png_alone: bool = False

    @classmethod
    def take(cls, options: dict[str, Any]) -> Asked:
        """Builds an object from all arguments of a command, removing those with a field here."""
        source = StageOptions.take(options)
        purpose = PurposeOptions.take(options)
        layers = AovOptions.take(options)
        if is_png(options["output"]):
            if options["png"] is not None:
                raise WavecombError(
                    f"-o {options['output']}: is a PNG, and so is --png {options['png']}; give "
                    "-o FILE.exr, or leave out one of them"
                )
            options["png"], options["output"] = options["output"], None
            options["png_alone"] = True
        view, display = options.pop("ocio_view", None), options.pop("ocio_display", None)
        if view is not None:
            from wavecomb import ocio

            if options["tone_map"] not in (None, "clamp"):
                raise WavecombError("--ocio-view and --tone-map are both for the PNG; give one")
            options["tone_map"] = ocio.tone_map(view, display)
        elif display is not None:
            raise WavecombError("--ocio-display is for --ocio-view: give that, too")
        names = [field.name for field in fields(cls)]
        own = {name: options.pop(name) for name in names if name in options}
        chosen = {name: value for name, value in options.items() if value is not None}
        return cls(source=source, purpose=purpose, layers=layers, chosen=chosen, **own)

    def named(self) -> list[str]:
        """Returns all file names in the options, except the stage."""
        names = (*self.written(), self.learn_from, self.purpose.resume)
        return [name for name in names if name is not None]

    @property
    def costs_file(self) -> str | None:
        """File of scheduling costs that is read and written, or None."""
        sources = known_settings()["costs"].choices
        return self.costs if self.costs is not None and self.costs not in sources else None

    def written(self) -> tuple[str | None, ...]:
        """Returns the files that the command writes, with placeholders for the frame."""
        own = (self.output, self.png, self.deep, self.stats_file, self.costs_file, self.learn_to)
        return (*own, self.purpose.preview, self.purpose.checkpoint_file)

    def at(self, frame: float) -> Asked:
        """Returns a copy with the frame filled into all file names that have a placeholder."""

        def filled(name: str | None) -> str | None:
            return None if name is None else fill(name, frame)

        names = ("output", "png", "deep", "stats_file", "learn_from", "learn_to")
        changes: dict[str, Any] = {name: filled(getattr(self, name)) for name in names}
        purpose = replace(purpose_at(self.purpose, frame), resume=filled(self.purpose.resume))
        costs = self.costs if self.costs_file is None else filled(self.costs)
        return replace(self, purpose=purpose, costs=costs, **changes)

    @property
    def image(self) -> str | None:
        """The image that -o names, an EXR or a PNG; None if the stage names it."""
        return self.png if self.png_alone else self.output

    @property
    def whole(self) -> str:
        """An option that needs the whole image in memory, or "" if there is none."""
        return self.purpose.whole or ("" if self.deep is None else "--deep")

    def learning(self) -> Learning:
        """Returns the initial guiding data of the images.

        Raises WavecombError if it cannot be read.
        """
        if self.learn_from != BEFORE:
            return Learning(learned_of(self.learn_from))
        if self.frames is None:
            raise WavecombError("--learn-from before: applies to sequences: also give --frames")
        return Learning(follows=True)

    def check_learning(self, settings: Any) -> None:
        """Raises WavecombError if path guiding learns nothing with such settings."""
        for option, given in (("--learn-from", self.learn_from), ("--learn-to", self.learn_to)):
            if given is not None:
                check_trains_field(settings, f"{option} {given}")

    def check_deep(self) -> None:
        """Raises WavecombError if --aov requests deep samples, which are not a layer."""
        if aov_names.DEEP in self.layers.aovs:
            raise WavecombError("--aov deep: is not a layer; give --deep FILE.exr")

    def check_deep_resumed(self, kept: Iterable[str]) -> None:
        """Raises WavecombError unless --deep is used as in the render that is resumed.

        Args:
            kept: AOVs of the resumed render.
        """
        had = aov_names.DEEP in kept
        if had and self.deep is None:
            raise WavecombError(
                f"{self.purpose.resume}: is of a render with a deep picture: "
                "also give --deep FILE.exr"
            )
        if self.deep is not None and not had:
            raise WavecombError(
                f"--deep {self.deep}: {self.purpose.resume} has no deep samples: "
                "leave --deep out, or start anew"
            )


@dataclass
class Prepared:
    """Render jobs that passed all checks.

    Attributes:
        asked: Arguments, with the frame of a single image filled into the file names.
        source: Options that load the stage, completed from the checkpoint.
        resumed: Checkpoint that the render continues, or None.
        jobs: Plan, frames (None for a single image) and job of each render product.
        learning: Initial guiding data of all jobs.
        opened: Held until the stage is loaded, so that USD reads its layers only once.
        reporter: Progress display of all jobs.
    """

    asked: Asked
    source: StageOptions
    resumed: Checkpoint | None
    jobs: list[tuple[Plan, tuple[float, ...] | None, Job]]
    learning: Learning
    opened: Any
    reporter: Reporter


def prepare(asked: Asked, peek: Peek = StageOptions.peek) -> Prepared:
    """Checks everything that can fail before rendering, and builds the jobs.

    Raises:
        WavecombError: An option, a file or a setting is invalid.
    """
    from wavecomb.run.bands import band_rows
    from wavecomb.run.settings import has_error_layers

    asked = _with_frame(asked, peek)
    purpose, layers, source = asked.purpose, asked.layers, asked.source

    def checked(names: Names, plan: Plan | None = None) -> tuple[float, ...] | None:
        """Returns the frames of a sequence, after checking all output files of the plan."""
        numbers = check_frames(asked.frames, asked.skip_existing, source, names, purpose)
        for frame in (None,) if numbers is None else numbers:
            here = names if frame is None else names.at(frame)
            if plan is not None:
                plan.check_place(here)
            at_frame = purpose if frame is None else purpose_at(purpose, frame)
            _check_outputs(asked, here, at_frame)
        return numbers

    asked.check_deep()
    beside = Names(None, asked.png, asked.stats_file, asked.deep)
    if asked.output is not None or asked.png_alone:
        checked(replace(beside, output=asked.output))
    if purpose.denoise:
        from wavecomb.image.denoise import check_denoiser

        check_denoiser()
    resumed = purpose.load()
    chosen = dict(asked.chosen)
    if asked.costs is not None and asked.costs_file is None:
        chosen["costs"] = asked.costs
    profile = _read_costs(asked.costs_file)
    learning = asked.learning()
    chosen |= purpose.settings(asked.spp, resumed)
    if asked.size is not None:
        chosen["size"] = asked.size
    if resumed is not None:
        chosen = {**_earlier(resumed.settings, sized=asked.size is None), **chosen}
        source = source.completed(resumed.source)
    kept = chosen.pop("aovs", aov_names.for_core(aov_names.DEFAULT))
    if resumed is not None:
        asked.check_deep_resumed(kept)
    before = None if resumed is None else resumed.aovs
    _check_settings(chosen)
    choices, opened = peek(source, asked.stage)
    plans = plan_products(
        choices, asked.output, beside, purpose, asked.output_dir, png_alone=asked.png_alone
    )
    if asked.frames is None and any(has_place(plan.names.image) for plan in plans):
        frame = choices[0].first_frame if source.frame is None else source.frame
        plans = [replace(plan, names=plan.names.at(frame)) for plan in plans]
    reporter = make_reporter(purpose.progress, asked.quiet, asked.verbose)

    def fits(settings: Any, aovs: Any) -> None:
        band_rows(settings, aovs, asked.film_memory, whole=asked.whole, tile=layers.tile)

    def job_of(plan: Plan, numbers: tuple[float, ...] | None) -> Job:
        aovs = plan.aovs(layers, before)
        others = [name for name in aov_names.GUIDES if purpose.denoise or name in kept]
        if asked.deep is not None:
            others.append(aov_names.DEEP)
        settings = plan.settings(
            chosen, aov_names.with_others(aovs, others), resumed is not None, fits
        )
        shows_errors = has_error_layers(settings) and aovs == aov_names.DEFAULT
        further = (*("denoised",) * purpose.denoise, *aov_names.ERRORS * shows_errors)
        asked.check_learning(settings)
        job = Job(
            asked.stage, settings, aovs, profile, layers, reporter, asked.exposure,
            asked.tone_map, asked.film_memory, learning,
        )  # fmt: skip
        if plan.names.output is None:
            check_png_alone(asked, plan.names.image)
            return job
        layers.check(plan.names.output, (*aovs, *further))
        if layers.split:
            plan.check_split((*aovs, *further), numbers)
        return job

    # Check all products before rendering the first.
    all_numbers = [checked(plan.names, plan) for plan in plans]
    jobs = [
        (plan, numbers, job_of(plan, numbers))
        for plan, numbers in zip(plans, all_numbers, strict=True)
    ]
    return Prepared(asked, source, resumed, jobs, learning, opened, reporter)


def check_png_alone(asked: Asked, png: str) -> None:
    """Raises WavecombError if options describe an EXR file, but only a PNG is written."""
    layers = asked.layers
    for option, given in (
        ("--aov", layers.aovs),
        ("--half", layers.half),
        ("--split-aovs", layers.split),
        ("--exr-tile", layers.tile),
    ):
        if given:
            raise WavecombError(
                f"{option}: is for EXR files, and {png} is the only image: give -o FILE.exr"
            )


def _check_settings(chosen: dict[str, Any]) -> None:
    """Raises WavecombError for settings that are invalid for any stage.

    The region and the memory are checked later, when the image size is known.
    """
    from wavecomb.run.settings import check_options

    known = dict(chosen)
    width, height = known.pop("width", None), known.pop("height", None)
    size = None if width is None or height is None else (width, height)
    size = known.pop("size", size)
    if isinstance(size, Percent):
        size = None
    check_options(size, known.pop("spp"), known)


def _with_frame(asked: Asked, peek: Peek) -> Asked:
    """Fills the frame into the file names of a single image.

    The frame is the one of --frame, else of the resumed checkpoint, else the first of the stage.
    """
    if asked.frames is not None or not any(map(has_place, asked.named())):
        return asked
    frame, resume = asked.source.frame, asked.purpose.resume
    if frame is None and resume is not None and not has_place(resume):
        resumed = asked.purpose.load()
        assert resumed is not None
        frame = asked.source.completed(resumed.source).frame
    if frame is None:
        frame = peek(asked.source, asked.stage)[0][0].first_frame
    return asked.at(frame)


def _earlier(settings: dict[str, Any], *, sized: bool) -> dict[str, Any]:
    """Returns settings of a resumed render for ``make_settings``.

    Args:
        settings: Settings of the checkpoint.
        sized: Whether to include the size of the displayed image, without overscan.
    """
    beyond = 2 * settings.get("overscan", 0)
    edges: dict[str, Any] = {
        name: settings[name] - beyond for name in ("width", "height") if name in settings
    }
    out = {name: value for name, value in settings.items() if name not in edges}
    return {**out, **edges} if sized else out


def _check_outputs(asked: Asked, names: Names, purpose: PurposeOptions) -> None:
    """Raises WavecombError if an output file cannot be written or is named twice."""
    from wavecomb.image.files.output_file import check_writable

    outputs = [
        (names.output, "-o", ".exr"),
        (names.png, "--png", ".png"),
        (names.deep, "--deep", ".exr"),
        (names.stats, "--stats", None),
        (asked.costs_file, "--costs", None),
        (asked.learn_to, "--learn-to", ENDING),
        (purpose.preview, "--preview", ".png"),
        (purpose.checkpoint_file, "--checkpoint", None),
    ]
    for name, option, ending in outputs:
        if name is not None and ending is not None and not name.lower().endswith(ending):
            endings = ".exr or .png" if option == "-o" else ending
            raise WavecombError(f"{option} {name}: the name must end in {endings}")
        if option == "--costs" and name is not None and not name.lower().endswith(".json"):
            sources = known_settings()["costs"].choices
            raise WavecombError(
                f"--costs {name}: must be one of {', '.join(sources)}, "
                "or a file whose name ends in .json"
            )
    seen = {os.path.realpath(asked.stage): "the stage"}
    for name, option, _ in outputs:
        if name is None:
            continue
        other = seen.setdefault(os.path.realpath(name), option)
        if other != option:
            raise WavecombError(f"{option} {name}: is the same file as {other}")
        check_writable(name)


def _read_costs(costs_file: str | None) -> dict[str, dict[str, float]] | None:
    """Returns the cost profile in a file, or None if the file does not exist yet."""
    if costs_file is None or not os.path.exists(costs_file):
        return None
    from wavecomb.run.cost_profile import load_costs

    return load_costs(costs_file)
