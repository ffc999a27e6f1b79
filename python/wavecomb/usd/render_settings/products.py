# SPDX-License-Identifier: Apache-2.0
"""Reads the render settings of a file before it is loaded."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from pxr import Usd

from wavecomb.usd.layers.opening import open_render_settings
from wavecomb.usd.render_settings.reader import read_product_settings
from wavecomb.usd.render_settings.values import ProductSettings
from wavecomb.usd.stage.diagnostics import capture_diagnostics
from wavecomb.usd.stage.report import LoadReport
from wavecomb.usd.stage.time_codes import frame_number, time_code


def peek_products(
    source: str | Path | Usd.Stage,
    render_settings: str | None = None,
    product: str | None = None,
    session_layer: str | Path | None = None,
) -> tuple[list[ProductSettings], Usd.Stage]:
    """Reads the render settings of a stage; returns one choice per product, at least one.

    Composes nothing else and reports nothing, since loading the stage repeats all messages. Keeping
    the returned stage alive until then avoids reading its layers twice.

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
