# SPDX-License-Identifier: Apache-2.0
"""Frames: the images of a live render at one time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.gui.setup import Setup, scaled_region
from wavecomb.run.expressions import layer_of

if TYPE_CHECKING:
    from wavecomb._core import Result, Snapshot
    from wavecomb.image.rendered import Picture

Array = NDArray[Any]
_FIELDS = ("albedo", "normal", "depth", "samples", "error", "variance")


@dataclass(frozen=True)
class Frame:
    """An image of a live render. The arrays of a frame must not be modified.

    Attributes:
        beauty: Linear Rec.709 colours with shape (height, width, 3). Reduced images, and frames in
            which some pixels have no samples yet, show an estimate without noise.
        layers: The layers in ``setup.aovs`` by name, with shape (height, width) or (height, width,
            channels).
        denoised: Denoised beauty with shape (height, width, 3), possibly from an earlier frame of
            this version. None if there is none.
        status: Progress values such as ``samples_done``, ``samples_total``, ``passes``, ``seconds``
            and ``error``, as in ``Snapshot.status``.
        version: Version of the scene and the setup that the frame shows. After a frame, a session
            never shows a frame of an older version.
        scale: Number by which width and height are divided; 1 means full size.
        final: Whether the render has ended.
        setup: Settings of the render.
        picture: Result of the render, as ``wavecomb.render`` returns it, for final frames at full
            size; otherwise None.
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
        """Width in pixels."""
        return int(self.beauty.shape[1])

    @property
    def height(self) -> int:
        """Height in pixels."""
        return int(self.beauty.shape[0])

    @property
    def samples_done(self) -> int:
        """Sum of the sample counts of all pixels."""
        return int(self.status.get("samples_done", 0))

    @property
    def is_complete(self) -> bool:
        """Whether every pixel in the render region has at least one sample."""
        samples = self.layers["samples"]
        if self.setup.region is not None:
            x0, y0, x1, y1 = scaled_region(
                self.setup.region, self.scale, self.setup.width, self.setup.height
            )
            samples = samples[y0:y1, x0:x1]
        return bool(samples.all())

    def names(self) -> list[str]:
        """Returns the names of the layers that can be shown. The beauty comes first."""
        shown = ["beauty", *(["denoised"] if self.denoised is not None else [])]
        return [*shown, *(name for name in self.layers if name not in shown)]

    def layer(self, name: str) -> Array | None:
        """Returns the layer with a name, which may be "beauty" or "denoised", or None."""
        if name == "beauty":
            return self.beauty
        if name == "denoised":
            return self.denoised
        return self.layers.get(name)

    def pixel(self, x: int, y: int) -> tuple[int, int]:
        """Returns the column and row in the frame's arrays for a pixel of the full-size image."""
        column = min(max(x * self.width // self.setup.width, 0), self.width - 1)
        return column, min(max(y * self.height // self.setup.height, 0), self.height - 1)


def layers_of_result(result: Result) -> dict[str, Array]:
    """Returns all layers of a render result by name, except the beauty."""
    named = {name: getattr(result, name) for name in _FIELDS}
    return {name: array for name, array in {**named, **result.aovs}.items() if array is not None}


def layers_of_snapshot(snapshot: Snapshot, names: tuple[str, ...]) -> dict[str, Array]:
    """Returns copies of those requested layers that a snapshot contains."""
    out: dict[str, Array] = {"samples": snapshot.samples()}
    for name in map(layer_of, names):
        if name not in ("beauty", "samples") and (array := snapshot.layer(name)) is not None:
            out[name] = array
    return out


# ---- Denoising of frames. Independent of Qt
# ---------------------------------------------------------


def denoised_frame(frame: Frame) -> tuple[Frame, Any]:
    """Denoises a frame with Open Image Denoise. Uses a faster mode while the render is running.

    The returned image is None if guide layers are missing.
    """
    from wavecomb.image.denoise import denoise

    albedo = frame.layers.get("guide_albedo")
    normal = frame.layers.get("guide_normal")
    if albedo is None or normal is None:
        return frame, None
    threads, fast = frame.setup.threads, not frame.final
    return frame, denoise(frame.beauty, albedo, normal, threads=threads, fast=fast)
