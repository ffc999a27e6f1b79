# SPDX-License-Identifier: Apache-2.0
"""Reduced images without noise, shown during movements and before the first samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wavecomb.errors import WavecombError
from wavecomb.gui.viewport.frames import Array, Frame

_DARK = np.float32(0.05)
"""Small value added to albedos before a division."""
SCALES = (1, 2, 3, 4, 6, 8, 12)


def reduced_scale(pixels: int, rate: float, overhead: float, limit: float) -> int:
    """Returns the smallest reduction that renders one sample per pixel within a time limit.

    Args:
        pixels: Pixels of the full image.
        rate: Samples per second; 0 if unknown.
        overhead: Constant time of a render, in seconds.
        limit: Time limit in seconds.

    >>> reduced_scale(1_000_000, 2_000_000.0, 0.01, 0.06)
    4
    """
    if rate <= 0.0:
        rate = 300_000.0
    for scale in SCALES:
        if overhead + pixels / scale**2 / rate <= limit:
            return scale
    return SCALES[-1]


class Pace:
    """Time model of reduced images: constant time + pixels / rate, fitted to recent images."""

    def __init__(self) -> None:
        self._sums = np.zeros(5)

    def learn(self, pixels: int, seconds: float) -> None:
        """Adds the measured time of an image, weighted 1.25 times as much as the previous image."""
        self._sums *= 0.8
        self._sums += (1.0, pixels, seconds, pixels * pixels, pixels * seconds)

    def scale(self, pixels: int, limit: float) -> int:
        """Returns the smallest reduction of an image with this expected time in seconds."""
        rate, constant = self._fit()
        return reduced_scale(pixels, rate, constant, limit)

    def _fit(self) -> tuple[float, float]:
        """Returns pixels per second (0 if unknown) and constant seconds, by least squares.

        An assumed empty image with half the mean time and a small weight makes the solution unique.
        The assumed image makes the model optimistic, so that finer images are tried.
        """
        n, x, t, xx, xt = self._sums
        if n == 0.0:
            return 0.0, 0.03
        mean_t, mean_x = t / n, x / n
        n, t = n + 0.1, t + 0.1 * 0.5 * mean_t
        fitted = (n * xt - x * t) / (n * xx - x * x)
        slope = float(np.clip(fitted, 0.1 * mean_t / mean_x, mean_t / mean_x))
        return 1.0 / slope, max(0.0, mean_t - slope * mean_x)


def smooth(frame: Frame, back: NDArray[np.float64]) -> NDArray[np.float32]:
    """Returns the beauty of a reduced image without noise.

    The image is denoised or, without Open Image Denoise, shaded by its first hits.

    Args:
        frame: A reduced frame with guide layers.
        back: Unit vector opposite to the view direction.
    """
    from wavecomb.image.denoise import denoise

    albedo, normal = frame.layers["guide_albedo"], frame.layers["guide_normal"]
    try:
        return denoise(frame.beauty, albedo, normal, threads=frame.setup.threads, fast=True)
    except WavecombError:
        return by_first_hit(frame.beauty, albedo, normal, back)


def by_first_hit(beauty: Array, albedo: Array, normal: Array, back: Array) -> NDArray[np.float32]:
    """Returns an image of the first hits, lit by a headlight of the beauty's mean brightness."""
    lit = np.clip(albedo, 0.0, 1.0) * (0.3 + 0.7 * np.abs(normal @ back))[:, :, None]
    hit = np.linalg.norm(normal, axis=2) > 0.5
    if not hit.any():
        return beauty
    wanted, have = np.clip(beauty[hit], 0.0, 4.0).mean(), lit[hit].mean()
    lit *= wanted / max(have, 1e-6)
    return np.where(hit[:, :, None], lit, beauty).astype(np.float32)


def enlarged(image: Array, width: int, height: int) -> Array:
    """Enlarges an image to (height, width, ...), with bilinear interpolation."""
    out = np.asarray(image, np.float32)
    for axis, size in ((0, height), (1, width)):
        count = out.shape[axis]
        at = np.clip((np.arange(size) + 0.5) * count / size - 0.5, 0.0, count - 1)
        low = at.astype(int)
        weight = (at - low).astype(np.float32).reshape(-1, *(1,) * (out.ndim - axis - 1))
        high = np.minimum(low + 1, count - 1)
        out = out.take(low, axis) * (1.0 - weight) + out.take(high, axis) * weight
    return out


class Filler:
    """Fills frames of the first pass, in which few pixels have samples, without noise.

    The filled pixels have the light of a reduced image and the albedo of first hits at full size.

    Args:
        preview: The reduced image; None leaves frames as they are.
        albedo: (height, width, 3) albedo at full size; None means: enlarge the reduced image.
    """

    def __init__(self, preview: Frame | None, albedo: Array | None = None) -> None:
        self._preview, self._albedo = preview, albedo
        self._whole: Array | None = None

    def fill(self, frame: Frame) -> Frame:
        """Returns the frame, or a frame that looks complete if some pixels have no samples."""
        preview = self._preview
        if preview is None or (frame.is_complete and frame.samples_done):
            return frame
        size = frame.width, frame.height
        if self._whole is None:
            self._whole = enlarged(preview.beauty, *size)
            if self._albedo is not None:
                low = enlarged(preview.layers["guide_albedo"], *size) + _DARK
                # Limit the ratio of the full-size albedo to the preview's albedo, to avoid dots at
                # edges between dark and bright surfaces.
                self._whole *= np.clip((self._albedo + _DARK) / low, 0.4, 2.0)
        holes = frame.layers["samples"][:, :, None] == 0
        keeps = self._albedo is None
        beauty = np.where(holes, self._whole, frame.beauty) if keeps else self._whole
        return replace(frame, beauty=beauty, denoised=beauty if frame.setup.denoise else None)
