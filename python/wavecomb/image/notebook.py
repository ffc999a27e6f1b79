# SPDX-License-Identifier: Apache-2.0
"""Shows an image in a notebook, with tone mapping, a summary line and collapsible layers."""

from __future__ import annotations

import html
from collections.abc import Collection
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from wavecomb.image.files.image import display
from wavecomb.image.layer_view import is_light, show_layer
from wavecomb.image.thumbnails import base64_text, data_uri, encode_image, shrink, subsample

MAX_EDGE = 1600
"""Largest edge of an image in a notebook, in pixels. Larger images are reduced by averaging."""
LAYER_EDGE = 360


class Rendered(Protocol):
    """Interface of ``wavecomb.Picture``.

    This module cannot import the class, since the module of the class imports this one.
    """

    @property
    def beauty(self) -> NDArray[np.float32]:
        """(height, width, 3), linear."""

    @property
    def denoised(self) -> NDArray[np.float32] | None:
        """Denoised linear colours (height, width, 3); None if the image was not denoised."""

    @property
    def samples(self) -> NDArray[np.uint32]:
        """Sample counts of pixels, with shape (height, width)."""

    @property
    def stats(self) -> dict[str, Any]:
        """Statistics of the render."""

    @property
    def cancelled(self) -> bool:
        """Whether the render was stopped early."""

    def layers(self) -> dict[str, NDArray[Any]]:
        """Returns the layers by name."""

    def shown(self) -> NDArray[Any]:
        """Returns the colours to display, in linear Rec.709."""


def codes(picture: Rendered) -> NDArray[np.uint8]:
    """Returns the image as 8-bit sRGB values, with the tone mapping "neutral"."""
    return display(shrink(picture.shown(), MAX_EDGE), tone_map="neutral")


def mime_bundle(
    picture: Rendered,
    include: Collection[str] | None = None,
    exclude: Collection[str] | None = None,
) -> dict[str, str]:
    """Returns the image in several MIME types: HTML with all layers, PNG, and text.

    Args:
        picture: The image.
        include: MIME types to return; None means all.
        exclude: MIME types to leave out.
    """
    made = {
        "text/html": lambda: page(picture),
        "image/png": lambda: base64_text(encode_image(codes(picture))),
        "text/plain": lambda: repr(picture),
    }
    wanted = [kind for kind in made if include is None or kind in include]
    return {kind: made[kind]() for kind in wanted if kind not in (exclude or ())}


def page(picture: Rendered) -> str:
    """Returns HTML of the image, its summary and its layers.

    The HTML has inline styles and no scripts, so that untrusted notebooks also show the HTML.
    """
    shown = codes(picture)
    line = html.escape(facts(picture))
    layers = [
        _layer(name, array)
        for name, array in picture.layers().items()
        if name not in ("beauty", "denoised") or picture.denoised is not None
    ]
    folded = ""
    if layers:
        many = f"{len(layers)} layers" if len(layers) > 1 else "1 layer"
        grid = "display:flex;flex-wrap:wrap;gap:10px;margin-top:6px"
        folded = (
            f"<details><summary>{many}</summary><div style='{grid}'>{''.join(layers)}</div>"
            "</details>"
        )
    return (
        f"<div><img src='{data_uri(shown)}' alt='rendered picture' style='max-width:100%'>"
        f"<p style='margin:4px 0;opacity:.75'>{line}</p>{folded}</div>"
    )


def _layer(name: str, array: NDArray[Any]) -> str:
    values = np.asarray(array)
    if is_light(name):
        small, legend = display(shrink(values, LAYER_EDGE), tone_map="neutral"), None
    else:
        shown = show_layer(subsample(values, LAYER_EDGE), name)
        small, legend = shown.pixels, shown.legend
    text = html.escape(name)
    if legend is not None:
        finite = values[np.isfinite(values)]
        is_one = finite.size > 0 and finite.min() == finite.max()
        ends = (legend.low,) if is_one else (legend.low, legend.high)
        text += ": " + " to ".join(f"{end:.3g}" for end in ends)
    return (
        f"<div><img src='{data_uri(small)}' alt='layer {html.escape(name)}' style='max-width:100%'>"
        f"<br>{text}</div>"
    )


def facts(picture: Rendered) -> str:
    """Returns a one-line summary of the image.

    The summary has the size, samples per pixel, render time, and whether the render was stopped.
    """
    height, width = picture.beauty.shape[:2]
    parts = [f"{width} x {height}", samples_text(picture.samples)]
    seconds = picture.stats.get("seconds", {})
    if seconds.get("render"):
        from wavecomb.run.progress import time_text

        parts.append(time_text(seconds["render"]))
    if picture.denoised is not None:
        parts.append("denoised")
    if picture.cancelled:
        parts.append("stopped before its end")
    return ", ".join(parts)


def samples_text(samples: NDArray[Any]) -> str:
    """Formats the samples per pixel as a number or, if they differ, as a range.

    >>> samples_text(np.array([[16, 16]])), samples_text(np.array([[4, 64]]))
    ('16 samples a pixel', '4 to 64 samples a pixel')
    """
    low, high = (int(samples.min()), int(samples.max())) if samples.size else (0, 0)
    if low == high:
        return f"{low} sample{'s' if low != 1 else ''} a pixel"
    return f"{low} to {high} samples a pixel"
