# SPDX-License-Identifier: Apache-2.0
"""Pictures of a comparison page: reading, shrinking, and writing them side by side."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from wavecomb.picture.files import replacing

Pixels = NDArray[np.float32]


def read(file: Path) -> Pixels:
    """The colours of a picture as they are in the file, (height, width, 3).

    Raises:
        OSError: It cannot be read.
    """
    image = oiio.ImageBuf(str(file))
    if image.has_error or image.spec().nchannels < 3:
        raise OSError(f"{file}: not a picture of three channels {image.geterror()}".rstrip())
    return np.asarray(image.get_pixels(oiio.FLOAT), np.float32)[..., :3]


def shrunk(image: Pixels, width: int) -> Pixels:
    """An image at a width that divides its own, by means of blocks."""
    n = image.shape[1] // width
    height = image.shape[0] // n
    blocks = image[: height * n, : width * n].reshape(height, n, width, n, 3)
    return np.asarray(blocks.mean((1, 3)))


def linear(encoded: Pixels) -> Pixels:
    """Linear values of sRGB (IEC 61966-2-1) ones."""
    low = encoded <= 0.04045
    return np.where(low, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4).astype(np.float32)


def write_row(
    file: Path, images: Sequence[Pixels], white: float, enlarged: int = 1, columns: int = 0
) -> None:
    """A PNG or JPEG of images side by side; ``white`` is the value that is shown as white.

    They are as many to a row as ``columns`` says, or all; what is left of the last row is black.
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
    """What to show as white, so that a picture is as bright as its reference is."""
    return max(float(np.percentile(reference, 99.5)), 1e-6)
