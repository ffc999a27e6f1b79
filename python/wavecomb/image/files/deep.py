# SPDX-License-Identifier: Apache-2.0
"""Deep images, with several samples by depth in each pixel, and their EXR files (docs/deep.md)."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.errors import WavecombError
from wavecomb.image.files.exr import BAND, Window, bands_of, set_attributes
from wavecomb.image.files.output_file import one_line, replacing, why_not_written

CHANNELS = ("R", "G", "B", "A", "Z", "ZBack")
"""Channels of a deep sample, in the column order of ``DeepPicture.samples``."""
_HALF_MAX = 65504.0


@dataclass(frozen=True, repr=False)
class DeepPicture:
    """A deep image, with several samples by depth in each pixel. Row 0 is at the top.

    Attributes:
        counts: Number of samples of each pixel, with shape (height, width).
        samples: R, G, B, A, Z and ZBack of all samples, with shape (n, 6). The pixels are in row
            order, and the samples of a pixel are sorted from near to far. Colours are
            premultiplied. Z is the depth along the camera's axis in scene units. ZBack is larger
            than Z in samples of volumes.
    """

    counts: NDArray[np.uint32]
    samples: NDArray[np.float32]

    def flat(self) -> NDArray[np.float64]:
        """Composites the samples of each pixel. Returns premultiplied RGBA (height, width, 4).

        >>> one = DeepPicture(np.full((1, 1), 2), np.array([[.5, 0, 0, .5, 1, 1.], [1] * 6]))
        >>> one.flat()[0, 0].tolist()
        [1.0, 0.5, 0.5, 1.0]
        """
        counts = self.counts.ravel().astype(np.int64)
        first = np.cumsum(counts) - counts
        out = np.zeros((len(counts), 4))
        for k in range(int(counts.max(initial=0))):
            pixels = np.flatnonzero(counts > k)
            sample = self.samples[first[pixels] + k, :4].astype(np.float64)
            out[pixels] += (1.0 - out[pixels, 3:]) * sample
        return out.reshape(*self.counts.shape, 4)

    def save(
        self,
        path: str | os.PathLike[str],
        *,
        half: bool = False,
        metadata: Mapping[str, Any] | None = None,
        window: Window | None = None,
    ) -> Path:
        """Writes a deep OpenEXR file atomically.

        Args:
            path: File name that ends in .exr.
            half: Whether to store colours and alpha as 16-bit floats. Depths are always 32-bit
                floats.
            metadata: File attributes, as for ``write_exr``.
            window: Position of the pixels in a larger image, as for ``write_exr``.

        Raises:
            WavecombError: The name does not end in .exr.
            OSError: The file cannot be written.
        """
        name = os.fspath(path)
        if Path(name).suffix.lower() != ".exr":
            raise WavecombError(f"{name}: the name of a deep image must end in .exr")
        spec = self._spec(half, metadata or {}, window)
        with replacing(path) as part:
            self._write(str(part), spec, name)
        return Path(path)

    def _spec(self, half: bool, metadata: Mapping[str, Any], window: Window | None) -> Any:
        import OpenImageIO as oiio

        height, width = self.counts.shape
        spec = oiio.ImageSpec(width, height, len(CHANNELS), "float")
        spec.deep = True
        spec.channelnames = CHANNELS
        kinds = ("half" if half else "float",) * 4 + ("float", "float")
        spec.channelformats = tuple(oiio.TypeDesc(kind) for kind in kinds)
        if window is not None:
            spec.x, spec.y, spec.full_width, spec.full_height = window
        set_attributes(spec, {**metadata, "compression": "zips"})
        return spec

    def _write(self, part: str, spec: Any, called: str) -> None:
        import OpenImageIO as oiio

        output: Any = oiio.ImageOutput.create(part)

        def check(ok: bool) -> None:
            if not ok:
                why = why_not_written(part, one_line(output.geterror(), part))
                output.close()
                raise OSError(f"{called}: cannot be written: {why}")

        check(output.open(part, spec))
        end = np.cumsum(self.counts.sum(axis=1, dtype=np.int64))
        is_half = str(spec.channelformats[0]) == "half"
        for rows in bands_of(len(self.counts), BAND):
            samples = self.samples[end[rows.start - 1] if rows.start else 0 : end[rows.stop - 1]]
            data = _deep_data(spec, self.counts[rows], _clamped(samples) if is_half else samples)
            check(output.write_deep_scanlines(spec.y + rows.start, spec.y + rows.stop, 0, data))
        check(output.close())


def _clamped(samples: NDArray[np.float32]) -> NDArray[np.float32]:
    """Clamps colours to the range of 16-bit floats."""
    out = samples.copy()
    out[:, :4] = np.clip(out[:, :4], -_HALF_MAX, _HALF_MAX)
    return out


def _deep_data(spec: Any, counts: NDArray[np.uint32], samples: NDArray[np.float32]) -> Any:
    """Converts some rows of the deep image to OpenImageIO's ``DeepData``."""
    import OpenImageIO as oiio

    data = oiio.DeepData()
    data.init(counts.size, len(CHANNELS), spec.channelformats, CHANNELS)
    flat = counts.ravel().astype(np.int64)
    there = np.flatnonzero(flat)
    _run(data.set_samples, there, flat[there])
    pixels = np.repeat(np.arange(flat.size), flat)
    places = np.arange(len(pixels)) - np.repeat(np.cumsum(flat) - flat, flat)
    for channel in range(len(CHANNELS)):
        channels = np.full(len(pixels), channel)
        _run(data.set_deep_value, pixels, channels, places, samples[:, channel])
    return data


def _run(function: Any, *columns: NDArray[Any]) -> None:
    """Calls ``function`` once for each row, with the values of all columns as arguments."""
    deque(map(function, *(column.tolist() for column in columns)), maxlen=0)


def deep_of(pair: tuple[Any, Any] | None) -> DeepPicture | None:
    """Converts a deep image of the core. Returns None if the core has no deep image."""
    return None if pair is None else DeepPicture(*pair)
