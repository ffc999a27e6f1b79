# SPDX-License-Identifier: Apache-2.0
"""Image files to texture ids, each once."""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray
from pxr import Ar, Sdf, Usd, UsdShade

from wavecomb.usd.report import LoadReport

if TYPE_CHECKING:
    from wavecomb import _core

MAX_SIDE = 65536
MAX_BYTES = 8 << 30
_WRAPS = {"repeat": "repeat", "clamp": "clamp", "mirror": "mirror", "black": "black"}


class TextureError(ValueError):
    """An image that cannot be used; says why in a few words."""


@dataclass(frozen=True)
class Image:
    """Pixels (height, width, channels 1 to 4), uint8, float16 or float32; row 0 is the top."""

    pixels: NDArray[Any]

    @property
    def channels(self) -> int:
        """Channels of each pixel."""
        return int(self.pixels.shape[2])

    @property
    def automatic_srgb(self) -> bool:
        """Whether ``sourceColorSpace = auto`` means sRGB: 8 bits, 3 or 4 channels."""
        return self.pixels.dtype == np.uint8 and self.channels >= 3


def asset_file(value: Any, attribute: Usd.Attribute | None, report: LoadReport) -> str:
    """The file that an asset value names: resolved where it resolves, else as authored."""
    if not isinstance(value, Sdf.AssetPath):
        return str(value or "")
    path = value.resolvedPath or value.path
    if "<UDIM>" not in path and "<UDIM>" not in value.path:
        return path
    report.missing("UDIM textures (first tile used for all)", os.path.basename(value.path))
    if "<UDIM>" not in path:
        return path
    layers = attribute.GetPropertyStack() if attribute else []
    layer = layers[0].layer if layers else None
    tiles = UsdShade.UdimUtils.ResolveUdimTilePaths(value.path, layer)
    return str(tiles[0][0]) if tiles else path.replace("<UDIM>", "1001")


def to_linear(values: NDArray[Any]) -> NDArray[np.float32]:
    """The sRGB transfer curve of IEC 61966-2-1, encoded to linear."""
    v = np.asarray(values, np.float32)
    low = v / np.float32(12.92)
    high = ((np.maximum(v, 0) + np.float32(0.055)) / np.float32(1.055)) ** np.float32(2.4)
    return np.where(v <= 0.04045, low, high).astype(np.float32)


def read_image(path: str) -> Image:
    """Reads the first image of a file, or of a file in a package (``a.usdz[b.png]``).

    Raises:
        TextureError: It is missing, unreadable or too large.
    """
    if not path:
        raise TextureError("no file name")
    if not Ar.IsPackageRelativePath(path):
        if not os.path.isfile(path):
            raise TextureError("no such file")
        return _read_file(path)
    asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path))
    if not asset:
        raise TextureError("no such file in the package")
    data = bytes(asset.GetBuffer())
    suffix = Path(Ar.SplitPackageRelativePathInner(path)[1]).suffix
    descriptor, name = tempfile.mkstemp(suffix=suffix, prefix="wavecomb-")
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(data)
        return _read_file(name)
    finally:
        os.unlink(name)


def _read_file(path: str) -> Image:
    # Colours as stored: not multiplied by alpha.
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    source = oiio.ImageInput.open(path, config)
    if source is None:
        raise TextureError(" ".join(oiio.geterror().split()) or "not a known image file")
    try:
        spec = source.spec()
        channels = min(spec.nchannels, 4)
        base = spec.format.basetype
        dtype = {oiio.UINT8: np.uint8, oiio.HALF: np.float16, oiio.UINT16: np.float16}.get(
            base, np.float32
        )
        if spec.width < 1 or spec.height < 1 or channels < 1:
            raise TextureError("it has no pixels")
        size = spec.width * spec.height * channels * np.dtype(dtype).itemsize
        if max(spec.width, spec.height) > MAX_SIDE or size > MAX_BYTES or spec.depth > 1:
            raise TextureError(f"{spec.width} x {spec.height} is too large")
        ask = oiio.TypeDesc(oiio.UINT8 if base == oiio.UINT8 else oiio.FLOAT)
        pixels = source.read_image(0, 0, 0, channels, ask)
        if pixels is None:
            raise TextureError(" ".join(source.geterror().split()) or "it cannot be read")
    finally:
        source.close()
    pixels = np.asarray(pixels).reshape(spec.height, spec.width, channels)
    if pixels.dtype != np.uint8:
        limit = 65504.0 if dtype == np.float16 else 3.4e38
        pixels = np.nan_to_num(pixels, copy=False, nan=0.0, posinf=limit, neginf=-limit)
    return Image(np.ascontiguousarray(pixels, dtype))


def checker() -> NDArray[np.uint8]:
    """Magenta and dark squares (16, 16, 3): what a missing texture looks like."""
    squares = (np.indices((16, 16)) // 2).sum(axis=0) % 2
    return np.where(squares[..., None] == 0, (255, 0, 255), (40, 0, 40)).astype(np.uint8)


class TextureTable:
    """Adds textures to the scene, equal ones once."""

    def __init__(self, builder: _core.SceneBuilder, report: LoadReport) -> None:
        self._builder = builder
        self._report = report
        self._images: dict[str, Image | TextureError] = {}
        self._ids: dict[tuple[Any, ...], int] = {}

    def image(self, path: str, prim: object) -> Image | None:
        """The image of a file, read once; None and a warning where that fails."""
        found = self._images.get(path)
        if found is None:
            try:
                found = read_image(path)
            except (TextureError, MemoryError, OSError, ValueError) as error:
                found = TextureError(str(error) or "out of memory")
            self._images[path] = found
        if isinstance(found, TextureError):
            name = path or "(no file name)"
            self._report.warn(f"texture {name} cannot be read ({found})", prim)
            return None
        return found

    def add(self, path: str, image: Image, colour_space: str, wrap_s: str, wrap_t: str) -> int:
        """Texture id of an image.

        Args:
            path: Its file, which names it.
            image: From ``image``.
            colour_space: auto, raw or sRGB.
            wrap_s: repeat, clamp, mirror or black; anything else is black, as UsdUVTexture says.
            wrap_t: Likewise.
        """
        srgb = image.automatic_srgb if colour_space == "auto" else colour_space == "sRGB"
        wraps = _WRAPS.get(wrap_s, "black"), _WRAPS.get(wrap_t, "black")
        key = (path, srgb, *wraps)
        if key not in self._ids:
            pixels = image.pixels
            if srgb and pixels.dtype != np.uint8:
                colours = 3 if image.channels >= 3 else 1
                linear = to_linear(pixels[..., :colours])
                pixels = np.concatenate([linear, pixels[..., colours:]], axis=2)
                pixels = np.ascontiguousarray(pixels, image.pixels.dtype)
            self._ids[key] = self._builder.add_texture(
                pixels, srgb=srgb, wrap_s=wraps[0], wrap_t=wraps[1], name=path
            )
            self._report.tally("textures")
        return self._ids[key]

    def missing(self) -> int:
        """Texture id of the checker that stands for a texture that cannot be read."""
        key = ("", "checker")
        if key not in self._ids:
            self._ids[key] = self._builder.add_texture(
                checker(), srgb=False, name="missing texture"
            )
        return self._ids[key]

    def add_pixels(self, name: str, pixels: NDArray[Any]) -> int:
        """Texture id of generated pixels, linear."""
        return self._builder.add_texture(
            pixels, srgb=False, wrap_s="repeat", wrap_t="clamp", name=name
        )

    def release(self) -> None:
        """Forgets the pixels that were read."""
        self._images.clear()
