# SPDX-License-Identifier: Apache-2.0
"""Writes multi-layer OpenEXR files by OpenImageIO.

Arrays have the shape (height, width) or (height, width, channels), with row 0 at the top. Errors
have a one-line message that names the file: OSError for files, WavecombError for options,
ValueError for arrays.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from wavecomb.errors import WavecombError
from wavecomb.image.cryptomatte import is_crypto
from wavecomb.image.files.output_file import is_whole_png, one_line, replacing, why_not_written
from wavecomb.run import aovs

Compression = Literal["none", "rle", "zips", "zip", "piz", "pxr24", "b44", "b44a", "dwaa", "dwab"]
COMPRESSIONS: tuple[str, ...] = get_args(Compression)
_LOSSY = ("pxr24", "b44", "b44a", "dwaa", "dwab")
MAX_TILE = 4096
Window = tuple[int, int, int, int]
"""Column and row of a file's first pixel in the displayed image, and width and height of the
displayed image."""

_HALF_MAX = 65504.0
ALPHA = "A"
"""Name of the alpha channel that belongs to R, G and B."""
BAND = 64
"""Number of rows that are converted and written together, which is four blocks of an EXR file."""


def channel_names(layer: str, channels: int) -> list[str]:
    """Returns the EXR channel names of a layer.

    The names are R, G and B for beauty, and albedo.R and so on for albedo.

    >>> channel_names("normal", 3)
    ['normal.X', 'normal.Y', 'normal.Z']
    >>> channel_names("samples", 1)
    ['samples']
    """
    prefix = "" if layer == "beauty" else f"{layer}."
    letters = aovs.letters(layer)
    if len(letters) == channels:
        return [prefix + letter for letter in letters]
    if channels == 1:
        return [layer]
    if channels in (3, 4):
        return [prefix + letter for letter in "RGBA"[:channels]]
    return [f"{layer}.{k}" for k in range(channels)]


def is_exact(layer: str) -> bool:
    """Returns whether lossy compression would make a layer useless.

    Lossy compression would change ids, whose bits must be exact. Dwaa treats every channel named Y
    as luminance, and its range of luminance is too small for positions far from 0.
    """
    return is_crypto(layer) or aovs.content(layer) in ("exact", "id")


def write_exr(
    path: str | os.PathLike[str],
    layers: Mapping[str, NDArray[Any]],
    *,
    half: bool = False,
    compression: Compression = "zip",
    tile: int = 0,
    metadata: Mapping[str, Any] | None = None,
    window: Window | None = None,
    called: str | os.PathLike[str] | None = None,
) -> None:
    """Writes an OpenEXR file of one part atomically.

    Args:
        path: File name that ends in .exr.
        layers: Arrays (height, width) or (height, width, channels) by layer name. "beauty" is
            written as R, G, B.
        half: Whether to store colours as 16-bit floats. All other layers are stored as 32-bit
            floats. Finite values outside of the range of half floats are clamped.
        compression: OpenEXR compression. Lossy compressions (pxr24, b44, dwaa and others) are
            rejected for layers with ids or positions.
        tile: Edge of square tiles in pixels, a multiple of 16; 0 means scanlines.
        metadata: File attributes of type str, int, float or (4, 4) array. "Software" has a default
            value.
        window: Position of the pixels in a larger image; None means that the pixels are the whole
            image.
        called: File name for error messages, if ``path`` is a temporary file.
    """
    name = os.fspath(path if called is None else called)
    sheet = ExrLayout(
        name, layers, half=half, compression=compression, tile=tile, metadata=metadata,
        window=window,
    )  # fmt: skip
    bands = (sheet.values(layers, rows) for rows in bands_of(sheet.spec.height, tile or BAND))
    write_bands(path, sheet.spec, bands, called=name)


class ExrLayout:
    """Converter of layers to an EXR file: the file's header, and pixel values in rows.

    Attributes:
        spec: OpenImageIO's specification of the file.
    """

    def __init__(
        self,
        name: str,
        layers: Mapping[str, NDArray[Any]],
        *,
        half: bool,
        compression: Compression,
        tile: int,
        metadata: Mapping[str, Any] | None,
        window: Window | None = None,
        height: int | None = None,
    ) -> None:
        """Prepares the header. The arguments are those of ``write_exr``.

        ``height`` is the number of rows of the file, if ``layers`` hold only some of the rows.
        """
        if Path(name).suffix.lower() != ".exr":
            raise ValueError(f"{name}: the name of an OpenEXR file must end in .exr")
        if not layers:
            raise ValueError(f"{name}: there is nothing to write")
        check_options(name, layers, compression, tile)
        self._name = name
        planes = self._planes(layers)
        self._halves = [half and _may_be_half(layer) for layer in layers]
        names = [
            channel
            for layer, plane in zip(layers, planes, strict=True)
            for channel in channel_names(layer, plane.shape[2])
        ]
        self.spec = _spec(planes, self._halves, names, tile)
        if height is not None:
            self.spec.height = self.spec.full_height = height
        if window is not None:
            self.spec.x, self.spec.y, self.spec.full_width, self.spec.full_height = window
        self.spec.attribute("compression", compression)
        set_attributes(self.spec, metadata or {})

    def values(
        self, layers: Mapping[str, NDArray[Any]], rows: slice = slice(None)
    ) -> NDArray[np.float32]:
        """Returns some rows of all layers, with shape (rows, width, channels of the file)."""
        both = zip(self._planes(layers), self._halves, strict=True)
        return np.concatenate([_values(plane[rows], as_half) for plane, as_half in both], axis=2)

    def _planes(self, layers: Mapping[str, NDArray[Any]]) -> list[NDArray[Any]]:
        planes: list[NDArray[Any]] = []
        for layer, pixels in layers.items():
            plane = np.asarray(pixels)
            plane = plane[:, :, None] if plane.ndim == 2 else plane
            if plane.ndim != 3 or (planes and plane.shape[:2] != planes[0].shape[:2]):
                raise ValueError(f"{self._name}: layer {layer!r} has the shape {np.shape(pixels)}")
            planes.append(plane)
        return planes


def _may_be_half(layer: str) -> bool:
    return aovs.content(layer) in ("light", "colour", "direction")


def check_options(name: str, layers: Any, compression: str, tile: int) -> None:
    """Raises WavecombError if an option is invalid for a file with these layers."""
    if compression not in COMPRESSIONS:
        raise WavecombError(
            f"{name}: compression {compression!r} is none of {', '.join(COMPRESSIONS)}"
        )
    if tile % 16 != 0 or not 0 <= tile <= MAX_TILE:
        raise WavecombError(
            f"{name}: tiles of {tile} pixels: must be a multiple of 16 up to {MAX_TILE}"
        )
    exact = [layer for layer in layers if is_exact(layer)]
    if compression in _LOSSY and exact:
        raise WavecombError(
            f"{name}: compression {compression} would spoil {exact[0]}; use zip, zips or piz, or "
            "write one file for each AOV"
        )


def _spec(planes: list[NDArray[Any]], halves: list[bool], names: list[str], tile: int) -> Any:
    import OpenImageIO as oiio

    height, width = planes[0].shape[:2]
    spec = oiio.ImageSpec(width, height, len(names), "float")
    spec.channelnames = tuple(names)
    spec.channelformats = tuple(
        oiio.TypeDesc("half" if as_half else "float")
        for plane, as_half in zip(planes, halves, strict=True)
        for _ in range(plane.shape[2])
    )
    spec.tile_width = spec.tile_height = tile
    spec.tile_depth = 1 if tile else 0
    return spec


def set_attributes(spec: Any, metadata: Mapping[str, Any]) -> None:
    """Sets file attributes from the argument ``metadata`` of ``write_exr``."""
    for key, value in {"Software": "Wavecomb", **metadata}.items():
        _attribute(spec, key, value)


def _attribute(spec: Any, key: str, value: Any) -> None:
    """Sets a file attribute.

    An array (4, 4) becomes a float matrix and an array (n,) a float array.
    """
    import OpenImageIO as oiio

    if np.ndim(value) == 2:
        spec.attribute(key, oiio.TypeMatrix44, tuple(float(v) for v in np.ravel(value)))
    elif np.ndim(value) == 1:
        spec.attribute(key, f"float[{len(value)}]", tuple(float(v) for v in value))
    else:
        spec.attribute(key, value)


def bands_of(height: int, rows: int = BAND) -> Iterator[slice]:
    """Yields slices of consecutive rows, so that the whole image is never copied at once."""
    return (slice(row, min(row + rows, height)) for row in range(0, height, rows))


def write_bands(
    path: str | os.PathLike[str],
    spec: Any,
    bands: Iterator[NDArray[Any]],
    *,
    called: str | None = None,
) -> None:
    """Writes an image from bands of rows, in order from the top.

    For a tiled file, a band is one row of tiles.
    """
    with replacing(path) as part:
        file = RowFile(part, spec, called or os.fspath(path))
        for pixels in bands:
            file.add(pixels)
        file.close()


class RowFile:
    """Writer of an image file in bands of rows, in order from the top.

    For a tiled file, a band is one row of tiles. Errors are raised as OSError with a one-line
    message that names the file.
    """

    def __init__(self, part: Path, spec: Any, called: str) -> None:
        """Opens the file.

        Args:
            part: The file.
            spec: OpenImageIO's specification of the file.
            called: File name for error messages.
        """
        import OpenImageIO as oiio

        self._part, self._spec, self._called = str(part), spec, called
        self._row = 0
        output = oiio.ImageOutput.create(self._part)
        if output is None:
            why = one_line(oiio.geterror(), called)
            raise OSError(f"{called}: no writer for this kind: {why}")
        self._output = output
        self._check(self._output.open(self._part, spec))

    def add(self, pixels: NDArray[Any]) -> None:
        """Writes the next rows, with shape (rows, width, channels)."""
        first = self._spec.y + self._row
        self._row += len(pixels)
        last, left = self._spec.y + self._row, self._spec.x
        if self._spec.tile_width:
            ok = self._output.write_tiles(left, left + self._spec.width, first, last, 0, 1, pixels)
        else:
            ok = self._output.write_scanlines(first, last, 0, pixels)
        self._check(ok)

    def close(self) -> None:
        """Completes the file."""
        self._check(self._output.close())
        if self._part.lower().endswith(".png") and not is_whole_png(self._part):
            # OpenImageIO does not check whether the system wrote all data.
            why = why_not_written(self._part, "the file is incomplete")
            raise OSError(f"{self._called}: cannot be written: {why}")

    def _check(self, ok: bool) -> None:
        if ok:
            return
        problem = self._output.geterror()
        self._output.close()
        problem = problem or self._output.geterror()
        why = why_not_written(self._part, one_line(problem, self._part))
        raise OSError(f"{self._called}: cannot be written: {why}")


def _values(rows: NDArray[Any], as_half: bool) -> NDArray[np.float32]:
    values = np.asarray(rows, dtype=np.float32)
    if as_half:
        clamped = np.clip(values, -_HALF_MAX, _HALF_MAX)
        values = np.where(np.isfinite(values), clamped, values)
    return values
