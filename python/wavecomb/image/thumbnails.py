# SPDX-License-Identifier: Apache-2.0
"""Images for pages and notebooks: thumbnails, contact sheets, wipes, and PNG or JPEG data."""

from __future__ import annotations

import base64
import math
import os
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from wavecomb.errors import WavecombError
from wavecomb.image.files.exr import write_bands
from wavecomb.image.files.image import (
    display,
    linear_from_srgb,
    png_spec,
    read_layers,
    read_metadata,
    srgb_from_linear,
)
from wavecomb.image.layer_view import is_light, show_layer
from wavecomb.image.working_space import to_rec709

if TYPE_CHECKING:
    from wavecomb.image.files.image import Transfer

Kind = Literal["png", "jpeg"]
P = TypeVar("P", bound=np.generic)

_QUALITY = "jpeg:90"


def encode_image(codes: NDArray[np.uint8], kind: Kind = "png") -> bytes:
    """Encodes 8-bit sRGB values (height, width, 3) as a PNG or JPEG file in memory.

    Args:
        codes: 8-bit sRGB values, with row 0 at the top.
        kind: "png" is lossless. "jpeg" has quality 90 without chroma subsampling, and about a tenth
            of the size.
    """
    spec = png_spec(*codes.shape[:2])
    if kind == "jpeg":
        spec.attribute("Compression", _QUALITY)
        spec.attribute("jpeg:subsampling", "4:4:4")
    # Create a temporary file and not a temporary folder, since a sandboxed process may only create
    # files.
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
        pixels: Linear values with shape (height, width, channels).
        most: Largest number of pixels of the longer edge.

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
    """Reduces an image by leaving out pixels, for ids and for values that are not finite."""
    step = max(1, -(-max(pixels.shape[:2]) // most))
    return np.ascontiguousarray(pixels[::step, ::step])


@dataclass(frozen=True)
class DisplayOptions:
    """Options that determine how image files are displayed.

    Attributes:
        layer: Name of the displayed layer; "" means the layer with the file's colours.
        denoised: Whether to show the layer ``denoised`` instead of the beauty, if the file has it.
        exposure: Exposure of radiance layers, in stops.
        tone_map: Tone mapping of radiance layers, "clamp" or "neutral".
    """

    layer: str = ""
    denoised: bool = True
    exposure: float = 0.0
    tone_map: Transfer = "clamp"

    def codes(self, file: str) -> NDArray[np.uint8]:
        """Reads an image file as 8-bit sRGB values (height, width, 3).

        Raises:
            WavecombError: The file does not contain the layer.
            OSError: The file cannot be read.
        """
        layers = read_layers(file)
        is_better = self.denoised and "denoised" in layers
        name = self.layer or ("denoised" if is_better else "beauty")
        if not self.layer and name not in layers and len(layers) == 1:
            name = next(iter(layers))
        if name not in layers:
            raise WavecombError(f"{file}: has no layer {name}; there are {', '.join(layers)}")
        pixels = layers[name]
        if not (self.layer and not is_light(name)) and pixels.shape[2] >= 3:
            space = str(read_metadata(file).get("wavecomb:working_space", "rec709"))
            return self.of_light(to_rec709(pixels[:, :, :3], space))
        # Grey images have only one channel, R or Y.
        if not self.layer:
            return self.of_light(np.repeat(pixels[:, :, :1], 3, axis=2))
        return show_layer(pixels if pixels.shape[2] > 1 else pixels[:, :, 0], name).pixels

    def of_light(self, pixels: NDArray[Any]) -> NDArray[np.uint8]:
        """Converts linear Rec.709 to 8-bit sRGB values."""
        return display(pixels, exposure=self.exposure, tone_map=self.tone_map)


def fit_image(codes: NDArray[np.uint8], width: int, height: int) -> NDArray[np.uint8]:
    """Reduces an image in linear space to fit into a rectangle. A smaller image keeps its size.

    Args:
        codes: 8-bit sRGB (h, w, 3).
        width: Largest width.
        height: Largest height.
    """
    import OpenImageIO as oiio

    high, wide = codes.shape[:2]
    share = min(width / wide, height / high)
    if share >= 1.0:
        return codes
    wide, high = max(1, round(wide * share)), max(1, round(high * share))
    linear = linear_from_srgb(codes.astype(np.float32) / np.float32(255.0))
    source = oiio.ImageBuf(np.ascontiguousarray(linear))
    made = oiio.ImageBufAlgo.resize(
        source, filtername="lanczos3", roi=oiio.ROI(0, wide, 0, high, 0, 1, 0, 3), nthreads=1
    )
    pixels = np.asarray(made.get_pixels(oiio.FLOAT), np.float32).reshape(high, wide, 3)
    encoded = srgb_from_linear(np.clip(pixels, 0.0, 1.0))
    return np.floor(encoded * 255.0 + 0.5).astype(np.uint8)


# ---- Contact sheets and wipes --------------------------------------------------------------------


Codes = NDArray[np.uint8]

MAX_IMAGES = 2000
"""Maximum number of images on a contact sheet."""
_PAPER = 24
_GAP = 12
_TEXT = 13
_LABEL = 20
_SHAPE = 1.6
"""Approximate aspect ratio of a contact sheet if the number of columns is not given."""


def contact_sheet(
    pictures: Mapping[str, str], look: DisplayOptions, *, width: int = 240, columns: int = 0
) -> Codes:
    """Arranges small images in a grid, with the name of each image below it.

    Args:
        pictures: Name -> file.
        look: Display options.
        width: Width of each image in pixels. The highest image determines the height of all rows.
        columns: Number of images per row; 0 chooses a number that makes the sheet clearly wider
            than high.

    Returns:
        8-bit sRGB values with shape (height, width, 3).

    Raises:
        WavecombError: A file does not contain the layer.
        OSError: A file cannot be read.
    """
    names = list(pictures)
    small = [fit_image(look.codes(file), width, 4 * width) for file in pictures.values()]
    high = max(one.shape[0] for one in small)
    columns = min(columns or _columns(len(small), width, high), len(small))
    rows = -(-len(small) // columns)
    cell_w, cell_h = width + _GAP, high + _LABEL + _GAP
    sheet = np.full((rows * cell_h + _GAP, columns * cell_w + _GAP, 3), _PAPER, np.uint8)
    texts: list[tuple[int, int, str]] = []
    for k, (name, picture) in enumerate(zip(names, small, strict=True)):
        x = _GAP + k % columns * cell_w + (width - picture.shape[1]) // 2
        y = _GAP + k // columns * cell_h + (high - picture.shape[0])
        sheet[y : y + picture.shape[0], x : x + picture.shape[1]] = picture
        texts.append((_GAP + k % columns * cell_w, y + picture.shape[0] + _TEXT + 2, name))
    return _written(sheet, texts, width)


def _columns(count: int, width: int, height: int) -> int:
    wanted = math.sqrt(_SHAPE * count * (height + _LABEL + _GAP) / (width + _GAP))
    return max(1, round(wanted))


def wipe(a: Codes, b: Codes, at: float = 0.5, names: tuple[str, str] = ("A", "B")) -> Codes:
    """Shows image A to the left of a vertical line and image B to its right, with their names.

    Args:
        a: Image A as 8-bit sRGB values (height, width, 3).
        b: Image B, with the same size as A.
        at: Position of the line as a fraction of the width; 0 is the left edge.
        names: Names of images A and B.
    """
    width = a.shape[1]
    column = min(max(round(at * width), 0), width)
    made = b.copy()
    made[:, :column] = a[:, :column]
    if 0 < column < width:
        made[:, column - 1 : column + 1] = (255, 255, 255)
    texts = []
    if column > 0:
        texts.append((6, _TEXT + 6, names[0]))
    if column < width:
        texts.append((max(width - _length(names[1]) - 6, column + 6), _TEXT + 6, names[1]))
    return _written(made, texts, width, shadow=True)


def _length(text: str) -> int:
    """Returns the width of a text in pixels."""
    import OpenImageIO as oiio

    return int(oiio.ImageBufAlgo.text_size(text, _TEXT).width)


def _written(
    codes: Codes, texts: Sequence[tuple[int, int, str]], room: int, *, shadow: bool = False
) -> Codes:
    """Draws texts at positions (x, baseline). Removes the beginning of a text that does not fit."""
    import OpenImageIO as oiio

    canvas = oiio.ImageBuf(np.ascontiguousarray(codes))
    edge: dict[str, Any] = {"shadow": 2} if shadow else {}
    for x, y, text in texts:
        while len(text) > 4 and _length(text) > room:
            text = "…" + text[2:]
        oiio.ImageBufAlgo.render_text(canvas, x, y, text, _TEXT, "", (0.9, 0.9, 0.9), **edge)
    return np.asarray(canvas.get_pixels(oiio.UINT8), np.uint8).reshape(codes.shape)
