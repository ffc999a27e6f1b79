# SPDX-License-Identifier: Apache-2.0
"""Command ``wavecomb compare``."""

from __future__ import annotations

import json
import math
from typing import Any

import click

from wavecomb.cli.options import examples, isolate_option
from wavecomb.cli.sandbox import enter_to_read
from wavecomb.cli.setting_options import Real, add_options, option
from wavecomb.terminal import say

_METRICS = ("psnr", "ssim", "flip-ldr", "flip-hdr")
_MAPS = ("absolute", "signed", "flip-ldr", "flip-hdr", "z")


@click.command(
    "compare",
    epilog=examples(
        "wavecomb compare new.exr reference.exr",
        "wavecomb compare new.exr reference.exr --heatmap difference.png --map signed",
        "wavecomb compare new.exr reference.exr --tolerance 1e-4 --json",
        "wavecomb compare new.exr reference.exr --metric ssim --metric flip-hdr",
        "wavecomb compare new.exr reference.exr --variance-b reference_variance.exr",
        "wavecomb compare new.exr reference.exr --wipe wipe.png --page wipe.html",
        "wavecomb compare new/ reference/ --page differences.html",
        "wavecomb compare new/shot.####.exr reference/shot.####.exr --tolerance 1e-4",
    ),
)
@click.argument("a", type=click.Path())
@click.argument("b", type=click.Path())
@add_options(
    option(
        "--metric", click.Choice(_METRICS), "Image metric to compute (repeatable).",
        name="metrics", multiple=True,
    ),
    option(
        "--exposure STOPS", "number",
        "Scale images by 2^STOPS for psnr, ssim, flip-ldr, --page and --wipe.  [default: 0]",
        default=0.0,
    ),
    option(
        "--variance-a FILE", "path",
        "Image with the variance of A's pixels, for a z-test of the difference.  [default: none]",
    ),
    option("--variance-b FILE", "path", "Image with the variance of B's pixels, for the z-test."),
    option(
        "--significance P", click.FloatRange(0.0, 1.0, min_open=True, max_open=True),
        "Significance level of the z-test.", default=0.01, show_default=True,
    ),
    option("--heatmap FILE.png", "path", "Write a false-colour image of the differences."),
    option(
        "--map", click.Choice(_MAPS), "Kind of difference that --heatmap and --page show.",
        name="kind", default="absolute", show_default=True,
    ),
    option(
        "--page FILE.html", "path",
        "Write an HTML page with a movable wipe line between A and B, and their difference.",
    ),
    option(
        "--wipe FILE.png", "path",
        "Write an image that shows A to the left and B to the right of a vertical line.",
    ),
    option(
        "--at X", click.FloatRange(0, 1),
        "Position of the wipe line, 0 to 1 of the image width.  [default: 0.5]", default=0.5,
    ),
    option(
        "--tone-map", click.Choice(["clamp", "neutral"]),
        "Tone mapping of the images of --page and --wipe.  [default: clamp]", default="clamp",
    ),
    option("--json", "flag", "Print JSON on standard output.", name="as_json"),
    option(
        "--tolerance X", Real(0),
        "Exit with code 0 if no colour channel differs by more than X.",
    ),
)  # fmt: skip
@isolate_option
def compare_command(
    *,
    a: str,
    b: str,
    metrics: tuple[str, ...],
    exposure: float,
    variance_a: str | None,
    variance_b: str | None,
    significance: float,
    heatmap: str | None,
    kind: str,
    page: str | None,
    wipe: str | None,
    at: float,
    tone_map: Any,
    as_json: bool,
    tolerance: float | None,
) -> None:
    """Compare image A with image B, the reference.

    Two folders are compared by the file names inside them, two sequences (shot.####.exr) by frame.
    An image without a counterpart counts as different.

    Equal means bit for bit, in every layer that both images have. relMSE is the mean of (A - B)^2 /
    (B^2 + 0.01); trimmed relMSE leaves out the 0.1 % of pixels with the largest terms. Pixels with
    a NaN or an infinity in A or B are counted and left out of all figures; they are equal if their
    bits are equal. Integer formats (PNG, JPEG) are decoded from sRGB and compared as linear light.

    A variance image holds the variance of each pixel's mean. Given one or two variance images, a
    z-test reports whether the images can have the same expectation.

    Exit codes: 0 equal (or within --tolerance, or the z-test finds no difference), 1 different, 2
    an error.
    """
    from wavecomb.image.compare.folders import is_many

    many = is_many(a) or is_many(b)
    enter_to_read((heatmap, page, wipe))
    from wavecomb.errors import WavecombError
    from wavecomb.image.compare.comparison import compare
    from wavecomb.image.files.output_file import check_writable
    from wavecomb.image.thumbnails import DisplayOptions

    # The HTML page and the wipe image show the beauty layer and not the denoised layer, because the
    # metrics compare the beauty layers.
    look = DisplayOptions(denoised=False, exposure=exposure, tone_map=tone_map)
    for name, file, ending in (("--page", page, ".html"), ("--wipe", wipe, ".png")):
        if file is not None and not file.lower().endswith(ending):
            raise WavecombError(f"{name} {file}: the name must end in {ending}")
        if file is not None:
            check_writable(file)
    if many:
        _refuse({"--heatmap": heatmap, "--wipe": wipe, "--variance-a": variance_a,
                 "--variance-b": variance_b, "--metric": metrics})  # fmt: skip
        from wavecomb.cli.compare_many import compare_many

        passed = compare_many(
            a, b, tolerance=tolerance, as_json=as_json, page=page, kind=kind, look=look
        )
        raise click.exceptions.Exit(0 if passed else 1)
    testing = variance_a is not None or variance_b is not None
    if kind == "z" and not testing:
        raise WavecombError("--map z needs --variance-a or --variance-b")
    if heatmap is not None:
        if not heatmap.lower().endswith(".png"):
            raise WavecombError(f"--heatmap {heatmap}: the name must end in .png")
        check_writable(heatmap)
    test: Any = None
    try:
        result = compare(a, b)
        measured = _measure(a, b, metrics, exposure)
        if testing:
            from wavecomb.image.compare.z_test import z_test

            test = z_test(
                a, b, variance_a=variance_a, variance_b=variance_b, significance=significance
            )
        if heatmap is not None:
            _write_map(heatmap, a, b, kind, exposure, test)
        if page is not None or wipe is not None:
            from wavecomb.cli.compare_many import write_pair_page, write_wipe

            if page is not None:
                write_pair_page(page, a, b, result, kind, look)
            if wipe is not None:
                write_wipe(wipe, a, b, at, look)
    except ValueError as error:
        raise WavecombError(str(error)) from error
    passed = result.equal or (tolerance is not None and result.within(tolerance))
    passed = passed or (test is not None and test.agrees and result.not_finite_differ == 0)
    if as_json:
        document = {"a": a, "b": b, "tolerance": tolerance, "passed": passed, **result.to_dict()}
        finite = {k: v if math.isfinite(v) else None for k, v in measured.items()}
        document |= {"metrics": finite, "z_test": test.to_dict() if test is not None else None}
        click.echo(json.dumps(document, indent=2))
    else:
        for line in (*_lines(result), *_metric_lines(measured, test)):
            say(line)
        if tolerance is not None and not result.equal:
            within = result.within(tolerance)
            say("within the tolerance" if within else "not within the tolerance")
    raise click.exceptions.Exit(0 if passed else 1)


def _refuse(options: dict[str, Any]) -> None:
    """Raises WavecombError for options that apply only to a pair of images."""
    from wavecomb.errors import WavecombError

    for name, value in options.items():
        if value:
            raise WavecombError(f"{name} is only for two images; --page FILE.html compares folders")


def _measure(a: str, b: str, metrics: tuple[str, ...], exposure: float) -> dict[str, float]:
    if not metrics:
        return {}
    from wavecomb.image.compare.perceptual import METRICS, measure

    return {name: measure(name, a, b, exposure) for name in METRICS if name in metrics}


def _write_map(path: str, a: str, b: str, kind: str, exposure: float, test: Any) -> None:
    from wavecomb.image.compare.heatmap import KINDS, write_heat_map, z_map
    from wavecomb.image.files.image import write_png

    if kind == "z":
        write_png(path, z_map(test))
    else:
        write_heat_map(path, a, b, next(k for k in KINDS if k == kind), exposure=exposure)


def _metric_lines(measured: dict[str, float], test: Any) -> list[str]:
    lines = [f"{name.upper()} {value:.4g}" for name, value in measured.items()]
    if test is not None:
        verdict = "no difference shown" if test.agrees else "different expectation"
        where = f", worst tile at {test.worst_tile}" if test.worst_tile else ""
        lines.append(
            f"z-test: {verdict}, p = {test.p_value:.3g} over {test.tests} tests{where}; "
            f"{100.0 * test.pixels_accepted:.4g} % of pixel channels accepted"
        )
        lines.append("        mean of the image, z    " + _row(test.mean_z))
    return lines


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
        lines.append(
            f"RMSE {result.rmse:.4g}, relMSE {result.rel_mse:.4g}, "
            f"trimmed {result.rel_mse_trimmed:.4g}"
        )
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
