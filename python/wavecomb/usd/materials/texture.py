# SPDX-License-Identifier: Apache-2.0
"""Adds image files to the scene as textures; each file is added once."""

from __future__ import annotations

import filecmp
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd

from wavecomb.errors import WavecombError
from wavecomb.image.working_space import from_rec709
from wavecomb.machine import give_back_memory, temporary_folder
from wavecomb.run.isolation import memory
from wavecomb.usd.materials.colour_space import (
    LINEAR,
    OCIO_NAMES,
    RAW,
    SRGB,
    canonical,
    convert,
    halve,
    to_linear,
)
from wavecomb.usd.materials.network import UDIM, image_files, missing_tiles, tile_files
from wavecomb.usd.materials.pixels import Image, ReadAhead, TextureError, read_image, stamp_of
from wavecomb.usd.stage.context import LoadContext
from wavecomb.usd.stage.report import LoadReport

if TYPE_CHECKING:
    from wavecomb import _core

_WRAPS = ("repeat", "clamp", "mirror", "black")

CURVE = "sRGB curve"
"""Colour space of textures whose sRGB curve the core decodes, without converting pixels."""


def checker() -> NDArray[np.uint8]:
    """Returns the magenta and dark checker (16, 16, 3) that replaces missing textures."""
    squares = (np.indices((16, 16)) // 2).sum(axis=0) % 2
    return np.where(squares[..., None] == 0, (255, 0, 255), (40, 0, 40)).astype(np.uint8)


Key = tuple[str, str, str, str]
"""Key of a texture: file, colour space of the pixels, and wrap modes in s and t."""


@dataclass
class TiledImage:
    """The images of a UDIM texture.

    Attributes:
        first: Image of the tile with the lowest number.
        tiles: Tile numbers and files.
    """

    first: Image
    tiles: tuple[tuple[int, str], ...]

    def __post_init__(self) -> None:
        """Copies the properties of the first tile; tiles do not wrap."""
        self.channels, self.dtype = self.first.channels, self.first.dtype
        self.wraps, self.automatic_srgb = ("clamp", "clamp"), self.first.automatic_srgb


def _converts(space: str) -> bool:
    """Returns whether pixels in this colour space are converted before they are stored."""
    return space not in (RAW, CURVE)


def stored_type(image: Image, space: str) -> Any:
    """Returns the type of the stored pixels; converted 8-bit images are stored as half floats."""
    if image.dtype == np.uint8 and _converts(space):
        return np.dtype(np.float16)
    return image.dtype


@dataclass(frozen=True)
class TextureCache:
    """The textures of a scene, for reuse in later scenes.

    Attributes:
        scene: The scene that holds the textures.
        images: Source images by file name, without pixels.
        ids: Texture ids by file name and options.
        store: The texture store that limits the textures' memory.
    """

    scene: _core.Scene
    images: dict[str, Image]
    ids: dict[tuple[Any, ...], int]
    store: _core.TextureStore | None = None


MEGABYTE = 1_000_000


def texture_store(
    limit: float | None, reuse: TextureCache | None, report: LoadReport
) -> _core.TextureStore | None:
    """Returns the store that keeps textures within ``limit`` MB; None if there is no limit.

    If ``reuse`` has a store with this limit, returns that store, so that the limit includes reused
    textures.

    Raises:
        WavecombError: A texture store with the given limit cannot be created.
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


class TextureTable:
    """The textures of a scene; equal textures are stored once."""

    def __init__(
        self,
        context: LoadContext,
        reuse: TextureCache | None = None,
        store: _core.TextureStore | None = None,
    ) -> None:
        """``reuse`` has textures of a previous scene, to be reused if files have not changed.

        ``store`` is the texture store of the builder. Callers may set ``drops``, the number of
        finest mip levels to leave out per texture, and ``origin``, the world position of the
        scene's origin. The table does not keep the context's stage, since the table may outlive the
        stage.
        """
        self.store = store
        self.working = context.options.working_space
        self.origin = (0.0, 0.0, 0.0)
        self._reuse = reuse
        self._unchanged: dict[str, Image | None] = {}
        self._builder, self._report = context.builder, context.report
        # Images that are decoded in advance may take a quarter of the texture store's memory limit.
        self._ahead = ReadAhead(
            context.options.threads, None if store is None else store.limit_bytes // 4
        )
        self._images: dict[str, Image | TextureError] = {}
        self._ids: dict[tuple[Any, ...], int] = {}
        self._taken: dict[str, Image] = {}
        self.drops: dict[Key, int] = {}
        self._twins: dict[str, str] = {}
        self._by_size: dict[int, list[str]] = {}

    def expect(self, material: Usd.Prim, time: Usd.TimeCode) -> None:
        """Starts reading the images of a material before the material is used."""
        files = [self._twin(file) for file in image_files(material, time)]
        self._ahead.want(file for file in files if self._known(file) is None)

    def _known(self, path: str) -> Image | None:
        """Returns the previous scene's image of a file; None if the file has changed."""
        if self._reuse is None:
            return None
        if path not in self._unchanged:
            image = self._reuse.images.get(path)
            same = image is not None and image.stamp == stamp_of(path)
            self._unchanged[path] = image if same else None
        return self._unchanged[path]

    def _twin(self, path: str) -> str:
        """Returns the first file with the same contents among all requested files."""
        found = self._twins.get(path)
        if found is None:
            found = path
            try:
                if os.path.isfile(path):
                    others = self._by_size.setdefault(os.path.getsize(path), [])
                    same = (other for other in others if filecmp.cmp(other, path, shallow=False))
                    found = next(same, path)
                    if found is path:
                        others.append(path)
            except (OSError, ValueError):
                # Ignore the error here. It is reported when the file is read for the scene.
                pass
            self._twins[path] = found
        return found

    def image(self, path: str, prim: object) -> Image | TiledImage | None:
        """Returns the image of a file or UDIM pattern; warns and returns None on failure.

        Files with equal contents are read only once. All tiles of a UDIM pattern are read.
        """
        if UDIM in path:
            tiles = tile_files(path)
            for _, tile in tiles:
                first = self._image(self._twin(tile), prim)
                if first is not None:
                    return TiledImage(first, tuple(tiles))
            if not tiles:
                why = missing_tiles(path)
                self._report.warn(f"texture {path} cannot be read ({why})", prim)
            return None
        return self._image(self._twin(path), prim)

    def _image(self, path: str, prim: object) -> Image | None:
        found = self._images.get(path)
        if found is None:
            try:
                found = self._known(path) or self._ahead.read(path)
            except (TextureError, MemoryError, OSError, ValueError) as error:
                if memory.is_exhausted(error, int):
                    raise
                found = TextureError(str(error) or "out of memory")
            self._images[path] = found
        if isinstance(found, TextureError):
            name = path or "(no file name)"
            self._report.warn(f"texture {name} cannot be read ({found})", prim)
            return None
        return found

    def add(
        self,
        path: str,
        image: Image | TiledImage,
        colour_space: str,
        wrap_s: str,
        wrap_t: str,
        *,
        is_colour: bool = False,
        missing: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0),
    ) -> int:
        """Returns the texture id of an image.

        Args:
            path: File name, or UDIM pattern.
            image: Result of ``image``.
            colour_space: "auto", or the name of a colour space in OpenColorIO's built-in config.
            wrap_s: repeat, clamp, mirror or black; any other value means black, as in UsdUVTexture.
            wrap_t: Wrap mode along t, with the same values as ``wrap_s``.
            is_colour: Whether the texture holds colours, which are converted to the working space.
                If False, only an sRGB curve is decoded.
            missing: Linear colour and alpha of UDIM tiles that do not exist.
        """
        if isinstance(image, TiledImage):
            return self._add_tiles(path, image, colour_space, is_colour, missing)
        path = self._twin(path)
        space = self._space(path, image, colour_space, is_colour)
        s, t = (mode if mode in _WRAPS else "black" for mode in (wrap_s, wrap_t))
        texture: Key = (path, space, s, t)
        key = (*texture, self.drops.get(texture, 0))
        if key not in self._ids:
            reuse = self._reuse
            if reuse is not None and key in reuse.ids and image is self._known(path):
                self._ids[key] = self._builder.share_texture(reuse.scene, reuse.ids[key])
            else:
                self._ids[key] = self._add(path, image, space, s, t)
            self._report.tally("textures")
        return self._ids[key]

    def _add_tiles(
        self,
        path: str,
        image: TiledImage,
        colour_space: str,
        is_colour: bool,
        missing: tuple[float, ...],
    ) -> int:
        """Adds a texture of all readable tiles.

        If ``colour_space`` is "auto", each tile uses the colour space of its own file.
        """
        tiles = []
        for number, file in image.tiles:
            tile = self._image(self._twin(file), path)
            if tile is not None:
                added = self.add(file, tile, colour_space, "clamp", "clamp", is_colour=is_colour)
                tiles.append((number, added))
        if is_colour:
            r, g, b = from_rec709(np.array(missing[:3]), self.working)
            missing = (float(r), float(g), float(b), missing[3])
        key = (path, tuple(tiles), missing)
        if key not in self._ids:
            self._ids[key] = self._builder.add_tiles(path, tiles, missing)
        return self._ids[key]

    def _space(self, path: str, image: Image, colour_space: str, is_colour: bool) -> str:
        """Returns the colour space of pixels: an OpenColorIO name, RAW (no conversion) or CURVE."""
        if colour_space == "auto":
            space = SRGB if image.automatic_srgb else LINEAR
        else:
            known = canonical(colour_space)
            if known is None:
                self._report.missing(f"colour space {colour_space} (read as auto)", path)
                return self._space(path, image, "auto", is_colour)
            space = known
        if space == SRGB and self.working == "rec709":
            return CURVE
        if not is_colour or image.channels < 3:
            return CURVE if space == SRGB else RAW
        return RAW if space == OCIO_NAMES[self.working] else space

    def _as_stored(
        self, path: str, image: Image, space: str, wraps: tuple[str, str]
    ) -> NDArray[Any]:
        """Takes the pixels of an image in their stored type, without omitted mip levels."""
        pixels = image.take()
        dtype = stored_type(image, space)
        if _converts(space):
            top = 65504.0 if dtype == np.float16 else 3.4e38
            linear = np.clip(convert(pixels, space, self.working), -top, top)
            pixels = np.ascontiguousarray(linear, dtype)
        elif space == CURVE and pixels.dtype != np.uint8:
            colours = 3 if image.channels >= 3 else 1
            linear = to_linear(pixels[..., :colours])
            linear = np.concatenate([linear, pixels[..., colours:]], axis=2)
            pixels = np.ascontiguousarray(linear, image.dtype)
        for _ in range(self.drops.get((path, space, *wraps), 0)):
            pixels = halve(pixels, space == CURVE)
        return pixels

    def _add(self, path: str, image: Image, space: str, wrap_s: str, wrap_t: str) -> int:
        # The image's pixels are released after the image is added to the scene. If the image is
        # used again with other options, read the file again.
        here = image if image.is_here else read_image(path)
        pixels = self._as_stored(path, here, space, (wrap_s, wrap_t))
        if self.store is not None:
            self.store.set_waiting(self._ahead.bytes)
        try:
            return self._builder.add_texture(
                pixels, srgb=space == CURVE, wrap_s=wrap_s, wrap_t=wrap_t, name=path
            )
        # `add_texture` raises ValueError if the texture store has no space left.
        except ValueError as error:
            raise WavecombError(str(error)) from None
        finally:
            if self.store is not None:
                # Without this call, the allocator would keep the memory of decoded images.
                del pixels
                give_back_memory()

    def mean(self, number: int) -> NDArray[np.float64]:
        """Reads a texture's file again and returns its linear mean (4,); 1 if that fails."""
        key = next((key for key, known in self._ids.items() if known == number), ())
        # The keys of UDIM textures have three elements.
        if len(key) == 3:
            means = [self.mean(tile) for _, tile in key[1]]
            return np.asarray(np.mean(means, axis=0)) if means else np.ones(4)
        if len(key) != 5:
            return np.ones(4)
        path, space, wrap_s, wrap_t, _ = key
        try:
            pixels = self._as_stored(path, read_image(path), space, (wrap_s, wrap_t))
        except (TextureError, OSError, ValueError):
            return np.ones(4)
        values = pixels.astype(np.float32) / (255.0 if pixels.dtype == np.uint8 else 1.0)
        colours = 3 if values.shape[2] >= 3 else 1
        if space == CURVE and pixels.dtype == np.uint8:
            values[..., :colours] = to_linear(values[..., :colours])
        found = np.nan_to_num(values).mean(axis=(0, 1), dtype=np.float64)
        alpha = found[colours] if len(found) > colours else 1.0
        return np.array([*np.broadcast_to(found[:colours], 3), alpha])

    def missing(self) -> int:
        """Returns the texture id of the checker that replaces unreadable textures."""
        key = ("", "checker")
        if key not in self._ids:
            self._ids[key] = self._builder.add_texture(
                checker(), srgb=False, name="missing texture"
            )
        return self._ids[key]

    def add_pixels(self, name: str, pixels: NDArray[Any]) -> int:
        """Returns the texture id of generated pixels; colours are linear Rec.709."""
        return self._builder.add_texture(
            pixels, srgb=False, wrap_s="repeat", wrap_t="clamp", name=name
        )

    def cache(self, scene: _core.Scene) -> TextureCache:
        """Returns the textures for reuse in later scenes; ``scene`` was built with this table."""
        return TextureCache(scene, self._taken, self._ids, self.store)

    def release(self) -> None:
        """Releases the pixels of all images."""
        images = {path: image for path, image in self._images.items() if isinstance(image, Image)}
        self._taken = {path: image for path, image in images.items() if not image.is_here}
        self._images.clear()
        self._ahead.close()
