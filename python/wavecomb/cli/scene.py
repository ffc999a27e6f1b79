# SPDX-License-Identifier: Apache-2.0
"""``wavecomb scene``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from wavecomb.cli.options import examples
from wavecomb.cli.setting_options import Real, add_options, option


def _names(context: click.Context, parameter: click.Parameter, begun: str) -> list[str]:
    """For the shell: the scenes whose names begin so."""
    from wavecomb.scenes import SCENES

    return [name for name in SCENES if name.startswith(begun)]


@click.command(
    "scene",
    epilog=examples(
        "wavecomb scene --list",
        "wavecomb scene mixed -o mixed.usdc",
        "wavecomb scene cornell-dragon -o box.usda --dragon dragon.obj",
        "wavecomb scene spread -o spread.usdc --materials 256 --texture-mb 64 --shader-cost 10",
        "wavecomb scene heavy -o heavy.usdc --materials 64 --texture-mb 2000",
        "wavecomb scene lights -o street.usdc --lights 10000",
        "wavecomb scene smoke -o smoke.usdc --voxels 500",
        "wavecomb scene head -o head.usdc --strands 1000000",
        "wavecomb scene splats -o capture.usdc --capture point_cloud.ply",
        "wavecomb scene mixed -o plain.usdc --plain --lamps",
    ),
)
@click.argument("name", required=False, shell_complete=_names)
@add_options(
    option("-o --output FILE", "path", ".usda, .usdc or .usd."),
    option("--list", "flag", "List the scenes.", name="list_"),
    option("--dragon FILE", "path", "OBJ, PLY or USD mesh to use."),
    option("--triangles N", "count", "Of our own dragon, or of the field."),
    option("--seed N", click.IntRange(min=0), "Of layout and patterns."),
    option("--texture-size N", click.IntRange(min=16), "Largest, texels."),
    option("--aspect X", "positive", "Width / height."),
    option("--material NAME", "text", "cornell-dragon: gold, copper, glass, jade."),
    option("--materials N", "count", "spread, heavy: how many."),
    option("--programs N", click.IntRange(1, 5), "spread: kinds of materials, 1 to 5."),
    option("--lights N", "count", "lights: how many."),
    option("--lamps", "flag", "mixed, dragon: a key, a fill and a dim dome."),
    option("--strands N", "count", "fur, head: how many."),
    option("--splats N", "count", "splats: how many."),
    option("--capture FILE", "path", "splats: a PLY of 3D Gaussian splats instead."),
    option("--capture-linear", "flag", "Colours of the capture are linear light, not sRGB."),
    option("--voxels N", click.IntRange(min=16), "smoke, clouds: along the longest edge."),
    option("--texture-mb X", Real(0), "spread, heavy: memory of textures."),
    option(
        "--shader-cost X", Real(1), "spread: octaves of noise on the dearest material; 1: none."
    ),
    option(
        "--plain", "flag",
        "UsdPreviewSurface as others export it: no program, metallic workflow. Not of heavy.",
    ),
)  # fmt: skip
def scene_command(name: str | None, output: str | None, list_: bool, **options: Any) -> None:
    """Write one of our own test stages, and its textures and grids beside it."""
    from wavecomb.errors import WavecombError
    from wavecomb.scenes import SCENES, write_scene

    if list_:
        width = max(len(key) for key in SCENES)
        for key, info in SCENES.items():
            click.echo(f"{key:{width}}  {info.summary}")
        return
    if name is None or output is None:
        raise click.UsageError("give a NAME and -o FILE, or --list")
    from wavecomb.picture.files import check_writable

    check_writable(output)
    chosen = {key: value for key, value in options.items() if value is not None}
    try:
        write_scene(name, Path(output), **chosen)
    except ValueError as error:
        raise WavecombError(str(error)) from error
    click.echo(f"wrote {output}")
