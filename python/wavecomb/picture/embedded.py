# SPDX-License-Identifier: Apache-2.0
"""Pictures inside pages and notebooks: PNG or JPEG as bytes, and as text that a page holds."""

from __future__ import annotations

import base64
import os
import tempfile
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from wavecomb.picture.exr import write_bands
from wavecomb.picture.image import png_spec

Kind = Literal["png", "jpeg"]
P = TypeVar("P", bound=np.generic)

_QUALITY = "jpeg:90"


def encoded(codes: NDArray[np.uint8], kind: Kind = "png") -> bytes:
    """8-bit sRGB codes, (height, width, 3), as the bytes of a file.

    Args:
        codes: Row 0 at the top.
        kind: "png": as they are; "jpeg": a tenth of that, at quality 90 with all of the colour.
    """
    spec = png_spec(*codes.shape[:2])
    if kind == "jpeg":
        spec.attribute("Compression", _QUALITY)
        spec.attribute("jpeg:subsampling", "4:4:4")
    # A file, not a folder of its own: that is all that a process in a sandbox may make.
    number, name = tempfile.mkstemp(suffix=f".{kind}")
    os.close(number)
    try:
        write_bands(name, spec, iter([np.ascontiguousarray(codes)]))
        return Path(name).read_bytes()
    finally:
        os.unlink(name)


def base64_text(data: bytes) -> str:
    """Bytes as text."""
    return base64.b64encode(data).decode("ascii")


def data_uri(codes: NDArray[np.uint8], kind: Kind = "png") -> str:
    """The picture as an address that holds all of it."""
    return f"data:image/{kind};base64,{base64_text(encoded(codes, kind))}"


def smaller(pixels: NDArray[Any], most: int) -> NDArray[np.float32]:
    """A picture with at most so many pixels an edge: each is the mean of a square of others.

    Args:
        pixels: Linear, (height, width, channels).
        most: Pixels of the longer edge.

    >>> smaller(np.ones((100, 50, 3)), 40).shape
    (33, 16, 3)
    """
    step = max(1, -(-max(pixels.shape[:2]) // most))
    height, width = (max(side // step, 1) for side in pixels.shape[:2])
    kept = np.asarray(pixels, np.float32)[: height * step, : width * step]
    if kept.shape[0] % step or kept.shape[1] % step:
        return np.ascontiguousarray(kept[::step, ::step])
    blocks = kept.reshape(height, step, width, step, -1)
    return np.asarray(blocks.mean(axis=(1, 3)), np.float32)


def every_nth(pixels: NDArray[P], most: int) -> NDArray[P]:
    """The same by leaving pixels out: of ids and of what is not finite there are no means."""
    step = max(1, -(-max(pixels.shape[:2]) // most))
    return np.ascontiguousarray(pixels[::step, ::step])
