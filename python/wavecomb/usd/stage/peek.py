# SPDX-License-Identifier: Apache-2.0
"""A look at the render settings of a file before it is loaded."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from pxr import Usd

from wavecomb.usd.stage.choice import RenderChoice
from wavecomb.usd.stage.diagnostics import captured
from wavecomb.usd.stage.opening import open_render_settings
from wavecomb.usd.stage.render_settings import read_choices
from wavecomb.usd.stage.report import LoadReport
from wavecomb.usd.stage.times import frame_number, time_code


def peek_products(
    file: str | Path,
    render_settings: str | None = None,
    product: str | None = None,
    session_layer: str | Path | None = None,
) -> tuple[list[RenderChoice], Usd.Stage]:
    """What the render settings of a file ask for, a choice for each product; at least one.

    Nothing else of the stage is composed, and nothing is reported: loading it says all again. Who
    keeps the stage that is given, too, until then, saves reading its layers twice.

    Args:
        file: .usd, .usda, .usdc or .usdz.
        render_settings: Path or name of a RenderSettings prim.
        product: Path or name of the only product to render.
        session_layer: File with opinions that are stronger than the stage's.

    Raises:
        WavecombError: A file cannot be read; there are no such settings or no such product.
    """
    unread = LoadReport()
    with captured(unread):
        layer = None if session_layer is None else Path(session_layer)
        stage = open_render_settings(Path(file), render_settings, layer)
        choices = read_choices(stage, render_settings, product, unread)
        start = frame_number(time_code(stage, None))
        return [replace(choice, start=start) for choice in choices], stage
