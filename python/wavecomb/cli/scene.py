# SPDX-License-Identifier: Apache-2.0
"""Command ``wavecomb scene``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from wavecomb.cli.options import examples
from wavecomb.cli.setting_options import Real, add_options, option
from wavecomb.terminal import say


def _names(context: click.Context, parameter: click.Parameter, begun: str) -> list[str]:
    """Returns the scene names that begin with ``begun``, for shell completion."""
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
    option("-o --output FILE", "path", "Stage file to write: .usda, .usdc or .usd."),
    option("--list", "flag", "List the built-in scenes.", name="list_"),
    option("--dragon FILE", "path", "OBJ, PLY or USD mesh that replaces the built-in dragon."),
    option(
        "--triangles N", "count",
        "Number of triangles of the built-in dragon or of the field of stones.  "
        "[default: 250000]",
    ),
    option(
        "--seed N", click.IntRange(min=0),
        "Random seed of the scene's layout and patterns.  [default: 1]",
    ),
    option(
        "--texture-size N", click.IntRange(min=16),
        "Width of the largest textures, in texels.  [default: 2048]",
    ),
    option(
        "--aspect X", "positive",
        "Aspect ratio of the camera, width / height.  [default: the scene's]",
    ),
    option(
        "--material NAME", "text",
        "Dragon material in scene `cornell-dragon`: gold, copper, glass, jade.  [default: gold]",
    ),
    option(
        "--materials N", "count",
        "Number of materials in the scenes `spread` and `heavy`.  [default: 16]",
    ),
    option(
        "--programs N", click.IntRange(1, 5),
        "Number of kinds of materials in the scene `spread`, 1 to 5.  [default: 5]",
    ),
    option("--lights N", "count", "Number of lights in the scene `lights`.  [default: 1000]"),
    option(
        "--lamps", "flag",
        "Illuminate the scenes `mixed` and `dragon` with a key light, a fill light and a dim "
        "dome.",
    ),
    option(
        "--strands N", "count",
        "Number of hair strands in the scenes `fur` and `head`.  [default: 100000]",
    ),
    option(
        "--splats N", "count",
        "Number of Gaussian splats in the scene `splats`.  [default: 60000]",
    ),
    option("--capture FILE", "path", "PLY file of 3D Gaussian splats for the scene `splats`."),
    option(
        "--capture-linear", "flag",
        "Read the colours in the file of --capture as linear values, not as sRGB.",
    ),
    option(
        "--voxels N", click.IntRange(min=16),
        "Voxels along the longest edge of the grid in scene `smoke` or `clouds`.  [default: 160]",
    ),
    option(
        "--texture-mb X", Real(0),
        "Total size of the textures in scene `spread` or `heavy`, in MB.  [default: 16]",
    ),
    option(
        "--shader-cost X", Real(1),
        "Octaves of noise on the most expensive material of the scene `spread`; X = 1 gives no "
        "noise.  [default: 1]",
    ),
    option(
        "--plain", "flag",
        "Use only UsdPreviewSurface with the metallic workflow (any scene except `heavy`).",
    ),
)  # fmt: skip
def scene_command(name: str | None, output: str | None, list_: bool, **options: Any) -> None:
    """Write a procedural test stage, with its textures and volumes beside it."""
    from wavecomb.errors import WavecombError
    from wavecomb.scenes import SCENES, write_scene

    if list_:
        width = max(len(key) for key in SCENES)
        for key, info in SCENES.items():
            say(f"{key:{width}}  {info.summary}")
        return
    if name is None or output is None:
        raise click.UsageError("give a NAME and -o FILE, or --list")
    from wavecomb.image.files.output_file import check_writable

    check_writable(output)
    chosen = {key: value for key, value in options.items() if value is not None}
    try:
        write_scene(name, Path(output), **chosen)
    except ValueError as error:
        raise WavecombError(str(error)) from error
    say(f"wrote {output}")
