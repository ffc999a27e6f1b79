# SPDX-License-Identifier: Apache-2.0
"""Images of the differences between two images, with a title and a colour bar."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from wavecomb.image.compare.comparison import colour_pair, luminance
from wavecomb.image.layer_view import colour_map, signed_colour_map

if TYPE_CHECKING:
    from wavecomb.image.compare.comparison import Source
    from wavecomb.image.compare.z_test import ZTest

Kind = Literal["absolute", "signed", "flip-ldr", "flip-hdr"]
KINDS: tuple[Kind, ...] = get_args(Kind)
DECADES = 4
Z_RANGE = 5.0
MIN_WIDTH = 340
"""Smallest width of a map in pixels, so that title and labels fit. Narrower images are padded with
black."""

_NOT_FINITE = (0.0, 1.0, 1.0)
_BAR_HEIGHT = 58
_MARGIN = 8
_TEXT_SIZE = 13


@dataclass(frozen=True)
class Scale:
    """Differences mapped to a colour scale.

    Attributes:
        title: Name and unit of the displayed quantity.
        colours: Colours of the scale, with shape (count, 3).
        ticks: Position along the colour bar, from 0 to 1, and label of each tick.
        position: Position of every pixel's value along the colour bar, with shape (height, width).
            NaN is shown in black.
        finite: Mask of the pixels whose values in A and B are finite, with shape (height, width).
            Other pixels are cyan. None means that the values of all pixels are finite.
    """

    title: str
    colours: NDArray[np.float32]
    ticks: Sequence[tuple[float, str]]
    position: NDArray[np.float64]
    finite: NDArray[np.bool_] | None = None

    def pixels(self) -> NDArray[np.float32]:
        """Returns the colours of all pixels in linear Rec.709, with shape (height, width, 3)."""
        last = len(self.colours) - 1
        known = ~np.isnan(self.position)
        along = np.clip(np.where(known, self.position, 0.0), 0.0, 1.0)
        colours = self.colours[(along * last + 0.5).astype(np.intp)]
        colours[~known] = 0.0
        if self.finite is not None:
            colours[~self.finite] = _NOT_FINITE
        return colours


def heat_map(
    a: Source, b: Source, kind: Kind = "absolute", *, exposure: float = 0.0
) -> NDArray[np.float32]:
    """Shows differences between A and the reference B as colours, with a title and a colour bar.

    - The kind "absolute" shows luminance differences on a logarithmic scale. This scale covers four
      decades below the largest difference; smaller differences have the darkest colour.
    - The kind "signed" uses separate logarithmic scales for positive and negative differences. A is
      brighter than B in orange pixels and darker in blue pixels. Differences that are more than
      four decades below the largest are black.
    - The kinds "flip-ldr" and "flip-hdr" show FLIP values from 0 to 1, computed by
    ``perceptual.flip``.

    Equal pixels are black. Pixels with a NaN or an infinity are cyan.

    Returns:
        Linear Rec.709 pixels with shape (height + bar, width, 3). The width is at least
        ``MIN_WIDTH``.
    """
    return _draw(scale_of(a, b, kind, exposure=exposure))


def scale_of(
    a: Source,
    b: Source,
    kind: Kind = "absolute",
    *,
    exposure: float = 0.0,
    flip_values: NDArray[np.float32] | None = None,
) -> Scale:
    """Returns the colour scale with which ``heat_map`` shows the differences of two images.

    Args:
        a: Image A.
        b: Reference image.
        kind: Kind of difference, as for ``heat_map``.
        exposure: Exposure in stops of the displayed images for the kind "flip-ldr".
        flip_values: Result of ``perceptual.flip``; None means that it is computed.
    """
    pixels_a, pixels_b = colour_pair(a, b)
    finite = np.isfinite(pixels_a).all(axis=2) & np.isfinite(pixels_b).all(axis=2)
    if kind in ("flip-ldr", "flip-hdr"):
        from wavecomb.image.compare.perceptual import flip

        values = flip_values
        if values is None:
            values = flip(a, b, high_range=kind == "flip-hdr", exposure=exposure)
        return replace(_linear(values, kind), finite=finite)
    kept = finite[:, :, None]
    wide_a = np.where(kept, pixels_a, 0).astype(np.float64)
    difference = luminance(wide_a - np.where(kept, pixels_b, 0))
    found = _signed(difference) if kind == "signed" else _absolute(difference)
    return replace(found, finite=finite)


def z_map(test: ZTest) -> NDArray[np.float32]:
    """Shows the deviates of a z-test in colours from -5 to 5 standard errors.

    The channel with the largest deviate determines a pixel's colour.
    """
    return _draw(z_scale(test))


def z_scale(test: ZTest) -> Scale:
    """Returns the colour scale with which ``z_map`` shows the deviates of a z-test."""
    channel = np.abs(test.z_pixels).argmax(axis=2)[:, :, None]
    z = np.take_along_axis(test.z_pixels, channel, axis=2)[:, :, 0]
    ticks = [(0.5 + 0.5 * value / Z_RANGE, _number(value)) for value in (-5, -2.5, 0, 2.5, 5)]
    position = np.where(z == 0.0, np.nan, 0.5 + 0.5 * z / Z_RANGE)
    return Scale("A - B in standard errors (z)", signed_colour_map(), ticks, position)


def write_heat_map(
    path: str | os.PathLike[str],
    a: Source,
    b: Source,
    kind: Kind = "absolute",
    *,
    exposure: float = 0.0,
) -> None:
    """Writes the result of ``heat_map`` as a PNG file."""
    from wavecomb.image.files.image import write_png

    write_png(path, heat_map(a, b, kind, exposure=exposure))


def _absolute(difference: NDArray[np.float64]) -> Scale:
    size = np.abs(difference)
    peak = float(size.max())
    title = "|A - B|, linear luminance"
    if peak == 0.0:
        return Scale(title, colour_map(), [(1.0, "0")], np.full(size.shape, np.nan))
    ticks = [(k / DECADES, f"{peak * 10.0 ** (k - DECADES):.1e}") for k in range(DECADES + 1)]
    position = np.where(size > 0.0, _decades(size, peak), np.nan)
    return Scale(title, colour_map(), ticks, position)


def _signed(difference: NDArray[np.float64]) -> Scale:
    size = np.abs(difference)
    peak = float(size.max())
    title = "A - B, linear luminance"
    if peak == 0.0:
        return Scale(title, signed_colour_map(), [(0.5, "0")], np.full(size.shape, np.nan))
    position = 0.5 + 0.5 * np.sign(difference) * _decades(size, peak)
    ticks = [(0.5, "0")]
    for k in (2, 4):
        label = f"{peak * 10.0 ** (k - DECADES):.1e}"
        ticks += [(0.5 - 0.5 * k / DECADES, "-" + label), (0.5 + 0.5 * k / DECADES, "+" + label)]
    return Scale(title, signed_colour_map(), ticks, np.where(size > 0.0, position, np.nan))


def _linear(values: NDArray[Any], kind: str) -> Scale:
    title = f"{kind.upper()} (0 looks equal, 1 is the most)"
    ticks = [(t, _number(t)) for t in (0.0, 0.25, 0.5, 0.75, 1.0)]
    position = np.where(values > 0.0, values.astype(np.float64), np.nan)
    return Scale(title, colour_map(), ticks, position)


def _decades(size: NDArray[np.float64], peak: float) -> NDArray[np.float64]:
    """Maps values to a logarithmic scale: the peak to 1, and a value four decades below to 0."""
    with np.errstate(divide="ignore"):
        return np.clip(1.0 + np.log10(size / peak) / DECADES, 0.0, 1.0)


def _draw(scale: Scale) -> NDArray[np.float32]:
    colours = scale.pixels()
    height, width = colours.shape[:2]
    result = np.zeros((height + _BAR_HEIGHT, max(width, MIN_WIDTH), 3), np.float32)
    result[:height, :width] = colours
    result[height:] = _bar(result.shape[1], scale)
    return result


def _bar(width: int, scale: Scale) -> NDArray[np.float32]:
    """Draws the title, the colour ramp and its ticks. Leaves out labels that would overlap."""
    import OpenImageIO as oiio

    length = width - 2 * _MARGIN
    bar = np.zeros((_BAR_HEIGHT, width, 3), np.float32)
    ramp = np.linspace(0, len(scale.colours) - 1, length).astype(np.intp)
    bar[22:36, _MARGIN : _MARGIN + length] = scale.colours[ramp]
    places = [(_MARGIN + round((length - 1) * t), label) for t, label in scale.ticks]
    for middle, _ in places:
        bar[36:39, middle] = 1.0
    canvas = oiio.ImageBuf(np.ascontiguousarray(bar))

    def write(x: int, y: int, text: str) -> None:
        oiio.ImageBufAlgo.render_text(canvas, x, y, text, _TEXT_SIZE, "", (1.0, 1.0, 1.0))

    write(_MARGIN, 16, scale.title)
    end = -1
    for middle, label in sorted(places):
        extent = oiio.ImageBufAlgo.text_size(label, _TEXT_SIZE).width
        left = min(max(middle - extent // 2, 2), width - extent - 2)
        if left > end:
            write(left, 52, label)
            end = left + extent + 6
    return np.asarray(canvas.get_pixels(oiio.FLOAT), np.float32).reshape(bar.shape)


def _number(value: float) -> str:
    return f"{value:g}"
