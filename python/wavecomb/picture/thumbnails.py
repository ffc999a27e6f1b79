# SPDX-License-Identifier: Apache-2.0
"""Picture files as a screen shows them, at the size that is asked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.errors import WavecombError
from wavecomb.picture.image import (
    display,
    linear_from_srgb,
    read_layers,
    read_metadata,
    srgb_from_linear,
)
from wavecomb.picture.layer_view import is_light, show_layer
from wavecomb.picture.working_space import to_rec709

if TYPE_CHECKING:
    from wavecomb.picture.image import Transfer


@dataclass(frozen=True)
class Look:
    """How files are shown.

    Attributes:
        layer: Of the file; "": its colours.
        denoised: Whether those are the layer denoised where it is there, and not the beauty.
        exposure: In stops, of light.
        tone_map: "clamp" or "neutral", of light.
    """

    layer: str = ""
    denoised: bool = True
    exposure: float = 0.0
    tone_map: Transfer = "clamp"

    def codes(self, file: str) -> NDArray[np.uint8]:
        """A picture file as 8-bit sRGB codes, (height, width, 3).

        Raises:
            WavecombError: It has no such layer.
            OSError: It cannot be read.
        """
        layers = read_layers(file)
        is_better = self.denoised and "denoised" in layers
        name = self.layer or ("denoised" if is_better else "beauty")
        if not self.layer and name not in layers and len(layers) == 1:
            name = next(iter(layers))
        if name not in layers:
            raise WavecombError(f"{file}: has no layer {name}; there are {', '.join(layers)}")
        pixels = layers[name]
        if not (self.layer and not is_light(name)) and pixels.shape[2] >= 3:
            space = str(read_metadata(file).get("wavecomb:working_space", "rec709"))
            return self.of_light(to_rec709(pixels[:, :, :3], space))
        if not self.layer:  # grey: R alone, or Y
            return self.of_light(np.repeat(pixels[:, :, :1], 3, axis=2))
        return show_layer(pixels if pixels.shape[2] > 1 else pixels[:, :, 0], name).pixels

    def of_light(self, pixels: NDArray[Any]) -> NDArray[np.uint8]:
        """Linear Rec.709 as codes."""
        return display(pixels, exposure=self.exposure, tone_map=self.tone_map)


def fitted(codes: NDArray[np.uint8], width: int, height: int) -> NDArray[np.uint8]:
    """A picture made smaller, in linear light, so that it fits; never larger.

    Args:
        codes: 8-bit sRGB, (h, w, 3).
        width: Of the room for it.
        height: Likewise.
    """
    import OpenImageIO as oiio

    high, wide = codes.shape[:2]
    share = min(width / wide, height / high)
    if share >= 1.0:
        return codes
    wide, high = max(1, round(wide * share)), max(1, round(high * share))
    linear = linear_from_srgb(codes.astype(np.float32) / np.float32(255.0))
    source = oiio.ImageBuf(np.ascontiguousarray(linear))
    made = oiio.ImageBufAlgo.resize(
        source, filtername="lanczos3", roi=oiio.ROI(0, wide, 0, high, 0, 1, 0, 3), nthreads=1
    )
    pixels = np.asarray(made.get_pixels(oiio.FLOAT), np.float32).reshape(high, wide, 3)
    encoded = srgb_from_linear(np.clip(pixels, 0.0, 1.0))
    return np.floor(encoded * 255.0 + 0.5).astype(np.uint8)
