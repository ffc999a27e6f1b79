# SPDX-License-Identifier: Apache-2.0
"""Images, and the textures that were made of them, as later scenes share them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from wavecomb import _core

Stamp = tuple[int, int]
"""When a file was changed, in ns, and its size in bytes."""


class Image:
    """Pixels (height, width, channels 1 to 4), uint8, float16 or float32; row 0 is the top.

    Attributes:
        size: Height and width.
        channels: Channels of each pixel.
        dtype: Of the pixels.
        stamp: Of its file before it was read; None: not known.
        wraps: Modes in s and t that the file asks for: black, clamp, repeat or mirror.
        encoded: Whether the file says that it is sRGB; None: it does not say.
    """

    def __init__(
        self,
        pixels: NDArray[Any],
        stamp: Stamp | None = None,
        wraps: tuple[str, str] = ("black", "black"),
        encoded: bool | None = None,
    ) -> None:
        self.stamp = stamp
        self.wraps = wraps
        self.encoded = encoded
        self._pixels: NDArray[Any] | None = pixels
        self.size = int(pixels.shape[0]), int(pixels.shape[1])
        self.channels = int(pixels.shape[2])
        self.dtype = pixels.dtype

    @property
    def is_here(self) -> bool:
        """Whether the pixels were not taken yet."""
        return self._pixels is not None

    def take(self) -> NDArray[Any]:
        """Hands the pixels over, once."""
        pixels, self._pixels = self._pixels, None
        if pixels is None:
            raise ValueError("the pixels of this image were taken before")
        return pixels

    @property
    def automatic_srgb(self) -> bool:
        """Whether ``sourceColorSpace = auto`` means sRGB.

        As the file says, else of 8 bits with 3 or 4 channels.
        """
        if self.encoded is not None:
            return self.encoded
        return self.dtype == np.uint8 and self.channels >= 3


@dataclass(frozen=True)
class TextureCache:
    """The textures of a scene, for later ones to share.

    Attributes:
        scene: That holds them.
        images: What they were made of, by file; without pixels.
        ids: Texture ids by file and options.
        store: What keeps them within a limit.
    """

    scene: _core.Scene
    images: dict[str, Image]
    ids: dict[tuple[Any, ...], int]
    store: _core.TextureStore | None = None
