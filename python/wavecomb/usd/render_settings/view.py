# SPDX-License-Identifier: Apache-2.0
"""Render settings of a stage that is loaded, or of a file before it is loaded."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from pxr import Usd

from wavecomb.load_options import PURPOSES, LoadOptions
from wavecomb.usd.cameras.camera import Lens, find_camera
from wavecomb.usd.cameras.lens import check_names
from wavecomb.usd.geometry.shutter import Blur
from wavecomb.usd.layers.opening import open_render_settings
from wavecomb.usd.render_settings.reader import ProductSettings, read_product_settings
from wavecomb.usd.stage.context import BINDING_PURPOSES
from wavecomb.usd.stage.report import LoadReport, capture_diagnostics
from wavecomb.usd.stage.time_codes import frame_number, time_code


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


def view_settings(
    stage: Usd.Stage, options: LoadOptions, report: LoadReport, has_cameras: bool = True
) -> ViewSettings:
    """Combines options with the stage's render settings; options take precedence.

    ``has_cameras`` is False if the caller knows that the stage has no cameras, which saves a
    search.

    Raises:
        WavecombError: The options name render settings, a product or a camera that does not exist.
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
        find_camera(stage, options.camera or choice.camera, has_cameras),
        lens,
        _blur(options, choice.motion_blur),
        tuple(options.purposes or choice.purposes or PURPOSES[:2]),
        choice.material_purposes or BINDING_PURPOSES,
    )


def _blur(options: LoadOptions, wanted: bool) -> Blur:
    """Returns the motion blur options; a given shutter enables blur.

    ``wanted`` says whether the render settings enable motion blur.
    """
    blurs = options.motion_blur
    if blurs is None:
        blurs = wanted or options.shutter is not None
    return Blur.chosen(options.shutter, blurs, options.motion_steps)


def peek_products(
    source: str | Path | Usd.Stage,
    render_settings: str | None = None,
    product: str | None = None,
    session_layer: str | Path | None = None,
) -> tuple[list[ProductSettings], Usd.Stage]:
    """Reads a stage's render settings for each product; default settings if there are none.

    Opens only the part of a stage that render settings need. Discards all messages, because loading
    the stage repeats them. Keeping the returned stage alive until the stage is loaded avoids
    reading its layers twice.

    Args:
        source: .usd, .usda, .usdc or .usdz, or an open stage.
        render_settings: Path or name of a RenderSettings prim.
        product: Path or name of the only product to render.
        session_layer: File with opinions that are stronger than the stage's.

    Raises:
        WavecombError: A file cannot be read, or the settings or product do not exist.
    """
    unread = LoadReport()
    with capture_diagnostics(unread):
        layer = None if session_layer is None else Path(session_layer)
        if isinstance(source, Usd.Stage):
            stage = source
        else:
            stage = open_render_settings(Path(source), render_settings, layer)
        choices = read_product_settings(stage, render_settings, product, unread)
        start = frame_number(time_code(stage, None))
        return [replace(choice, start=start) for choice in choices], stage
