# SPDX-License-Identifier: Apache-2.0
"""Image files to texture ids, each once."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdShade

from wavecomb.usd.pixels import Image, ReadAhead, TextureError, read_image, stamp_of
from wavecomb.usd.report import LoadReport

if TYPE_CHECKING:
    from wavecomb import _core

_WRAPS = {"repeat": "repeat", "clamp": "clamp", "mirror": "mirror", "black": "black"}


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


def image_files(material: Usd.Prim, time: Usd.TimeCode) -> Iterator[str]:
    """Files that the shaders in a material name: a guess at what it will ask for."""
    for prim in Usd.PrimRange(material, Usd.TraverseInstanceProxies()):
        for attribute in prim.GetAuthoredAttributes():
            if attribute.GetTypeName() == Sdf.ValueTypeNames.Asset:
                value = attribute.Get(time)
                if value is not None and value.resolvedPath:
                    yield value.resolvedPath


def to_linear(values: NDArray[Any]) -> NDArray[np.float32]:
    """The sRGB transfer curve of IEC 61966-2-1, encoded to linear."""
    v = np.asarray(values, np.float32)
    low = v / np.float32(12.92)
    high = ((np.maximum(v, 0) + np.float32(0.055)) / np.float32(1.055)) ** np.float32(2.4)
    return np.where(v <= 0.04045, low, high).astype(np.float32)


def checker() -> NDArray[np.uint8]:
    """Magenta and dark squares (16, 16, 3): what a missing texture looks like."""
    squares = (np.indices((16, 16)) // 2).sum(axis=0) % 2
    return np.where(squares[..., None] == 0, (255, 0, 255), (40, 0, 40)).astype(np.uint8)


@dataclass(frozen=True)
class TextureStock:
    """The textures of a scene, for later ones to share.

    Attributes:
        scene: That holds them.
        images: What they were made of, by file; without pixels.
        ids: Texture ids by file and options.
    """

    scene: _core.Scene
    images: dict[str, Image]
    ids: dict[tuple[Any, ...], int]


class TextureTable:
    """Adds textures to the scene, equal ones once."""

    def __init__(
        self,
        builder: _core.SceneBuilder,
        report: LoadReport,
        threads: int = 0,
        reuse: TextureStock | None = None,
    ) -> None:
        """``reuse``: textures to share where their files are what they were."""
        self._reuse = reuse
        self._unchanged: dict[str, Image | None] = {}
        self._builder = builder
        self._report = report
        self._ahead = ReadAhead(threads)
        self._images: dict[str, Image | TextureError] = {}
        self._ids: dict[tuple[Any, ...], int] = {}
        self._taken: dict[str, Image] = {}

    def expect(self, material: Usd.Prim, time: Usd.TimeCode) -> None:
        """Starts to read the images of a material that will be used."""
        files = image_files(material, time)
        self._ahead.want(file for file in files if self._known(file) is None)

    def _known(self, path: str) -> Image | None:
        """The image of a file as it was for the scene to share with, unless it changed."""
        if self._reuse is None:
            return None
        if path not in self._unchanged:
            image = self._reuse.images.get(path)
            same = image is not None and image.stamp == stamp_of(path)
            self._unchanged[path] = image if same else None
        return self._unchanged[path]

    def image(self, path: str, prim: object) -> Image | None:
        """The image of a file, read once; None and a warning where that fails."""
        found = self._images.get(path)
        if found is None:
            try:
                found = self._known(path) or self._ahead.read(path)
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
            reuse = self._reuse
            if reuse is not None and key in reuse.ids and image is self._known(path):
                self._ids[key] = self._builder.share_texture(reuse.scene, reuse.ids[key])
            else:
                self._ids[key] = self._add(path, image, srgb, *wraps)
            self._report.tally("textures")
        return self._ids[key]

    def _add(self, path: str, image: Image, srgb: bool, wrap_s: str, wrap_t: str) -> int:
        # Gone from memory once it is in the scene; a second use in another way reads it again.
        pixels = image.take() if image.is_here else read_image(path).take()
        if srgb and pixels.dtype != np.uint8:
            colours = 3 if image.channels >= 3 else 1
            linear = to_linear(pixels[..., :colours])
            linear = np.concatenate([linear, pixels[..., colours:]], axis=2)
            pixels = np.ascontiguousarray(linear, image.dtype)
        return self._builder.add_texture(pixels, srgb=srgb, wrap_s=wrap_s, wrap_t=wrap_t, name=path)

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

    def stock(self, scene: _core.Scene) -> TextureStock:
        """What later scenes can share; scene: that was built of these textures."""
        return TextureStock(scene, self._taken, self._ids)

    def release(self) -> None:
        """Forgets the pixels that were read."""
        images = {path: image for path, image in self._images.items() if isinstance(image, Image)}
        self._taken = {path: image for path, image in images.items() if not image.is_here}
        self._images.clear()
        self._ahead.close()
