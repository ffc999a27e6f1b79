# SPDX-License-Identifier: Apache-2.0
"""Colour spaces in which images can be rendered.

The working spaces are linear Rec.709 (the default) and ACEScg, which has the AP1 primaries and the
ACES white point.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Luminance weights of linear Rec.709 (ITU-R BT.709)."""

CHROMATICITIES = {
    "acescg": (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767),
}
"""Chromaticities x, y of red, green, blue and white, for EXR headers. Rec.709 has no entry, since
it is the default."""

# Matrix from the colour space AP1 to linear Rec.709, with Bradford adaptation of the white point
# (ACES documents S-2014-004 and TB-2014-004).
_ACESCG_TO_REC709 = np.array(
    [
        [1.7050509, -0.6217921, -0.0832588],
        [-0.1302564, 1.1408047, -0.0105483],
        [-0.0240034, -0.1289690, 1.1529723],
    ]
)


def to_rec709(rgb: NDArray[Any], working: str) -> NDArray[Any]:
    """Converts colours (..., 3) of the working space to linear Rec.709."""
    if working == "rec709":
        return rgb
    return np.asarray(rgb @ _ACESCG_TO_REC709.T, np.float32)


def from_rec709(rgb: NDArray[Any], working: str) -> NDArray[Any]:
    """Converts colours (..., 3) of linear Rec.709 to the working space."""
    if working == "rec709":
        return rgb
    return np.asarray(rgb @ np.linalg.inv(_ACESCG_TO_REC709).T, np.float32)


def header_of(working: str) -> dict[str, Any]:
    """Returns the EXR attributes that identify the working space of an image."""
    if working == "rec709":
        return {}
    return {"chromaticities": CHROMATICITIES[working], "wavecomb:working_space": working}
