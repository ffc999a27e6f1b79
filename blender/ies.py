# SPDX-License-Identifier: GPL-3.0-or-later
"""Angular falloff of Cycles' spot and area lights, written as IES profiles.

UsdLux shapes a spot by a smooth step of the angle, while Cycles uses a smooth step of the cosine.
An IES profile equals the falloff of Cycles at the angles of the profile, and is interpolated
linearly between the angles.
"""

from __future__ import annotations

import math
from collections.abc import Callable

STEPS = 256
"""Number of intervals of the angles in an IES profile."""


def spot_law(size: float, blend: float) -> Callable[[float], float]:
    """Returns the factor of a spot light at an angle from its axis.

    Args:
        size: Full angle of the cone in radians.
        blend: Softness of the edge, 0 to 1.
    """
    edge = math.cos(0.5 * size)
    width = (1.0 - edge) * blend

    def factor(angle: float) -> float:
        inside = math.cos(angle) - edge
        if width <= 0.0:
            return 1.0 if inside > 0.0 else 0.0
        t = min(max(inside / width, 0.0), 1.0)
        return t * t * (3.0 - 2.0 * t)

    return factor


def spread_law(spread: float) -> Callable[[float], float]:
    """Returns the factor of an area light's radiance at an angle from its normal.

    The power of the light does not depend on its spread.
    """
    half = max(0.5 * spread, 1e-3)
    tan_half = math.tan(half)
    # Normalised so that the integral of the factor times the cosine over the hemisphere is pi.
    scale = 1.0 / (1.0 - _mean_tangent(half))

    def factor(angle: float) -> float:
        if angle >= half:
            return 0.0
        return scale * (1.0 - math.tan(angle) / tan_half)

    return factor


def _mean_tangent(half: float) -> float:
    """Returns 1 minus the integral of 2 (1 - tan t / tan half) sin t cos t from 0 to half."""
    sin, tan = math.sin(half), math.tan(half)
    return 1.0 - (sin * sin - (half - 0.5 * math.sin(2.0 * half)) / tan)


def profile(law: Callable[[float], float], last: float) -> str:
    """Returns the text of an IES file for a falloff that is 0 beyond ``last`` radians."""
    last = min(last, math.pi)
    angles = [last * i / STEPS for i in range(STEPS + 1)]
    values = [law(angle) for angle in angles]
    degrees = [math.degrees(angle) for angle in angles]
    if last < math.pi:
        degrees += [min(degrees[-1] + 1e-3, 180.0), 180.0]
        values += [0.0, 0.0]
    rows = [
        "IESNA:LM-63-2002",
        "TILT=NONE",
        f"1 1000 1 {len(degrees)} 1 1 2 0 0 0",
        "1 1 0",
        *_wrapped(degrees),
        "0",
        *_wrapped(values),
    ]
    return "\n".join(rows) + "\n"


def _wrapped(values: list[float]) -> list[str]:
    return [" ".join(f"{v:.7g}" for v in values[i : i + 8]) for i in range(0, len(values), 8)]
