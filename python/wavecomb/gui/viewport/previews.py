# SPDX-License-Identifier: Apache-2.0
"""Reduced images without noise, shown during movements and before the first samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wavecomb.errors import WavecombError
from wavecomb.gui.viewport.frames import Array, Frame

_DARK = np.float32(0.05)
"""Small value that is added to albedos so that a division by zero cannot occur."""
ALBEDO = "guide_albedo"
"""Layer with the albedo of first hits."""
SCALES = (1, 2, 3, 4, 6, 8, 12)


def reduced_scale(pixels: int, rate: float, overhead: float, limit: float) -> int:
    """Returns the smallest reduction factor with which one sample per pixel fits into a time limit.

    Args:
        pixels: Number of pixels of the full-size image.
        rate: Samples per second; 0 if the rate is unknown.
        overhead: Time of a render that is independent of the sample count, in seconds.
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
    """Model of a reduced image's render time, constant + pixels / rate, fitted to recent images."""

    def __init__(self) -> None:
        self._sums = np.zeros(5)

    def learn(self, pixels: int, seconds: float) -> None:
        """Adds the measured time of an image.

        Each image has 1.25 times the weight of the previous one.
        """
        self._sums *= 0.8
        self._sums += (1.0, pixels, seconds, pixels * pixels, pixels * seconds)

    def scale(self, pixels: int, limit: float) -> int:
        """Returns the smallest reduction factor of an image for a given time in seconds."""
        rate, constant = self._fit()
        return reduced_scale(pixels, rate, constant, limit)

    def _fit(self) -> tuple[float, float]:
        """Returns the fitted pixels per second (0 if unknown) and constant time in seconds.

        To make the solution unique, the least squares fit includes an imaginary image of 0 pixels
        with a small weight and half the mean time. The imaginary image makes the model optimistic,
        so that larger images are tried.
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
    """Returns an estimate of the beauty without noise from a reduced frame.

    If Open Image Denoise is available, the beauty is denoised. Otherwise the first hits are shaded.

    Args:
        frame: A reduced frame with guide layers.
        back: Unit vector opposite to the view direction.
    """
    from wavecomb.image.denoise import denoise

    albedo, normal = frame.layers[ALBEDO], frame.layers["guide_normal"]
    try:
        return denoise(frame.beauty, albedo, normal, threads=frame.setup.threads, fast=True)
    except WavecombError:
        return by_first_hit(frame.beauty, albedo, normal, back)


def by_first_hit(beauty: Array, albedo: Array, normal: Array, back: Array) -> NDArray[np.float32]:
    """Shades the first hits with a light at the camera, scaled to the beauty's mean brightness."""
    lit = np.clip(albedo, 0.0, 1.0) * (0.3 + 0.7 * np.abs(normal @ back))[:, :, None]
    hit = np.linalg.norm(normal, axis=2) > 0.5
    if not hit.any():
        return beauty
    wanted, have = np.clip(beauty[hit], 0.0, 4.0).mean(), lit[hit].mean()
    lit *= wanted / max(have, 1e-6)
    return np.where(hit[:, :, None], lit, beauty).astype(np.float32)


def enlarged(image: Array, width: int, height: int) -> Array:
    """Enlarges an image to (height, width, ...), with bilinear interpolation."""
    small = np.asarray(image, np.float32)
    wide = _stretched(small, 1, width)
    # Rows of the wide image are contiguous, so that the larger step copies whole rows.
    tall = _stretched(wide.reshape(len(small), -1), 0, height)
    return tall.reshape(height, width, *small.shape[2:])


def _stretched(image: Array, axis: int, size: int) -> Array:
    """Interpolates an image linearly along an axis."""
    count = image.shape[axis]
    at = np.clip((np.arange(size) + 0.5) * count / size - 0.5, 0.0, count - 1)
    low = at.astype(int)
    weight = (at - low).astype(np.float32).reshape(-1, *(1,) * (image.ndim - axis - 1))
    out = image.take(low, axis, mode="clip")
    change = image.take(low + 1, axis, mode="clip")
    change -= out
    change *= weight
    out += change
    return out


class Filler:
    """Replaces frames of the first pass, with few samples, by an estimate without noise.

    The estimate is the beauty of a reduced image, adapted to the albedo of first hits at full size.

    Args:
        preview: The reduced image; None means that frames are not replaced.
        albedo: Albedo of first hits at full size, (height, width, 3). None means that the
            reduced image is only enlarged.
    """

    def __init__(self, preview: Frame | None, albedo: Array | None = None) -> None:
        self._preview, self._albedo = preview, albedo
        self._whole: Array | None = None

    def fill(self, frame: Frame) -> Frame:
        """Returns the frame, or a copy that shows the estimate if some pixels have no samples."""
        preview = self._preview
        if preview is None or (frame.is_complete and frame.samples_done):
            return frame
        size = frame.width, frame.height
        if self._whole is None:
            self._whole = enlarged(preview.beauty, *size)
            if self._albedo is not None:
                low = enlarged(preview.layers[ALBEDO], *size)
                low += _DARK
                change = self._albedo + _DARK
                change /= low
                # The limits avoid dots at edges between dark and bright surfaces.
                self._whole *= np.clip(change, 0.4, 2.0, out=change)
        beauty = self._whole
        if self._albedo is None:
            holes = frame.layers["samples"][:, :, None] == 0
            beauty = np.where(holes, self._whole, frame.beauty)
        return replace(frame, beauty=beauty, denoised=beauty if frame.setup.denoise else None)
