# SPDX-License-Identifier: Apache-2.0
"""Values of render settings as plain data."""

from __future__ import annotations

import math
from dataclasses import dataclass

from wavecomb.errors import WavecombError

CONFORMS = (
    "expandAperture",
    "cropAperture",
    "adjustApertureWidth",
    "adjustApertureHeight",
    "adjustPixelAspectRatio",
)
"""Values of UsdRender's aspectRatioConformPolicy."""


@dataclass(frozen=True)
class ProductSettings:
    """Values of render settings and one of their products; None means that nothing is authored.

    Attributes:
        settings: Path of the RenderSettings.
        product: Path of the RenderProduct.
        camera: Path of the camera.
        resolution: Width and height in pixels.
        pixel_aspect: Width of a pixel divided by its height.
        conform: One of ``CONFORMS``.
        data_window: (xmin, ymin, xmax, ymax) from 0 to 1 over the image, y up.
        purposes: Purposes of the geometry that is rendered.
        material_purposes: Purposes of material bindings in order of preference.
        motion_blur: Whether motion blur is enabled.
        depth_of_field: Whether depth of field is enabled.
        aovs: Names of layers in the syntax of ``--aov``.
        output: Name of the image file.
        start: Start time code of the stage.
    """

    settings: str | None = None
    product: str | None = None
    camera: str | None = None
    resolution: tuple[int, int] | None = None
    pixel_aspect: float = 1.0
    conform: str = CONFORMS[0]
    data_window: tuple[float, float, float, float] | None = None
    purposes: tuple[str, ...] | None = None
    material_purposes: tuple[str, ...] | None = None
    motion_blur: bool = True
    depth_of_field: bool = True
    aovs: tuple[str, ...] | None = None
    output: str | None = None
    start: float | None = None

    @property
    def first_frame(self) -> float:
        """Frame that is rendered by default; 1 if the stage has no start time code."""
        return 1.0 if self.start is None else self.start

    def region(self, width: int, height: int) -> tuple[int, int, int, int] | None:
        """Returns the pixels whose centres are in the data window as x0, y0, x1, y1.

        The y axis points down, and the end is excluded. Returns None if these are all pixels.

        Raises:
            WavecombError: The window contains no pixel.
        """
        if self.data_window is None:
            return None
        left, low, right, high = self.data_window
        x0, x1 = (math.ceil(edge * width - 0.5) for edge in (left, right))
        y0, y1 = (math.ceil((1.0 - edge) * height - 0.5) for edge in (high, low))
        x0, y0, x1, y1 = max(x0, 0), max(y0, 0), min(x1, width), min(y1, height)
        if x0 >= x1 or y0 >= y1:
            raise WavecombError(
                f"{self.product or self.settings}: dataWindowNDC contains no pixel of the image; "
                "fix it or give --region"
            )
        return None if (x0, y0, x1, y1) == (0, 0, width, height) else (x0, y0, x1, y1)
