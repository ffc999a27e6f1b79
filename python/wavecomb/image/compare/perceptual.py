# SPDX-License-Identifier: Apache-2.0
"""Perceptual metrics that compare two images: PSNR, SSIM and FLIP.

SSIM and FLIP need the optional packages of the extra "bench". The metrics treat values that are not
finite as 0. ``compare`` reports the number of such values.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from wavecomb.extras import needed
from wavecomb.image.compare.comparison import colour_pair
from wavecomb.image.files.image import srgb_from_linear
from wavecomb.image.working_space import LUMINANCE

if TYPE_CHECKING:
    from wavecomb.image.compare.comparison import Source

Metric = Literal["psnr", "ssim", "flip-ldr", "flip-hdr"]
METRICS: tuple[Metric, ...] = get_args(Metric)

_SSIM_SIGMA = 1.5
_SSIM_RADIUS = 5


def measure(metric: Metric, a: Source, b: Source, exposure: float = 0.0) -> float:
    """Returns one metric for image A against the reference B, averaged over the image."""
    if metric == "psnr":
        return psnr(a, b, exposure)
    if metric == "ssim":
        return ssim(a, b, exposure)
    return float(flip(a, b, high_range=metric == "flip-hdr", exposure=exposure).mean(dtype=float))


def psnr(a: Source, b: Source, exposure: float = 0.0) -> float:
    """Returns the peak signal-to-noise ratio of displayed images in dB, -10 log10(mean (A - B)^2).

    The values are sRGB encoded in [0, 1] without rounding. The result is infinite for equal images.

    Raises:
        ValueError: The sizes differ.
    """
    x, y = (shown(p, exposure).astype(np.float64) for p in colour_pair(a, b))
    error = float(np.mean((x - y) ** 2))
    return -10.0 * math.log10(error) if error > 0.0 else math.inf


def ssim(a: Source, b: Source, exposure: float = 0.0) -> float:
    """Returns the mean structural similarity of the displayed images, in [-1, 1]; 1 means equal.

    SSIM = (2 m_a m_b + C1) (2 s_ab + C2) / ((m_a^2 + m_b^2 + C1) (s_a^2 + s_b^2 + C2)), C1 =
    0.01^2, C2 = 0.03^2, with means m and (co)variances s under a Gaussian window of 11 x 11 pixels,
    sigma 1.5 (Wang et al., "Image quality assessment: from error visibility to structural
    similarity", 2004, equation 13 and section III.C). SSIM is computed on the Rec.709 luma of the
    image times 2^exposure, clamped to [0, 1] and sRGB encoded. The mean is over windows that are
    completely inside the image.

    Raises:
        ValueError: A side is shorter than 11 pixels, or the sizes differ.
    """
    ndimage = needed("scipy.ndimage", "SSIM")
    pixels_a, pixels_b = colour_pair(a, b)
    if min(pixels_a.shape[:2]) < 2 * _SSIM_RADIUS + 1:
        raise ValueError("SSIM needs images of at least 11 x 11 pixels")
    x, y = (shown(p, exposure).astype(np.float64) @ LUMINANCE for p in (pixels_a, pixels_b))

    def window(values: NDArray[np.float64]) -> NDArray[np.float64]:
        blurred: NDArray[np.float64] = ndimage.gaussian_filter(
            values, _SSIM_SIGMA, radius=_SSIM_RADIUS
        )
        inside = slice(_SSIM_RADIUS, -_SSIM_RADIUS)
        return blurred[inside, inside]

    mean_x, mean_y = window(x), window(y)
    var_x, var_y = window(x * x) - mean_x**2, window(y * y) - mean_y**2
    covariance = window(x * y) - mean_x * mean_y
    c1, c2 = 0.01**2, 0.03**2
    similarity = (2 * mean_x * mean_y + c1) * (2 * covariance + c2)
    similarity /= (mean_x**2 + mean_y**2 + c1) * (var_x + var_y + c2)
    return float(similarity.mean())


def flip(
    a: Source, b: Source, *, high_range: bool = False, exposure: float = 0.0
) -> NDArray[np.float32]:
    """Returns the FLIP value of each pixel (height, width), from 0 (equal appearance) to 1.

    By default, computes LDR-FLIP of the displayed images (Andersson et al., "FLIP: a difference
    evaluator for alternating images", 2020). With ``high_range``, computes HDR-FLIP (Andersson et
    al. 2021), the maximum over several exposures with the ACES tone curve. The exposures are
    derived from the reference B, and ``exposure`` is ignored. The assumed display is 4K, 0.7 m wide
    and viewed from 0.7 m, which means 67 pixels per degree.

    Raises:
        ValueError: The sizes differ, or the reference image for HDR-FLIP is black.
    """
    evaluator = needed("flip_evaluator", "FLIP")
    pair = colour_pair(a, b)
    if high_range:
        kept = [np.clip(_colours(p), 0.0, 65504.0) for p in pair]
    else:
        kept = [shown(p, exposure) for p in pair]
    test, reference = (np.ascontiguousarray(p, np.float32) for p in kept)
    if np.array_equal(test, reference):
        return np.zeros(test.shape[:2], np.float32)
    # For a black reference, the FLIP library would terminate the process.
    if high_range and not reference.any():
        raise ValueError("HDR-FLIP takes its exposures from the reference, which is black")
    values, _, _ = evaluator.evaluate(
        reference,
        test,
        "HDR" if high_range else "LDR",
        inputsRGB=not high_range,
        applyMagma=False,
        computeMeanError=False,
    )
    return np.asarray(values, np.float32)[:, :, 0]


def shown(pixels: NDArray[Any], exposure: float = 0.0) -> NDArray[np.float32]:
    """Returns displayed sRGB values (height, width, 3) in [0, 1], without rounding."""
    scaled = np.clip(_colours(pixels) * np.float32(2.0**exposure), 0.0, 1.0)
    return srgb_from_linear(scaled)


def _colours(pixels: NDArray[Any]) -> NDArray[np.float32]:
    """Returns three channels. If there are fewer, repeats the first channel.

    Replaces values that are not finite by 0.
    """
    colours = pixels[:, :, :3] if pixels.shape[2] >= 3 else pixels[:, :, :1].repeat(3, axis=2)
    return np.where(np.isfinite(colours), colours, np.float32(0)).astype(np.float32)
