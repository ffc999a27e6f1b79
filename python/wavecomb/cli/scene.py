# SPDX-License-Identifier: Apache-2.0
"""``wavecomb scene``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from wavecomb.cli.options import examples
from wavecomb.cli.row_options import Real


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
@click.option("-o", "--output", type=click.Path(), metavar="FILE", help=".usda, .usdc or .usd.")
@click.option("--list", "list_", is_flag=True, help="List the scenes.")
@click.option("--dragon", type=click.Path(), metavar="FILE", help="OBJ, PLY or USD mesh to use.")
@click.option(
    "--triangles",
    type=click.IntRange(min=1),
    metavar="N",
    help="Of our own dragon, or of the field.",
)
@click.option("--seed", type=click.IntRange(min=0), metavar="N", help="Of layout and patterns.")
@click.option("--texture-size", type=click.IntRange(min=16), metavar="N", help="Largest, texels.")
@click.option("--aspect", type=Real(0, above=True), metavar="X", help="Width / height.")
@click.option("--material", metavar="NAME", help="cornell-dragon: gold, copper, glass, jade.")
@click.option(
    "--materials", type=click.IntRange(min=1), metavar="N", help="spread, heavy: how many."
)
@click.option(
    "--programs", type=click.IntRange(1, 5), metavar="N", help="spread: kinds of materials, 1 to 5."
)
@click.option("--lights", type=click.IntRange(min=1), metavar="N", help="lights: how many.")
@click.option("--lamps", is_flag=True, help="mixed, dragon: a key, a fill and a dim dome.")
@click.option("--strands", type=click.IntRange(min=1), metavar="N", help="fur, head: how many.")
@click.option("--splats", type=click.IntRange(min=1), metavar="N", help="splats: how many.")
@click.option(
    "--capture",
    type=click.Path(),
    metavar="FILE",
    help="splats: a PLY of 3D Gaussian splats instead.",
)
@click.option(
    "--capture-linear", is_flag=True, help="Colours of the capture are linear light, not sRGB."
)
@click.option(
    "--voxels",
    type=click.IntRange(min=16),
    metavar="N",
    help="smoke, clouds: along the longest edge.",
)
@click.option("--texture-mb", type=Real(0), metavar="X", help="spread, heavy: memory of textures.")
@click.option(
    "--shader-cost",
    type=Real(1),
    metavar="X",
    help="spread: octaves of noise on the dearest material; 1: none.",
)
@click.option(
    "--plain",
    is_flag=True,
    help="UsdPreviewSurface as others export it: no program, metallic workflow. Not of heavy.",
)
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
