# SPDX-License-Identifier: Apache-2.0
"""Divides images into tiles. All samples of a pixel belong to one tile.

This module also rejects settings that a farm cannot render or cannot divide into tiles.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

from wavecomb.errors import WavecombError

Rectangle = tuple[int, int, int, int]
"""Rectangle (x0, y0, x1, y1) in pixels of the whole image, which excludes column x1 and row y1."""

MAX_TILES = 9999
"""Largest number of columns or rows of an image."""
MIN_EDGE = 64
"""Smallest edge of tiles that ``choose_tiles`` chooses, in pixels."""
TILES_OF_A_WORKER = 4
"""Number of tiles of an image for each worker, so that workers end at about the same time."""
_CHECK_SAMPLES = 16
"""Samples per pixel between two error checks of the core (render/passes/pass_plan.cpp)."""
_REACH = 4
"""Distance in pixels over which one error check has an effect. The distance is 2 for the mean of
errors over neighbouring pixels, plus 2 because unfinished pixels mark their neighbours as
unfinished."""
_MIN_PILOT_SAMPLES = 2_000_000
"""Number of samples of an image from which pilot renders may decide (kMinAutoSamples in
render/pilots/guiding_training.cpp)."""
_WINDOW = 2
"""Radius in pixels of the mean over neighbours that the ``error`` layer holds."""


def tiles_of(region: Rectangle, tiles: tuple[int, int]) -> list[Rectangle]:
    """Divides a region into columns and rows of almost equal size; returns the tiles row by row.

    >>> tiles_of((0, 0, 10, 4), (3, 1))
    [(0, 0, 3, 4), (3, 0, 6, 4), (6, 0, 10, 4)]
    """
    x0, y0, x1, y1 = region
    columns, rows = min(tiles[0], x1 - x0), min(tiles[1], y1 - y0)
    xs = [x0 + (x1 - x0) * i // columns for i in range(columns + 1)]
    ys = [y0 + (y1 - y0) * i // rows for i in range(rows + 1)]
    return [(xs[i], ys[k], xs[i + 1], ys[k + 1]) for k in range(rows) for i in range(columns)]


def parse_tiles(text: str) -> tuple[int, int] | None:
    """Parses columns and rows such as "4x3"; returns None for "auto".

    Raises:
        WavecombError: The text is neither columns and rows nor "auto".
    """
    if text == "auto":
        return None
    match = re.fullmatch(r"(\d{1,4})x(\d{1,4})", text)
    if match is None or not (int(match[1]) and int(match[2])):
        raise WavecombError(f"--tiles {text}: must be auto, or columns x rows such as 4x3")
    return int(match[1]), int(match[2])


def parse_tile(text: str) -> tuple[int, int]:
    """Parses a tile such as "3/8", the third of eight; returns its index from 0 and the count.

    >>> parse_tile("3/8")
    (2, 8)

    Raises:
        WavecombError: The text is not a tile and a count.
    """
    match = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text)
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise WavecombError(f"--tile {text}: must be I/N, tile I of N, from 1/N to N/N")
    return int(match[1]) - 1, int(match[2])


def layout(count: int, region: Rectangle) -> tuple[int, int]:
    """Returns columns and rows of exactly ``count`` tiles that are as square as possible.

    >>> layout(8, (0, 0, 1920, 1080))
    (4, 2)

    Raises:
        WavecombError: The region has too few pixels for that many tiles.
    """
    width, height = region[2] - region[0], region[3] - region[1]
    fits = [
        (n, count // n)
        for n in range(1, count + 1)
        if count % n == 0 and n <= min(width, MAX_TILES) and count // n <= min(height, MAX_TILES)
    ]
    if not fits:
        raise WavecombError(
            f"--tile: {count} tiles do not fit into {width} x {height} pixels; give fewer"
        )
    return min(fits, key=lambda one: abs(math.log((width * one[1]) / (height * one[0]))))


def choose_tiles(
    regions: list[Rectangle], pictures: int, workers: int, whole: bool
) -> tuple[int, int]:
    """Returns columns and rows for ``--tiles auto``.

    Images stay whole if there are at least two images for each worker.

    Args:
        regions: Regions of the images, one for each distinct size.
        pictures: Number of images.
        workers: Expected number of workers.
        whole: Whether images should stay whole, because each tile would need a wide border or would
            train a guiding field.
    """
    if workers < 2 or whole or pictures >= 2 * workers:
        return 1, 1
    width = min(x1 - x0 for x0, _, x1, _ in regions)
    height = min(y1 - y0 for _, y0, _, y1 in regions)
    wanted = TILES_OF_A_WORKER * workers
    columns = max(1, min(width // MIN_EDGE, round((wanted * width / height) ** 0.5)))
    rows = max(1, min(height // MIN_EDGE, -(-wanted // columns)))
    return columns, rows


def error_checks(settings: Mapping[str, Any]) -> int:
    """Returns how many error checks an adaptive render makes before it has taken all samples.

    >>> error_checks({"spp": 64, "min_spp": 16})
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


def max_error_checks(settings: Mapping[str, Any]) -> int:
    """Returns the number of error checks that the border of an adaptive tile allows for.

    The number is 4 more than ``error_checks``, because pixels whose sampling stops and later
    resumes need further checks.
    """
    return error_checks(settings) + 4


def border(settings: Mapping[str, Any], count: int) -> int:
    """Returns the width, in pixels, of the border to render around a tile.

    An error check of a pixel depends on pixels up to 4 pixels away. With a border of 4 pixels for
    each of ``count`` checks, pixels beyond the border cannot affect an adaptive tile. The layer
    ``error`` needs 2 more pixels for its mean over neighbours. Renders that are neither adaptive
    nor have this layer need no border.
    """
    if settings.get("adaptive"):
        return _REACH * count + _WINDOW
    return _WINDOW if settings.get("error") else 0


def grown(tile: Rectangle, border: int, region: Rectangle) -> Rectangle:
    """Returns a tile extended by a border, clipped to the region."""
    x0, y0, x1, y1 = tile
    return (
        max(region[0], x0 - border), max(region[1], y0 - border),
        min(region[2], x1 + border), min(region[3], y1 + border),
    )  # fmt: skip


def check_reproducible(settings: Mapping[str, Any]) -> None:
    """Raises WavecombError for settings whose renders are not reproducible."""
    if settings.get("time_limit"):
        raise WavecombError(
            "--time-limit: the sample count would depend on the machine, so a farm's images would "
            "differ from those of one machine: give --spp, --adaptive or --noise"
        )
    if settings.get("costs") == "measured" and _costs_matter(settings):
        raise WavecombError(
            "--costs measured: the image would depend on times of one machine, and a farm has "
            "several: give --costs model"
        )


def _costs_matter(settings: Mapping[str, Any]) -> bool:
    return settings.get("roulette") == "cost-aware" or settings.get("allocate") == "efficiency"


def needs_whole(settings: Mapping[str, Any]) -> str:
    """Returns why images cannot be divided into tiles, or "" if they can."""
    if settings.get("noise"):
        return f"--noise {settings['noise']:g}: applies to the whole image"
    if settings.get("allocate", "even") != "even":
        return f"--allocate {settings['allocate']}: distributes samples over the whole image"
    if settings.get("firefly", "keep") != "keep":
        return f"--firefly {settings['firefly']}: depends on neighbouring pixels"
    return ""


def is_better_whole(settings: Mapping[str, Any]) -> bool:
    """Returns whether tiles add so much work that images should stay whole.

    Adaptive tiles need borders, and each tile of a render with light paths traces all light paths.
    """
    return bool(settings.get("adaptive")) or settings.get("transport") in ("light", "bdpt")


def has_pilots(settings: Mapping[str, Any]) -> bool:
    """Returns whether renders with these settings may begin with pilot renders or training.

    >>> has_pilots({"guiding": "on"})
    True
    """
    if settings.get("guiding") == "on" or settings.get("roulette") == "efficient":
        return True
    samples = math.prod(int(settings.get(name, 0)) for name in ("width", "height", "spp"))
    is_open = "auto" in (settings.get("guiding"), settings.get("transport"))
    return is_open and settings.get("quality") == "auto" and samples >= _MIN_PILOT_SAMPLES


def check_tiles(settings: Mapping[str, Any], tiles: tuple[int, int]) -> None:
    """Raises WavecombError if images cannot be divided into these tiles."""
    why = needs_whole(settings)
    if why and tiles != (1, 1):
        raise WavecombError(f"{why}, which a tile lacks: give --tiles 1x1")
