# SPDX-License-Identifier: Apache-2.0
"""Images in the report: viewers and difference maps."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.bench.analysis.data import in_order
from wavecomb.bench.figures.forest import difference_figure
from wavecomb.bench.figures.style import CaptionedFigure
from wavecomb.bench.reports.parts import Viewer, key_of
from wavecomb.errors import WavecombError
from wavecomb.image.files.image import display, read_image
from wavecomb.image.thumbnails import data_uri, shrink

if TYPE_CHECKING:
    from wavecomb.bench.analysis.data import Results

MAX_STAGES = 12
MAX_IMAGES = 8
LARGEST = 720
"""Largest width or height of an image in the page, in pixels. Larger images are reduced by
averaging pixels."""


@dataclass(frozen=True)
class RunImage:
    """An image that one or more runs rendered.

    Attributes:
        name: Policies that rendered the image, and settings that distinguish it from other images.
        pixels: Linear colours, (height, width, 3).
    """

    name: str
    pixels: NDArray[Any]


@dataclass(frozen=True)
class Shot:
    """All images of one stage and frame, with the golden image. Titles in a report are distinct."""

    stage: str
    golden: NDArray[Any] | None
    kept: Sequence[RunImage]


def shots(results: Results) -> list[Shot]:
    """Returns the kept images by stage and golden image, with equal images merged.

    Raises:
        WavecombError: An image file is damaged.
    """
    found: dict[str, list[tuple[dict[str, Any], Path]]] = {}
    for record in results.records():
        image, golden = (record.get("job", {}).get(key) for key in ("image", "golden"))
        row = record["row"]
        if image and row.get("status") == "ok" and (results.folder / image).is_file():
            frame = golden or f"{row['stage']} {row['width']}x{row['height']}"
            found.setdefault(frame, []).append((row, results.folder / image))
    made = []
    for frame, pictures in list(found.items())[:MAX_STAGES]:
        golden_file = results.folder / frame
        golden = _read(golden_file) if golden_file.is_file() else None
        first_seed = min(row["seed"] for row, _ in pictures)
        same_seed = [(row, path) for row, path in pictures if row["seed"] == first_seed]
        made.append(Shot(_titled(same_seed[0][0], found.values()), golden, _distinct(same_seed)))
    return made


def _titled(row: dict[str, Any], frames: Iterable[list[tuple[dict[str, Any], Path]]]) -> str:
    """Returns a title: the stage, and renderer and size if there are other images of the stage."""
    others = [frame[0][0] for frame in frames if frame[0][0]["stage"] == row["stage"]]
    parts = [str(row["stage"])]
    if len({other["renderer"] for other in others}) > 1:
        parts.append(str(row["renderer"]))
    if len({(other["width"], other["height"]) for other in others}) > 1:
        parts.append(f"{row['width']} x {row['height']}")
    return ", ".join(parts)


def _distinct(pictures: Sequence[tuple[dict[str, Any], Path]]) -> list[RunImage]:
    kept: list[tuple[NDArray[Any], list[dict[str, Any]]]] = []
    for row, path in pictures:
        pixels = _read(path)
        same = (rows for other, rows in kept if np.array_equal(pixels, other, equal_nan=True))
        rows = next(same, None)
        if rows is None:
            kept.append((pixels, [row]))
        else:
            rows.append(row)
    return [RunImage(_name(rows, pictures), pixels) for pixels, rows in kept[:MAX_IMAGES]]


def _name(rows: Sequence[dict[str, Any]], everything: Sequence[tuple[dict[str, Any], Path]]) -> str:
    """Names an image by its policies.

    The name includes renderer, roulette and sample count if those differ.
    """
    parts = []
    for key in ("renderer", "roulette", "spp"):
        if len({row.get(key) for row, _ in everything}) > 1:
            parts.append(" / ".join(dict.fromkeys(str(row.get(key) or "") for row in rows)))
    policies = in_order("policy", list({row["policy"] for row in rows if row.get("policy")}))
    parts.append(", ".join(policies))
    return ": ".join(part for part in parts if part) or str(rows[0].get("renderer"))


def viewer(shot: Shot) -> Viewer | None:
    """Returns a viewer that compares the images of a stage, or None if there is only one."""
    entries = [(kept.name, kept.pixels) for kept in shot.kept]
    if shot.golden is not None:
        entries.append(("golden (converged)", shot.golden))
    images = [(name, data_uri(display(shrink(pixels, LARGEST)))) for name, pixels in entries]
    return Viewer(shot.stage, images) if len(images) > 1 else None


def differences(shot: Shot) -> CaptionedFigure | None:
    """Draws maps of the differences to the golden image."""
    if shot.golden is None or not shot.kept:
        return None
    pictures = [
        (kept.name if len(kept.name) < 34 else f"{kept.name[:31]}…", kept.pixels)
        for kept in shot.kept
        if kept.pixels.shape == shot.golden.shape
    ]
    if not pictures:
        return None
    name, title = f"difference-{key_of(shot.stage)}", f"{shot.stage}: difference to golden"
    return difference_figure(pictures, shot.golden, name, title)


def _read(path: Path) -> NDArray[Any]:
    """Reads the pixels of a .npy file or an image, (height, width, 3)."""
    try:
        pixels = np.load(path, allow_pickle=False) if path.suffix == ".npy" else read_image(path)
    except (OSError, ValueError) as error:
        raise WavecombError(f"{path}: cannot be read as an image: {error}") from error
    if pixels.ndim != 3 or pixels.shape[2] < 3:
        raise WavecombError(f"{path}: is not a colour image: its shape is {pixels.shape}")
    return np.asarray(pixels[:, :, :3], np.float32)
