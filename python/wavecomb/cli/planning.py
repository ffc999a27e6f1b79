# SPDX-License-Identifier: Apache-2.0
"""Checks the options of a render command before rendering starts, and builds its jobs."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from wavecomb.api import import_usd
from wavecomb.cli.job import Job
from wavecomb.cli.products import Product, checked_frames, plan_products
from wavecomb.cli.render_options import NAMED, RenderOptions
from wavecomb.cli.reporting import make_reporter
from wavecomb.cli.setting_options import Percent
from wavecomb.errors import WavecombError
from wavecomb.load_options import given
from wavecomb.run import aovs as aov_names
from wavecomb.run.checkpoint import Checkpoint, check_replaceable, load_checkpoint
from wavecomb.run.frame_names import has_place
from wavecomb.run.guiding_file import BEFORE, Learning, check_trains_field, learned_of
from wavecomb.run.settings import check_options, has_error_layers

if TYPE_CHECKING:
    from wavecomb.usd.render_settings.reader import ProductSettings

DEFAULT_SPP = 64
ADAPTIVE_SPP = 1024
UNLIMITED_SPP = 1 << 20


@dataclass
class Prepared:
    """Render jobs that passed all checks.

    Attributes:
        options: Options, whose file names contain the frame if a single image is rendered.
        resumed: Checkpoint that the render continues, or None.
        jobs: A job for each render product.
        opened: The open USD stage. It is kept until the stage is loaded, so that USD reads the
            layers only once.
    """

    options: RenderOptions
    resumed: Checkpoint | None
    jobs: list[Job]
    opened: Any


def prepare(options: RenderOptions) -> Prepared:
    """Checks options, files and settings before rendering, and builds the jobs.

    Raises:
        WavecombError: An option, a file or a setting is invalid.
    """
    options = _with_frame(options)
    frames = None if options.image is None else checked_frames(options)
    if options.denoise:
        from wavecomb.image.denoise import check_denoiser

        check_denoiser()
    resumed = _resumed(options)
    profile, learning = _costs(options.costs), _learning(options)
    chosen = options.settings | _sampling(options, resumed)
    if options.size is not None:
        chosen["size"] = options.size
    if resumed is not None:
        chosen = {**_earlier(resumed.settings, sized=options.size is None), **chosen}
        options = replace(options, source=options.source.completed(resumed.source))
    kept = chosen.pop("aovs", aov_names.for_core(aov_names.DEFAULT))
    if resumed is not None:
        _check_deep(options, kept)
    if options.preview is not None:
        # The first preview should show the whole image.
        chosen["progressive"] = True
    _check_settings(chosen)
    choices, opened = _peek(options)
    named = options.image is not None
    products = [Product(choices[0], options, frames)] if named else plan_products(choices, options)
    reporter = make_reporter(options.progress, options.quiet, options.verbose)

    def job_of(product: Product) -> Job:
        own = {"product": product.choice.product} if product.choice.product else {}
        source = replace(options.source, values={**options.source.values, **own})
        here = replace(product.options, source=source)
        aovs = product.aovs(None if resumed is None else resumed.aovs)
        others = [name for name in aov_names.GUIDES if here.denoise or name in kept]
        others += [aov_names.DEEP] * (here.deep is not None)
        with_others = aov_names.with_others(aovs, others)
        settings = product.settings(chosen, with_others, resumed is not None)
        for option, file in (("--learn-from", here.learn_from), ("--learn-to", here.learn_to)):
            if file is not None:
                check_trains_field(settings, f"{option} {file}")
        shows_errors = has_error_layers(settings) and aovs == aov_names.DEFAULT
        further = (*("denoised",) * here.denoise, *aov_names.ERRORS * shows_errors)
        product.check_layers((*aovs, *further))
        return Job(
            here, product.frames, settings, aovs, given(source.values), profile,
            learning, reporter,
        )  # fmt: skip

    # Check all products before rendering the first.
    return Prepared(options, resumed, [job_of(one) for one in products], opened)


def _with_frame(options: RenderOptions) -> RenderOptions:
    """Fills the frame into the file names of a single image.

    The frame comes from --frame, else from the resumed checkpoint, else it is the first frame.
    """
    names = [name for name in (getattr(options, field) for field in NAMED) if name is not None]
    if options.frames is not None or not any(map(has_place, names)):
        return options
    frame, resume = options.source.values["frame"], options.resume
    if frame is None and resume is not None and not has_place(resume):
        frame = options.source.completed(load_checkpoint(resume).source).values["frame"]
    if frame is None:
        frame = _peek(options)[0][0].first_frame
    return options.at(frame)


def _peek(options: RenderOptions) -> tuple[list[ProductSettings], Any]:
    """Reads the stage's render settings.

    Returns:
        The settings of each render product, and an object that keeps USD's layers in memory. While
            this object is alive, loading the stage does not read the layers again.
    """
    import_usd()
    from wavecomb.usd import peek_products

    values = options.source.values
    return peek_products(
        options.stage, values["render_settings"], values["product"], values["session_layer"]
    )


def _resumed(options: RenderOptions) -> Checkpoint | None:
    """Loads the checkpoint to resume, or None.

    Raises WavecombError if --checkpoint would overwrite another kind of file.
    """
    if options.checkpoint not in (None, options.resume):
        check_replaceable(options.checkpoint)
    return None if options.resume is None else load_checkpoint(options.resume)


def _costs(file: str | None) -> dict[str, dict[str, float]] | None:
    """Returns the cost profile in a file, or None if the file does not exist yet."""
    if file is None or not os.path.exists(file):
        return None
    from wavecomb.run.cost_profile import load_costs

    return load_costs(file)


def _learning(options: RenderOptions) -> Learning:
    """Returns the initial guiding data of the images; raises WavecombError if there is none."""
    if options.learn_from != BEFORE:
        return Learning(learned_of(options.learn_from))
    if options.frames is None:
        raise WavecombError("--learn-from before: applies to sequences: also give --frames")
    return Learning(follows=True)


def _sampling(options: RenderOptions, resumed: Checkpoint | None) -> dict[str, Any]:
    """Returns the render settings that determine the number of samples."""
    before = resumed.settings if resumed is not None else {}
    chosen = {
        name: value
        for name in ("adaptive", "noise", "min_spp", "time_limit")
        if (value := getattr(options, name)) is not None
    }
    spp, most = options.spp, options.max_spp
    is_adaptive = any({**before, **chosen}.get(name) for name in ("adaptive", "noise"))
    for option, given_spp in (("--min-spp", options.min_spp), ("--max-spp", most)):
        if given_spp is not None and not is_adaptive:
            raise WavecombError(
                f"{option} applies to adaptive renders: also give --adaptive or --noise"
            )
    if None not in (spp, most) and spp != most:
        raise WavecombError(f"--spp is {spp} and --max-spp {most}; give one of them")
    asked = spp if spp is not None else most
    was_timed = before.get("spp") == UNLIMITED_SPP and not is_adaptive
    if was_timed and asked is None and options.time_limit is None:
        raise WavecombError(
            f"{options.resume}: is of a render that a time limit was to end: "
            "give --time-limit or --spp"
        )
    if asked is None and "spp" not in before:
        asked = ADAPTIVE_SPP if is_adaptive else DEFAULT_SPP
        if options.time_limit is not None:
            asked = UNLIMITED_SPP
    return chosen if asked is None else {**chosen, "spp": asked}


def _earlier(settings: dict[str, Any], *, sized: bool) -> dict[str, Any]:
    """Returns arguments of ``make_settings`` from the settings of a resumed render.

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


def _check_deep(options: RenderOptions, kept: Iterable[str]) -> None:
    """Raises WavecombError if either this or the resumed render uses --deep, but not both.

    Args:
        options: Options of the command.
        kept: AOVs that the resumed render keeps.
    """
    had = aov_names.DEEP in kept
    if had and options.deep is None:
        raise WavecombError(
            f"{options.resume}: is of a render with a deep picture: also give --deep FILE.exr"
        )
    if options.deep is not None and not had:
        raise WavecombError(
            f"--deep {options.deep}: {options.resume} has no deep samples: "
            "leave --deep out, or start anew"
        )


def _check_settings(chosen: dict[str, Any]) -> None:
    """Raises WavecombError for settings that are invalid for every stage.

    The region and the memory are checked later, when the image size is known.
    """
    known = dict(chosen)
    width, height = known.pop("width", None), known.pop("height", None)
    size = None if width is None or height is None else (width, height)
    size = known.pop("size", size)
    check_options(None if isinstance(size, Percent) else size, known.pop("spp"), known)
