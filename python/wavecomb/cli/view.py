# SPDX-License-Identifier: Apache-2.0
"""Command ``wavecomb view``."""

from __future__ import annotations

from typing import Any

import click

from wavecomb.cli.command import SettingCommand
from wavecomb.cli.options import StageOptions, examples, optional_stage
from wavecomb.cli.setting_options import ImageSize, Percent, SizeType, setting_options
from wavecomb.load_options import given

DEFAULT_SIZE = (960, 540)


@click.command(
    "view",
    cls=SettingCommand,
    epilog=examples(
        "wavecomb view shot.usd",
        "wavecomb view shot.usd --size 1280x720 --spp 256 --camera /World/Cam",
        "wavecomb view shot.usd --variant '/World/Car{paint}=red' --policy adaptive",
    ),
)
@optional_stage
@click.option(
    "--size",
    type=SizeType(),
    default="960x540",
    metavar="WxH|N%",
    help="Image size in pixels, or in percent of the default size.  [default: 960x540]",
)
@click.option("--spp", type=int, metavar="N", help="Number of samples per pixel.  [default: 64]")
@setting_options(("max_depth", "seed", "threads", "policy", "ray_order", "roulette"))
@click.option("--denoise", is_flag=True, help="Denoise the image when it is finished.")
def view_command(stage: str | None, size: ImageSize, denoise: bool, **options: Any) -> None:
    """Open STAGE in a window to navigate, edit and compare.

    Without STAGE the window opens empty. See docs/window.md.
    """
    from wavecomb.errors import WavecombError
    from wavecomb.extras import needed

    needed("PySide6.QtWidgets", "the window", extra="gui")
    needed("pyqtgraph", "the window", extra="gui")
    if denoise:
        from wavecomb.image.denoise import check_denoiser

        check_denoiser()
    from wavecomb.gui.setup import Setup

    source = StageOptions.take(options)
    loading = given(source.values)
    if source["texture_limit"] is not None or source["working_space"] not in (None, "rec709"):
        name = "--working-space" if source["texture_limit"] is None else "--texture-limit"
        raise WavecombError(f"{name} is not for the window: leave it out, or use wavecomb render")
    chosen = {name: value for name, value in options.items() if value is not None}
    width, height = size.of(DEFAULT_SIZE) if isinstance(size, Percent) else size
    setup = Setup().changed(width=width, height=height, denoise=denoise, **chosen)
    from wavecomb.gui.app import run

    code = run(
        stage,
        setup,
        camera=loading.get("camera"),
        time=loading.get("frame"),
        variants=loading.get("variants"),
        purposes=loading.get("purposes"),
    )
    raise click.exceptions.Exit(code)
