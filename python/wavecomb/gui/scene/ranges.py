# SPDX-License-Identifier: Apache-2.0
"""What a parameter can be, and where a value stands on a slider. No Qt."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Range:
    """What a parameter can be.

    Attributes:
        low: Least value.
        high: Greatest value.
        soft_low: Left end of the slider.
        soft_high: Right end of the slider.
        decimals: Of the number.
        logarithmic: The slider's steps are ratios; its left end is 0 then where low is.
    """

    low: float
    high: float
    soft_low: float
    soft_high: float
    decimals: int = 3
    logarithmic: bool = False

    def share(self, value: float) -> float:
        """Where a value stands on the slider, from 0 to 1.

        >>> Range(0.0, 10.0, 0.0, 2.0).share(0.5), Range(0.0, 10.0, 0.0, 2.0).share(3.0)
        (0.25, 1.0)
        """
        low, high = self.soft_low, self.soft_high
        if self.logarithmic:
            share = math.log(max(value, low) / low) / math.log(high / low)
        else:
            share = (value - low) / (high - low)
        return min(max(share, 0.0), 1.0)

    def value_at(self, share: float) -> float:
        """The value at a place of the slider."""
        low, high = self.soft_low, self.soft_high
        if not self.logarithmic:
            return low + share * (high - low)
        return self.low if share <= 0.0 else low * (high / low) ** share


UNIT = Range(0.0, 1.0, 0.0, 1.0)


def differs(shown: Any, value: Any) -> bool:
    """Whether a field must be set anew: not for rounding, which would take the cursor away."""
    if isinstance(shown, tuple) != isinstance(value, tuple):
        return True
    if isinstance(value, tuple):
        return any(differs(a, b) for a, b in zip(shown, value, strict=True))
    return bool(abs(shown - value) > 1e-6 * max(1.0, abs(value)))
