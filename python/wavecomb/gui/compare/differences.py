# SPDX-License-Identifier: Apache-2.0
"""Differences of two images, as numbers and as maps. The module is independent of Qt.

The numbers equal those that `wavecomb compare` prints.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.gui.compare.picture_sides import Side, pair
from wavecomb.image.compare.comparison import Comparison, compare
from wavecomb.image.compare.perceptual import psnr
from wavecomb.image.compare.z_test import ZTest, z_test

MAPS = {
    "absolute": "Absolute",
    "signed": "Signed",
    "flip-ldr": "FLIP",
    "flip-hdr": "FLIP, high range",
    "z": "z-test",
}
"""Displayed name of each kind of difference map."""


@dataclass(frozen=True)
class Numbers:
    """Differences between image A and the reference image B in one layer.

    Attributes:
        layer: Name of the layer.
        comparison: Differences of the linear pixel values.
        psnr: PSNR of the displayed values, in dB.
        flip: Mean FLIP of the displayed values; None if FLIP is not computed yet or not available.
        flip_note: Reason why there is no FLIP value.
        test: Result of the z-test; None if no variance is known.
        test_note: Reason why there is no result of the z-test.
        others_differ: Names of common layers, apart from ``layer``, that are not bit-identical;
            None if only ``layer`` was compared.
    """

    layer: str
    comparison: Comparison
    psnr: float
    flip: float | None = None
    flip_note: str = "being computed"
    test: ZTest | None = None
    test_note: str = ""
    others_differ: tuple[str, ...] | None = None

    def with_flip(self, mean: float | None, note: str = "") -> Numbers:
        """Returns a copy with the given FLIP value and note."""
        return replace(self, flip=mean, flip_note=note)


def numbers(a: Side, b: Side, layer: str, exposure: float) -> Numbers:
    """Computes all difference values except FLIP, whose computation takes longer.

    Raises:
        ValueError: The sizes or channels differ (``picture_sides.problem`` has a clearer message).
    """
    one, two = pair(a, b, layer)
    others: tuple[str, ...] | None = None
    comparison = compare(one, two)
    if not (a.live or b.live) and len(a.layers) > 1 and len(b.layers) > 1:
        whole = {name for name in a.layers if name in b.layers and name != layer}
        others = tuple(name for name in sorted(whole) if not same(a.layers[name], b.layers[name]))
    test, note = _test(a, b, layer, one, two)
    return Numbers(
        layer, comparison, psnr(one, two, exposure), test=test, test_note=note, others_differ=others
    )


def same(a: NDArray[Any], b: NDArray[Any]) -> bool:
    """Returns whether two arrays are equal bit for bit."""
    if a.shape != b.shape or a.dtype != b.dtype:
        return False
    bits = f"u{a.dtype.itemsize}"
    return bool(
        np.array_equal(np.ascontiguousarray(a).view(bits), np.ascontiguousarray(b).view(bits))
    )


def _test(
    a: Side, b: Side, layer: str, one: NDArray[Any], two: NDArray[Any]
) -> tuple[ZTest | None, str]:
    if layer != "beauty":
        return None, "available only for the beauty"
    variances = [side.variance for side in (a, b)]
    if all(variance is None for variance in variances):
        return None, "needs a variance: a layer of an adaptive render, or NAME_var.exr"
    kept = [v[:, :, : one.shape[2]] if v is not None else None for v in variances]
    try:
        return z_test(one, two, variance_a=kept[0], variance_b=kept[1]), ""
    except Exception as error:
        return None, str(error)


def rows(found: Numbers) -> list[tuple[str, str, str]]:
    """Returns the name, value and explanation of each number as rows of a table."""
    c = found.comparison
    pixels = c.width * c.height
    at = c.luminance_max_at
    out = [
        ("Verdict", verdict(found), "Equal means bit-identical in this layer; -0 differs from 0"),
        (
            "Pixels that differ",
            f"{c.pixels_different} of {pixels} ({100 * c.pixels_different / pixels:.3g} %)",
            "Pixels whose bits differ",
        ),
        ("relMSE", f"{c.rel_mse:.4g}", "Mean of (A - B)² / (B² + 0.01)"),
        (
            "relMSE, trimmed",
            f"{c.rel_mse_trimmed:.4g}",
            "relMSE without the 0.1 % of pixels with the largest terms",
        ),
        ("RMSE", f"{c.rmse:.4g}", "Square root of the mean of (A - B)², linear"),
        ("PSNR", decibels(found.psnr), "-10 log10 of the mean of (A - B)² as displayed"),
        (
            "FLIP, mean",
            f"{found.flip:.4g}" if found.flip is not None else found.flip_note,
            "Perceptual difference of the displayed images, from 0 (equal) to 1",
        ),
        (
            "Largest difference",
            f"{c.max_abs:.4g}" + (f" near {at[0]}, {at[1]}" if at else ""),
            "Of any channel; the pixel has the largest difference of luminance",
        ),
        ("Mean difference", _row(c.mean_signed), "Mean of A - B of each channel"),
    ]
    if c.pixels_not_finite:
        out.append(
            (
                "Not finite",
                f"{c.pixels_not_finite} pixels, {c.not_finite_differ} differ",
                "Pixels with a NaN or an infinity; left out of all means",
            )
        )
    out += _test_rows(found)
    if found.others_differ is not None:
        text = ", ".join(found.others_differ) or "all the same, bit for bit"
        out.append(("Other layers", text, "Layers that both have and whose bits differ"))
    return out


def verdict(found: Numbers) -> str:
    """Returns a one-line summary of the comparison."""
    c = found.comparison
    if c.pixels_different == 0:
        return "bit for bit the same"
    if found.test is not None:
        agrees = found.test.agrees and c.not_finite_differ == 0
        return "different; within noise" if agrees else "different; more than noise"
    return "different"


def _test_rows(found: Numbers) -> list[tuple[str, str, str]]:
    test = found.test
    why = "Whether A and B can have the same expectation, given the variance of their pixels"
    if test is None:
        return [("z-test", found.test_note, why)]
    said = "no difference shown" if test.agrees else "different expectation"
    where = f", worst tile at {test.worst_tile[0]}, {test.worst_tile[1]}" if test.worst_tile else ""
    accepted = f"{100 * test.pixels_accepted:.4g} % of pixel channels"
    return [
        ("z-test", f"{said}, p = {test.p_value:.3g}{where}", why),
        ("z-test, pixels", accepted, "Fraction of pixel channels that pass the test individually"),
    ]


def decibels(value: float) -> str:
    """Formats a PSNR in decibels."""
    return f"{value:.2f} dB" if math.isfinite(value) else "infinite: looks equal"


def _row(values: tuple[float, ...]) -> str:
    return "  ".join(f"{value:+.3g}" for value in values)


def pixel_rows(a: Side | None, b: Side | None, layer: str, x: int, y: int) -> dict[str, str]:
    """Returns the pixel values of A, B and A - B as text. Missing images have no entry."""
    found: dict[str, NDArray[Any]] = {}
    for name, side in (("A", a), ("B", b)):
        values = side.layer(layer) if side is not None else None
        if values is not None and 0 <= y < values.shape[0] and 0 <= x < values.shape[1]:
            found[name] = values[y, x]
    out = {name: "  ".join(f"{float(v):.5g}" for v in values) for name, values in found.items()}
    if len(found) == 2 and a is not None and b is not None and a.size == b.size:
        count = min(len(found["A"]), len(found["B"]))
        with np.errstate(invalid="ignore"):
            gap = found["A"][:count].astype(np.float64) - found["B"][:count].astype(np.float64)
        out["A - B"] = "  ".join(f"{float(v):+.5g}" for v in gap)
    return out
