# SPDX-License-Identifier: Apache-2.0
"""Images of comparison pages: reading, shrinking, and writing them side by side."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from wavecomb.image.files.output_file import replacing

Pixels = NDArray[np.float32]


def read(file: Path) -> Pixels:
    """Colours of an image as stored in the file, (height, width, 3).

    Raises:
        OSError: The file cannot be read.
    """
    image = oiio.ImageBuf(str(file))
    if image.has_error or image.spec().nchannels < 3:
        raise OSError(f"{file}: not an image of three channels {image.geterror()}".rstrip())
    return np.asarray(image.get_pixels(oiio.FLOAT), np.float32)[..., :3]


def shrunk(image: Pixels, width: int) -> Pixels:
    """Shrink an image by averaging blocks; its width must be a multiple of the new width."""
    n = image.shape[1] // width
    height = image.shape[0] // n
    blocks = image[: height * n, : width * n].reshape(height, n, width, n, 3)
    return np.asarray(blocks.mean((1, 3)))


def linear(encoded: Pixels) -> Pixels:
    """Convert sRGB values (IEC 61966-2-1) to linear."""
    low = encoded <= 0.04045
    return np.where(low, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4).astype(np.float32)


def write_row(
    file: Path, images: Sequence[Pixels], white: float, enlarged: int = 1, columns: int = 0
) -> None:
    """Write images side by side as PNG or JPEG; ``white`` is the value shown as white.

    ``columns`` is the number of images per row, by default all. Empty cells of the last row are
    black.
    """
    columns = columns or len(images)
    black = np.zeros_like(images[0])
    shown = [*images, *[black] * (-len(images) % columns)]
    rows = [shown[i : i + columns] for i in range(0, len(shown), columns)]
    sheet = np.concatenate([np.concatenate(row, axis=1) for row in rows], axis=0)
    sheet = sheet.repeat(enlarged, axis=0).repeat(enlarged, axis=1)
    values = np.clip(sheet / max(white, 1e-6), 0, 1) ** (1 / 2.2)
    pixels = np.ascontiguousarray(255 * values + 0.5, np.uint8)
    out = oiio.ImageBuf(oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, "uint8"))
    out.set_pixels(oiio.ROI(), pixels)
    kind = "jpeg" if file.suffix == ".jpg" else "png"
    if kind == "jpeg":
        out.specmod()["compression"] = "jpeg:88"
    with replacing(file) as part:
        out.write(str(part), "uint8", kind)


def white_of(reference: Pixels) -> float:
    """Return the radiance that pages show as white in an image and its reference."""
    return max(float(np.percentile(reference, 99.5)), 1e-6)
