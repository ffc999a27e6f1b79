# SPDX-License-Identifier: Apache-2.0
"""Encodes images for pages and notebooks: PNG or JPEG as bytes or as data URIs."""

from __future__ import annotations

import base64
import os
import tempfile
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from wavecomb.image.files.exr import write_bands
from wavecomb.image.files.image import png_spec

Kind = Literal["png", "jpeg"]
P = TypeVar("P", bound=np.generic)

_QUALITY = "jpeg:90"


def encode_image(codes: NDArray[np.uint8], kind: Kind = "png") -> bytes:
    """Encodes 8-bit sRGB codes (height, width, 3) as the bytes of an image file.

    Args:
        codes: Pixels with row 0 at the top.
        kind: "png" is lossless; "jpeg" has quality 90 without chroma subsampling and takes about a
            tenth of the size.
    """
    spec = png_spec(*codes.shape[:2])
    if kind == "jpeg":
        spec.attribute("Compression", _QUALITY)
        spec.attribute("jpeg:subsampling", "4:4:4")
    # Use a file instead of a folder, since a sandboxed process may create only files.
    number, name = tempfile.mkstemp(suffix=f".{kind}")
    os.close(number)
    try:
        write_bands(name, spec, iter([np.ascontiguousarray(codes)]))
        return Path(name).read_bytes()
    finally:
        os.unlink(name)


def base64_text(data: bytes) -> str:
    """Encodes bytes as Base64 text."""
    return base64.b64encode(data).decode("ascii")


def data_uri(codes: NDArray[np.uint8], kind: Kind = "png") -> str:
    """Encodes an image as a data URI."""
    return f"data:image/{kind};base64,{base64_text(encode_image(codes, kind))}"


def shrink(pixels: NDArray[Any], most: int) -> NDArray[np.float32]:
    """Reduces an image to at most ``most`` pixels per edge by averaging square blocks.

    Args:
        pixels: Linear (height, width, channels).
        most: Largest length of the longer edge in pixels.

    >>> shrink(np.ones((100, 50, 3)), 40).shape
    (33, 16, 3)
    """
    step = max(1, -(-max(pixels.shape[:2]) // most))
    height, width = (max(side // step, 1) for side in pixels.shape[:2])
    kept = np.asarray(pixels, np.float32)[: height * step, : width * step]
    if kept.shape[0] % step or kept.shape[1] % step:
        return np.ascontiguousarray(kept[::step, ::step])
    blocks = kept.reshape(height, step, width, step, -1)
    return np.asarray(blocks.mean(axis=(1, 3)), np.float32)


def subsample(pixels: NDArray[P], most: int) -> NDArray[P]:
    """Reduces an image by skipping pixels, for ids and values that are not finite."""
    step = max(1, -(-max(pixels.shape[:2]) // most))
    return np.ascontiguousarray(pixels[::step, ::step])
