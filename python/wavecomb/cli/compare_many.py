# SPDX-License-Identifier: Apache-2.0
"""Comparison of folders and sequences, and the HTML pages and wipe images of all comparisons."""

from __future__ import annotations

import json
import os

import click

from wavecomb.errors import WavecombError
from wavecomb.image.compare.comparison import Comparison
from wavecomb.image.compare.folders import FolderPair, PairResult, as_plain, pair_up
from wavecomb.image.compare.heatmap import KINDS, Kind
from wavecomb.image.files.output_file import replacing
from wavecomb.image.thumbnails import DisplayOptions
from wavecomb.terminal import say


def compare_many(
    a: str, b: str, *, tolerance: float | None, as_json: bool, page: str | None, kind: str,
    look: DisplayOptions,
) -> bool:  # fmt: skip
    """Compares all pairs of images and prints the results.

    Returns:
        True if all pairs pass and no image lacks a counterpart.

    Raises:
        WavecombError: There are no images to compare.
    """
    folders = pair_up(a, b)
    results: list[PairResult] = []
    for one in folders.compared():
        results.append(one)
        if not as_json:
            say(_line(one, tolerance))
    good = sum(one.passed(tolerance) for one in results)
    passed = good == len(results) and not folders.only_a and not folders.only_b
    if page is not None:
        write_page(page, results, (a, b), folders, tolerance, kind, look)
    if as_json:
        pairs = [as_plain(one, tolerance) for one in results]
        document = {"a": a, "b": b, "tolerance": tolerance, "passed": passed, "pairs": pairs,
                    "only_a": folders.only_a, "only_b": folders.only_b}  # fmt: skip
        click.echo(json.dumps(document, indent=2))
        return passed
    for label, names in (("A", folders.only_a), ("B", folders.only_b)):
        for name in names:
            say(f"{name}: only in {label}")
    missing = len(folders.only_a) + len(folders.only_b)
    more = f"; {missing} have no other" if missing else ""
    say(f"{good} of {len(results)} pairs pass{more}")
    return passed


def _line(one: PairResult, tolerance: float | None) -> str:
    found = one.result
    if found is None:
        return f"{one.name}: {one.problem}"
    if found.equal:
        return f"{one.name}: equal, bit for bit"
    word = "within the tolerance" if one.passed(tolerance) else "different"
    share = 100.0 * found.pixels_different / (found.width * found.height)
    return (
        f"{one.name}: {word}: {share:.3g} % of pixels, RMSE {found.rmse:.4g}, "
        f"relMSE {found.rel_mse:.4g}, largest {found.max_abs:.4g}"
    )


def write_page(
    page: str, results: list[PairResult], sources: tuple[str, str], folders: FolderPair | None,
    tolerance: float | None, kind: str, look: DisplayOptions,
) -> None:  # fmt: skip
    """Writes an HTML page of compared pairs, replacing the file only when complete."""
    from wavecomb.image.compare.folders import compare_page

    chosen: Kind = next((one for one in KINDS if one == kind), "absolute")
    text = compare_page(
        results, look, sources=sources, folders=folders, tolerance=tolerance, kind=chosen
    )
    with replacing(page) as part:
        part.write_text(text, encoding="utf-8")


def write_pair_page(
    page: str, a: str, b: str, found: Comparison, kind: str, look: DisplayOptions
) -> None:
    """Writes an HTML page of two images from their finished comparison."""
    result = PairResult("", a, b, found)
    write_page(page, [result], (a, b), None, None, kind, look)


def write_wipe(file: str, a: str, b: str, at: float, look: DisplayOptions) -> None:
    """Writes a PNG with image A to the left and image B to the right of a vertical line.

    Raises:
        WavecombError: The images differ in size.
    """
    from wavecomb.image.files.image import write_png_codes
    from wavecomb.image.thumbnails import wipe

    shown = look.codes(a), look.codes(b)
    if shown[0].shape != shown[1].shape:
        raise WavecombError(f"{a} and {b}: only images of the same size can be wiped")
    names = (os.path.basename(a), os.path.basename(b))
    write_png_codes(file, wipe(*shown, at, names if names[0] != names[1] else ("A", "B")))
