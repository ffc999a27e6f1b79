# SPDX-License-Identifier: Apache-2.0
"""``wavecomb compare``."""

from __future__ import annotations

import json
from typing import Any

import click

from wavecomb.cli.options import Real, examples


@click.command(
    "compare",
    epilog=examples(
        "wavecomb compare new.exr reference.exr",
        "wavecomb compare new.exr reference.exr --heatmap difference.png",
        "wavecomb compare new.exr reference.exr --tolerance 1e-4 --json",
    ),
)
@click.argument("a", type=click.Path())
@click.argument("b", type=click.Path())
@click.option("--heatmap", type=click.Path(), metavar="FILE.png", help="Where they differ.")
@click.option("--json", "as_json", is_flag=True, help="For programs.")
@click.option(
    "--tolerance",
    type=Real(0),
    metavar="X",
    help="Exit with 0, too, where no colour channel differs by more than X.",
)
def compare_command(
    a: str, b: str, heatmap: str | None, as_json: bool, tolerance: float | None
) -> None:
    """Say how picture A differs from picture B, the reference.

    Equal means bit for bit, in every layer that both have. relMSE is the mean of
    (A - B)^2 / (B^2 + 0.01). Pixels with a NaN or an infinity in A or B are counted and left out of
    all figures; they are equal where their bits are. Whole-number formats (PNG, JPEG) are read as
    sRGB and compared as linear light.

    Exit codes: 0 equal (or within --tolerance), 1 different, 2 an error.
    """
    from wavecomb.compare import compare
    from wavecomb.errors import WavecombError
    from wavecomb.files import check_writable

    if heatmap is not None:
        if not heatmap.lower().endswith(".png"):
            raise WavecombError(f"--heatmap {heatmap}: the name must end in .png")
        check_writable(heatmap)
    try:
        result = compare(a, b)
    except ValueError as error:
        raise WavecombError(str(error)) from error
    passed = result.equal or (tolerance is not None and result.within(tolerance))
    if heatmap is not None:
        from wavecomb.heatmap import write_heat_map

        write_heat_map(heatmap, a, b)
    if as_json:
        document = {"a": a, "b": b, "tolerance": tolerance, "passed": passed, **result.to_dict()}
        click.echo(json.dumps(document, indent=2))
    else:
        for line in _lines(result):
            click.echo(line)
        if tolerance is not None and not result.equal:
            click.echo("within the tolerance" if passed else "not within the tolerance")
    raise click.exceptions.Exit(0 if passed else 1)


def _lines(result: Any) -> list[str]:
    pixels = result.width * result.height
    lines: list[str] = []
    if result.equal:
        lines.append(f"equal, bit for bit ({result.width} x {result.height})")
    else:
        share = 100.0 * result.pixels_different / pixels
        lines.append(f"different: {result.pixels_different} of {pixels} pixels ({share:.3g} %)")
        where = f" at {result.luminance_max_at}" if result.luminance_max_at else ""
        lines.append(
            f"luminance  mean |A - B| {result.luminance_mean_abs:.4g}, "
            f"max {result.luminance_max_abs:.4g}{where}"
        )
        lines.append("channels   mean A - B   " + _row(result.mean_signed))
        lines.append("           mean |A - B| " + _row(result.mean_abs))
        lines.append(f"RMSE {result.rmse:.4g}, relMSE {result.rel_mse:.4g}")
    if result.pixels_not_finite:
        lines.append(
            f"not finite, left out: {result.pixels_not_finite} pixels, "
            f"{result.not_finite_differ} of them with other bits"
        )
    for name, entry in result.layers.items():
        if not entry["equal"]:
            size = "other size" if entry["max_abs"] is None else f"max {entry['max_abs']:.4g}"
            lines.append(f"layer {name} differs: {size}")
    for label, names in (("A", result.only_a), ("B", result.only_b)):
        if names:
            lines.append(f"only in {label}: {', '.join(names)}")
    return lines


def _row(values: tuple[float, ...]) -> str:
    return "  ".join(f"{value:+.4g}" for value in values)
