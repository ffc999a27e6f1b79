# SPDX-License-Identifier: Apache-2.0
"""Images and the textures made of them, which later scenes share, and their store of tiles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.errors import WavecombError
from wavecomb.machine import temporary_folder
from wavecomb.usd.stage.report import LoadReport

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


MEGABYTE = 1_000_000


def texture_store(
    limit: float | None, reuse: TextureCache | None, report: LoadReport
) -> _core.TextureStore | None:
    """What keeps textures within ``limit`` MB; None: nothing does.

    That of ``reuse`` where it has the same limit, so that the limit is for what is shared too.

    Raises:
        WavecombError: The limit cannot be.
    """
    from wavecomb import _core

    if limit is None:
        return None
    bytes_ = int(min(limit * MEGABYTE, 2**63))
    if reuse is not None and reuse.store is not None and reuse.store.limit_bytes == bytes_:
        return reuse.store
    obstacle = _core.TextureStore.obstacle()
    if obstacle:
        report.note(f"texture limit {limit:g} MB: kept by leaving out mip levels, as {obstacle}")
        return None
    try:
        return _core.TextureStore(bytes_, temporary_folder())
    except ValueError as error:
        raise WavecombError(str(error)) from None
