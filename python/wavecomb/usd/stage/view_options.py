# SPDX-License-Identifier: Apache-2.0
"""What is seen and how: options, and under them what the stage's render settings say."""

from __future__ import annotations

from dataclasses import dataclass

from pxr import Usd

from wavecomb.load_options import PURPOSES, LoadOptions
from wavecomb.usd.cameras.camera import Lens, find_camera
from wavecomb.usd.cameras.lens import check_names
from wavecomb.usd.geometry.shutter import Blur
from wavecomb.usd.stage.choice import RenderChoice
from wavecomb.usd.stage.context import BINDING_PURPOSES
from wavecomb.usd.stage.render_settings import read_choices
from wavecomb.usd.stage.report import LoadReport


@dataclass(frozen=True)
class Seen:
    """What ``LoadOptions`` come to on a stage.

    Attributes:
        choice: Of the render settings.
        camera: Prim; None: there is none.
        lens: For ``read_camera``.
        blur: For ``find_motion``.
        purposes: Of the geometry.
        binding_purposes: Of material bindings.
    """

    choice: RenderChoice
    camera: Usd.Prim | None
    lens: Lens
    blur: Blur
    purposes: tuple[str, ...]
    binding_purposes: tuple[str, ...]


def check_view(options: LoadOptions) -> None:
    """Raises WavecombError for what no stage can have."""
    options.check()
    check_names(options.lens_settings or {})
    _blur(options, True)


def seen_on(stage: Usd.Stage, options: LoadOptions, report: LoadReport) -> Seen:
    """What options come to on a stage, with what its render settings say where they say nothing.

    Raises:
        WavecombError: It has not what is asked for.
    """
    choices = read_choices(stage, options.render_settings, options.product, report)
    choice = choices[0]
    if options.product is None and len(choices) > 1:
        report.note(f"render product {choice.product} is the first of {len(choices)}")
    sharp = choice.depth_of_field if options.depth_of_field is None else options.depth_of_field
    lens = Lens(
        options.projection, options.exposure, sharp, choice.conform, choice.pixel_aspect,
        options.lens_settings or {}, options.st_map,
    )  # fmt: skip
    return Seen(
        choice,
        find_camera(stage, options.camera or choice.camera),
        lens,
        _blur(options, choice.motion_blur),
        tuple(options.purposes or choice.purposes or PURPOSES[:2]),
        choice.material_purposes or BINDING_PURPOSES,
    )


def _blur(options: LoadOptions, wanted: bool) -> Blur:
    """``wanted``: by the render settings; a shutter that is chosen says that it is."""
    blurs = options.motion_blur
    if blurs is None:
        blurs = wanted or options.shutter is not None
    return Blur.chosen(options.shutter, blurs, options.motion_steps)
