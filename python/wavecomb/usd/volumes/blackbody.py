# SPDX-License-Identifier: Apache-2.0
"""Temperatures as the light that black bodies give."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.usd.lights.light import blackbody

STEFAN_BOLTZMANN = 5.670374e-8
"""W m^-2 K^-4."""

_HOTTEST = 1e5
_FIRST, _LAST, _COUNT = 1000.0, 15000.0, 512


def radiance(kelvin: NDArray[Any]) -> NDArray[np.float32]:
    """Linear Rec.709 (..., 3): the colour of the black body, of luminance sigma T^4 / pi in MW.

    That is Cycles' unit, 1 at 2729 K and 11.3 at 5000 K. Colours below 1000 K are that of 1000 K.
    """
    hot = np.clip(np.asarray(kelvin, np.float64), 0.0, _HOTTEST)
    strength = (STEFAN_BOLTZMANN * 1e-6 / np.pi) * hot**4
    at, table = _colours()
    colours = [np.interp(hot, at, table[:, channel]) for channel in range(3)]
    return np.asarray(np.stack(colours, axis=-1) * strength[..., None], np.float32)


@functools.cache
def _colours() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Temperatures, and the colours of luminance 1 of these."""
    at = np.linspace(_FIRST, _LAST, _COUNT)
    return at, np.array([blackbody(float(kelvin)) for kelvin in at])
