# SPDX-License-Identifier: Apache-2.0
"""Cuts images into tiles: pixels, never samples. Refuses what a farm cannot render or cut."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

from wavecomb.errors import WavecombError

Rectangle = tuple[int, int, int, int]
"""x0, y0, x1, y1 in pixels of the whole picture, the end excluded."""

MOST_TILES = 9999
"""Columns or rows of an image."""
LEAST_EDGE = 64
"""Pixels of the edges of tiles that ``choose_tiles`` chooses."""
TILES_OF_A_WORKER = 4
"""Tiles of an image for each worker, so that workers end at about the same time."""
_CHECK_SAMPLES = 16
"""Samples between two looks of the core at errors (render/passes/pass_plan.cpp)."""
_REACH = 4
"""Pixels that one look at errors reaches: a mean over two to each side, and marks that spread by
two more."""
_WINDOW = 2
"""Pixels to each side over which the layer of errors is a mean."""


def tiles_of(region: Rectangle, tiles: tuple[int, int]) -> list[Rectangle]:
    """A region cut into columns and rows, row by row; as even as whole pixels are.

    >>> tiles_of((0, 0, 10, 4), (3, 1))
    [(0, 0, 3, 4), (3, 0, 6, 4), (6, 0, 10, 4)]
    """
    x0, y0, x1, y1 = region
    columns, rows = min(tiles[0], x1 - x0), min(tiles[1], y1 - y0)
    xs = [x0 + (x1 - x0) * i // columns for i in range(columns + 1)]
    ys = [y0 + (y1 - y0) * i // rows for i in range(rows + 1)]
    return [(xs[i], ys[k], xs[i + 1], ys[k + 1]) for k in range(rows) for i in range(columns)]


def parse_tiles(text: str) -> tuple[int, int] | None:
    """Columns and rows of "4x3"; None for "auto".

    Raises:
        WavecombError: It is neither.
    """
    if text == "auto":
        return None
    match = re.fullmatch(r"(\d{1,4})x(\d{1,4})", text)
    if match is None or not (int(match[1]) and int(match[2])):
        raise WavecombError(f"--tiles {text}: must be auto, or columns x rows such as 4x3")
    return int(match[1]), int(match[2])


def parse_tile(text: str) -> tuple[int, int]:
    """Index from 0 and count of "3/8", the third of eight tiles.

    >>> parse_tile("3/8")
    (2, 8)

    Raises:
        WavecombError: It is no such pair.
    """
    match = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text)
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise WavecombError(f"--tile {text}: must be I/N, tile I of N, from 1/N to N/N")
    return int(match[1]) - 1, int(match[2])


def layout(count: int, region: Rectangle) -> tuple[int, int]:
    """Columns and rows of exactly ``count`` tiles, as near to squares as whole numbers allow.

    >>> layout(8, (0, 0, 1920, 1080))
    (4, 2)

    Raises:
        WavecombError: The region has too few pixels for them.
    """
    width, height = region[2] - region[0], region[3] - region[1]
    fits = [
        (n, count // n)
        for n in range(1, count + 1)
        if count % n == 0 and n <= min(width, MOST_TILES) and count // n <= min(height, MOST_TILES)
    ]
    if not fits:
        raise WavecombError(
            f"--tile: {count} tiles do not fit into {width} x {height} pixels; give fewer"
        )
    return min(fits, key=lambda one: abs(math.log((width * one[1]) / (height * one[0]))))


def choose_tiles(
    regions: list[Rectangle], pictures: int, workers: int, whole: bool
) -> tuple[int, int]:
    """Columns and rows for ``--tiles auto``: whole images where there are two for each worker.

    Args:
        regions: Of the images, each size once.
        pictures: How many images there are.
        workers: How many are expected.
        whole: Whether tiles cost more than they gain: each would need a wide border, or would
            learn a guiding field.
    """
    if workers < 2 or whole or pictures >= 2 * workers:
        return 1, 1
    width = min(x1 - x0 for x0, _, x1, _ in regions)
    height = min(y1 - y0 for _, y0, _, y1 in regions)
    wanted = TILES_OF_A_WORKER * workers
    columns = max(1, min(width // LEAST_EDGE, round((wanted * width / height) ** 0.5)))
    rows = max(1, min(height // LEAST_EDGE, -(-wanted // columns)))
    return columns, rows


def looks(settings: Mapping[str, Any]) -> int:
    """How often an adaptive render looks at errors before its pixels have all samples.

    >>> looks({"spp": 64, "min_spp": 16})
    3
    """
    spp = int(settings["spp"])
    done = max(_CHECK_SAMPLES, -(-int(settings["min_spp"]) // _CHECK_SAMPLES) * _CHECK_SAMPLES)
    count = 0
    while done < spp:
        count += 1
        step = max(_CHECK_SAMPLES, (1 << (done.bit_length() - 1)) // 4)
        done = (done // step + 1) * step
    return count


def most_looks(settings: Mapping[str, Any]) -> int:
    """Looks that the border of an adaptive tile allows for.

    Four more than there are before the last samples: pixels that go on late take further ones.
    """
    return looks(settings) + 4


def border(settings: Mapping[str, Any], count: int) -> int:
    """Pixels that are rendered around an adaptive tile, so that ``count`` looks see the picture.

    What a look at errors decides of a pixel depends on pixels up to 4 away, so what is beyond a
    border of 4 pixels for each look cannot have reached the tile; the layer of errors is a mean
    over two pixels more. Renders without errors need none.
    """
    if settings.get("adaptive"):
        return _REACH * count + _WINDOW
    return _WINDOW if settings.get("error") else 0


def grown(tile: Rectangle, border: int, region: Rectangle) -> Rectangle:
    """A tile with a border, as far as there is a picture."""
    x0, y0, x1, y1 = tile
    return (
        max(region[0], x0 - border), max(region[1], y0 - border),
        min(region[2], x1 + border), min(region[3], y1 + border),
    )  # fmt: skip


def check_reproducible(settings: Mapping[str, Any]) -> None:
    """Raises WavecombError for settings whose pictures are never the same twice."""
    if settings.get("time_limit"):
        raise WavecombError(
            "--time-limit: how many samples fit depends on the machine, so a farm's pictures would "
            "differ from one machine's: give --spp, --adaptive or --noise"
        )
    if settings.get("costs") == "measured" and _costs_matter(settings):
        raise WavecombError(
            "--costs measured: times of one machine decide over the picture here, and a farm has "
            "several: give --costs model"
        )


def _costs_matter(settings: Mapping[str, Any]) -> bool:
    return settings.get("roulette") == "cost-aware" or settings.get("allocate") == "efficiency"


def needs_whole(settings: Mapping[str, Any]) -> str:
    """Why pictures cannot be cut into tiles; empty: they can."""
    if settings.get("noise"):
        return f"--noise {settings['noise']:g}: is of the whole picture"
    if settings.get("allocate", "even") != "even":
        return f"--allocate {settings['allocate']}: shares samples out over the whole picture"
    if settings.get("firefly", "keep") != "keep":
        return f"--firefly {settings['firefly']}: looks at the pixels around each"
    return ""


def is_better_whole(settings: Mapping[str, Any], is_taught: bool = False) -> bool:
    """Whether each tile costs much beside its own pixels: a border, a field, all light paths.

    ``is_taught``: the field is given.
    """
    learns = settings.get("guiding", "off") != "off" or settings.get("roulette") == "efficient"
    return (
        bool(settings.get("adaptive"))
        or settings.get("transport") in ("light", "bdpt", "auto")
        or (learns and not is_taught)
    )


def check_tiles(settings: Mapping[str, Any], tiles: tuple[int, int]) -> None:
    """Raises WavecombError where pictures cannot be cut so."""
    why = needs_whole(settings)
    if why and tiles != (1, 1):
        raise WavecombError(f"{why}, which tiles do not see: give --tiles 1x1")
