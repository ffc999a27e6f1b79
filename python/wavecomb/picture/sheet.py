# SPDX-License-Identifier: Apache-2.0
"""Contact sheets, and two pictures with a line between them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.picture.thumbnails import Look, fitted

Codes = NDArray[np.uint8]

MOST = 2000
"""Pictures of a sheet."""
_PAPER = 24
_GAP = 12
_TEXT = 13
_LABEL = 20
_SHAPE = 1.6
"""Width / height that a sheet is near to where nobody says how many columns."""


def contact_sheet(
    pictures: Mapping[str, str], look: Look, *, width: int = 240, columns: int = 0
) -> Codes:
    """Small pictures side by side, each with its name below.

    Args:
        pictures: Name -> file.
        look: How they are shown.
        width: Of each, pixels; the height is that of the highest.
        columns: How many in a row; 0: so that the sheet is a good deal wider than high.

    Returns:
        8-bit sRGB codes, (height, width, 3).

    Raises:
        WavecombError: A file lacks the layer.
        OSError: A file cannot be read.
    """
    names = list(pictures)
    small = [fitted(look.codes(file), width, 4 * width) for file in pictures.values()]
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
    """A to the left of a line, B to its right, with their names.

    Args:
        a: 8-bit sRGB codes, (height, width, 3).
        b: Of the same size.
        at: Where the line is, from 0 (left) to 1.
        names: Of the two.
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
    """Of a text, in pixels."""
    import OpenImageIO as oiio

    return int(oiio.ImageBufAlgo.text_size(text, _TEXT).width)


def _written(
    codes: Codes, texts: Sequence[tuple[int, int, str]], room: int, *, shadow: bool = False
) -> Codes:
    """With words at places (x, baseline); those that do not fit lose their beginning."""
    import OpenImageIO as oiio

    canvas = oiio.ImageBuf(np.ascontiguousarray(codes))
    edge: dict[str, Any] = {"shadow": 2} if shadow else {}
    for x, y, text in texts:
        while len(text) > 4 and _length(text) > room:
            text = "…" + text[2:]
        oiio.ImageBufAlgo.render_text(canvas, x, y, text, _TEXT, "", (0.9, 0.9, 0.9), **edge)
    return np.asarray(canvas.get_pixels(oiio.UINT8), np.uint8).reshape(codes.shape)
