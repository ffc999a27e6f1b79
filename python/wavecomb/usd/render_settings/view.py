# SPDX-License-Identifier: Apache-2.0
"""Combines load options with the stage's render settings."""

from __future__ import annotations

from dataclasses import dataclass

from pxr import Usd

from wavecomb.load_options import PURPOSES, LoadOptions
from wavecomb.usd.cameras.camera import Lens, find_camera
from wavecomb.usd.cameras.lens import check_names
from wavecomb.usd.geometry.shutter import Blur
from wavecomb.usd.render_settings.reader import read_product_settings
from wavecomb.usd.render_settings.values import ProductSettings
from wavecomb.usd.stage.context import BINDING_PURPOSES
from wavecomb.usd.stage.report import LoadReport


@dataclass(frozen=True)
class ViewSettings:
    """``LoadOptions`` combined with the render settings of a stage.

    Attributes:
        choice: Values of the render settings.
        camera: The camera prim, or None.
        lens: Lens options for ``read_camera``.
        blur: Motion blur options for ``find_motion``.
        purposes: Purposes of the geometry that is rendered.
        binding_purposes: Purposes of material bindings in order of preference.
    """

    choice: ProductSettings
    camera: Usd.Prim | None
    lens: Lens
    blur: Blur
    purposes: tuple[str, ...]
    binding_purposes: tuple[str, ...]


def check_view(options: LoadOptions) -> None:
    """Raises WavecombError for options that are invalid for every stage."""
    options.check()
    check_names(options.lens_settings or {})
    _blur(options, True)


def view_settings(stage: Usd.Stage, options: LoadOptions, report: LoadReport) -> ViewSettings:
    """Combines options with the stage's render settings; options take precedence.

    Raises:
        WavecombError: The stage lacks something that the options name.
    """
    choices = read_product_settings(stage, options.render_settings, options.product, report)
    choice = choices[0]
    if options.product is None and len(choices) > 1:
        report.note(f"render product {choice.product} is the first of {len(choices)}")
    sharp = choice.depth_of_field if options.depth_of_field is None else options.depth_of_field
    lens = Lens(
        options.projection, options.exposure, sharp, choice.conform, choice.pixel_aspect,
        options.lens_settings or {}, options.st_map,
    )  # fmt: skip
    return ViewSettings(
        choice,
        find_camera(stage, options.camera or choice.camera),
        lens,
        _blur(options, choice.motion_blur),
        tuple(options.purposes or choice.purposes or PURPOSES[:2]),
        choice.material_purposes or BINDING_PURPOSES,
    )


def _blur(options: LoadOptions, wanted: bool) -> Blur:
    """Returns the motion blur options; a given shutter enables blur.

    ``wanted`` says whether the render settings enable it.
    """
    blurs = options.motion_blur
    if blurs is None:
        blurs = wanted or options.shutter is not None
    return Blur.chosen(options.shutter, blurs, options.motion_steps)
