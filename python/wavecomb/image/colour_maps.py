# SPDX-License-Identifier: Apache-2.0
"""Perceptually uniform colour maps that are suitable for people with colour deficiencies."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

_HUE_BELOW, _HUE_ABOVE = 255.0, 70.0


def colour_map(count: int = 256) -> NDArray[np.float32]:
    """Returns a map from dark violet over red to light yellow (count, 3), in linear Rec.709.

    OKLab lightness (Ottosson 2020) rises linearly, so that steps look uniform; the hue turns from
    violet to yellow; chroma is the largest in the gamut, up to 0.2.
    """
    t = np.linspace(0.0, 1.0, count)
    return _largest_chroma(0.2 + 0.76 * t, np.radians(300.0 + 170.0 * t), 0.2)


def signed_colour_map(count: int = 257) -> NDArray[np.float32]:
    """Returns a map from light blue over black to light orange (count, 3), in linear Rec.709.

    Lightness rises linearly from the middle, which is black, to both ends. Blue and orange are
    distinguishable with all common colour deficiencies.
    """
    t = np.linspace(-1.0, 1.0, count)
    hue = np.radians(np.where(t < 0.0, _HUE_BELOW, _HUE_ABOVE))
    return _largest_chroma(0.9 * np.abs(t), hue, 0.16)


def _largest_chroma(
    lightness: NDArray[np.float64], hue: NDArray[np.float64], most: float
) -> NDArray[np.float32]:
    """Returns colours with the largest chroma inside the gamut, found by bisection."""
    low, high = np.zeros_like(lightness), np.full_like(lightness, most)
    for _ in range(20):
        chroma = 0.5 * (low + high)
        rgb = _linear_from_oklab(lightness, chroma * np.cos(hue), chroma * np.sin(hue))
        inside = ((rgb >= 0.0) & (rgb <= 1.0)).all(axis=1)
        low, high = np.where(inside, chroma, low), np.where(inside, high, chroma)
    rgb = _linear_from_oklab(lightness, low * np.cos(hue), low * np.sin(hue))
    return np.clip(rgb, 0.0, 1.0).astype(np.float32)


def _linear_from_oklab(
    lightness: NDArray[Any], a: NDArray[Any], b: NDArray[Any]
) -> NDArray[np.float64]:
    """Converts OKLab to linear Rec.709 (n, 3): https://bottosson.github.io/posts/oklab/."""
    long = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3
    medium = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3
    short = (lightness - 0.0894841775 * a - 1.2914855480 * b) ** 3
    to_rgb = np.array(
        [
            [4.0767416621, -3.3077115913, 0.2309699292],
            [-1.2684380046, 2.6097574011, -0.3413193965],
            [-0.0041960863, -0.7034186147, 1.7076147010],
        ]
    )
    return np.stack([long, medium, short], axis=1) @ to_rgb.T
