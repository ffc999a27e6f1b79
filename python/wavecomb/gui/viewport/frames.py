# SPDX-License-Identifier: Apache-2.0
"""A picture as it stands at one moment of a live render."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.gui.setup import Setup
from wavecomb.run.expressions import layer_of

if TYPE_CHECKING:
    from wavecomb._core import Result, Snapshot
    from wavecomb.picture.rendered import Picture

Array = NDArray[Any]
_FIELDS = ("albedo", "normal", "depth", "samples", "error", "variance")


@dataclass(frozen=True)
class Frame:
    """A picture of a live render; arrays are not to be written to.

    Attributes:
        beauty: (height, width, 3), linear Rec.709. Where a pixel has no samples yet, what a reduced
            picture of the same version showed there.
        layers: By name, of ``setup.aovs``: (height, width) or (height, width, channels).
        denoised: (height, width, 3); perhaps of an earlier frame of this version; None: not yet.
        status: samples_done, samples_total, passes, seconds, error ... as ``Snapshot.status``.
        version: Of the scene and the setup; a session shows no frame of an older one.
        scale: 1: full size, 2: half the width and height, ...
        final: The render has ended.
        setup: What it was rendered with.
        picture: What `wavecomb.render` returns; of a final frame at full size only.
    """

    beauty: NDArray[np.float32]
    layers: Mapping[str, Array]
    denoised: NDArray[np.float32] | None
    status: Mapping[str, Any]
    version: int
    scale: int
    final: bool
    setup: Setup
    picture: Picture | None = field(default=None, repr=False)

    @property
    def width(self) -> int:
        """Pixels of a row."""
        return int(self.beauty.shape[1])

    @property
    def height(self) -> int:
        """Rows of pixels."""
        return int(self.beauty.shape[0])

    def names(self) -> list[str]:
        """Layers that can be shown, the beauty first."""
        shown = ["beauty", *(["denoised"] if self.denoised is not None else [])]
        return [*shown, *(name for name in self.layers if name not in shown)]

    def layer(self, name: str) -> Array | None:
        """A layer by name, beauty and denoised, too; None where there is none."""
        if name == "beauty":
            return self.beauty
        if name == "denoised":
            return self.denoised
        return self.layers.get(name)

    def pixel(self, x: int, y: int) -> tuple[int, int]:
        """Column and row in the arrays of a pixel of the full-size picture."""
        column = min(max(x * self.width // self.setup.width, 0), self.width - 1)
        return column, min(max(y * self.height // self.setup.height, 0), self.height - 1)


def layers_of_result(result: Result) -> dict[str, Array]:
    """All layers of a result but the beauty."""
    named = {name: getattr(result, name) for name in _FIELDS}
    return {name: array for name, array in {**named, **result.aovs}.items() if array is not None}


def layers_of_snapshot(snapshot: Snapshot, names: tuple[str, ...]) -> dict[str, Array]:
    """Copies of the layers of a snapshot that are kept and asked for."""
    out: dict[str, Array] = {"samples": snapshot.samples()}
    for name in map(layer_of, names):
        if name not in ("beauty", "samples") and (array := snapshot.layer(name)) is not None:
            out[name] = array
    return out


def enlarged(image: Array, width: int, height: int) -> Array:
    """Nearest pixels of a smaller picture, (height, width, ...)."""
    rows = np.arange(height) * image.shape[0] // height
    columns = np.arange(width) * image.shape[1] // width
    return image[rows[:, None], columns[None, :]]


# ---- A frame without its noise. No Qt ------------------------------------------------------------


def denoised_frame(frame: Frame) -> tuple[Frame, Any]:
    """A frame and its beauty by Open Image Denoise; None where it lacks the layers for that."""
    from wavecomb.picture.denoise import denoise

    albedo = frame.layers.get("guide_albedo")
    normal = frame.layers.get("guide_normal")
    if albedo is None or normal is None:
        return frame, None
    return frame, denoise(frame.beauty, albedo, normal, threads=frame.setup.threads)
