# SPDX-License-Identifier: Apache-2.0
"""Decodes image files to arrays; separate threads decode images before they are needed."""

from __future__ import annotations

import os
import tempfile
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pxr import Ar

from wavecomb.image.files.output_file import kind_of, problem_of
from wavecomb.machine import usable_cores
from wavecomb.run.isolation import progress_notes

if TYPE_CHECKING:
    from concurrent.futures import Future, ThreadPoolExecutor

MAX_SIDE = 65536
MAX_BYTES = 8 << 30
"""Maximum memory that decoding an image may take, in bytes."""


Stamp = tuple[int, int]
"""Identifies a version of a file by modification time in ns and size in bytes."""


class Image:
    """An image with 1 to 4 channels, as uint8, float16 or float32; row 0 is the top.

    Attributes:
        size: Height and width.
        channels: Number of channels.
        dtype: Type of the pixel values.
        stamp: Stamp of the file before it was read; None if unknown.
        wraps: Wrap modes in s and t that the file declares: black, clamp, repeat or mirror.
        encoded: Whether the file declares sRGB encoding; None if the file declares no encoding.
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
        """Whether the image still holds its pixels."""
        return self._pixels is not None

    def take(self) -> NDArray[Any]:
        """Returns the pixels and releases them from the image.

        Raises:
            ValueError: The pixels were taken before.
        """
        pixels, self._pixels = self._pixels, None
        if pixels is None:
            raise ValueError("the pixels of this image were taken before")
        return pixels

    @property
    def automatic_srgb(self) -> bool:
        """Whether ``sourceColorSpace = auto`` means sRGB.

        If the file declares no encoding, 8-bit images with 3 or 4 channels are sRGB.
        """
        if self.encoded is not None:
            return self.encoded
        return self.dtype == np.uint8 and self.channels >= 3


class TextureError(ValueError):
    """Raised if an image file cannot be used; the message gives the reason."""


def stamp_of(path: str) -> Stamp | None:
    """Returns the stamp of a file or of its .usdz package; None if the file does not exist."""
    if Ar.IsPackageRelativePath(path):
        path = Ar.SplitPackageRelativePathOuter(path)[0]
    try:
        state = os.stat(path)
    except (OSError, ValueError):
        return None
    return state.st_mtime_ns, state.st_size


def read_image(path: str) -> Image:
    """Reads the first image of a file, or of a file in a package (``a.usdz[b.png]``).

    Raises:
            TextureError: The image is missing, unreadable or too large.
    """
    return _read(path, False)


def read_header(path: str) -> Image:
    """Reads only the header of an image; the pixels are all 0 and take no memory.

    Raises:
        TextureError: The image is missing, unreadable or too large.
    """
    return _read(path, True)


def _read(path: str, header_only: bool) -> Image:
    if not path:
        raise TextureError("no file name")
    stamp = stamp_of(path)
    if not Ar.IsPackageRelativePath(path):
        if not os.path.isfile(path):
            raise TextureError(_why_missing(path))
        return _read_file(path, stamp, header_only)
    asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path))
    if not asset:
        raise TextureError("no such file in the package")
    with _unpacked(asset.GetBuffer(), Ar.SplitPackageRelativePathInner(path)[1]) as name:
        return _read_file(name, stamp, header_only, path)


def _why_missing(path: str) -> str:
    kind = kind_of(path)
    return "no such file" if kind is None else f"it is {kind}, not a regular file"


_BY_ENDING = (".jp2", ".j2k", ".j2c", ".jph")
"""File extensions of the formats that OpenImageIO recognises only by extension."""


@contextmanager
def _unpacked(data: Any, name: str) -> Iterator[str]:
    """Yields the name of a temporary file with the contents of a file in a package.

    If possible, the file is in anonymous memory, so that it vanishes if the process is killed.
    """
    ending = Path(name).suffix.lower()
    if ending not in _BY_ENDING and hasattr(os, "memfd_create"):
        descriptor = os.memfd_create("wavecomb-image", os.MFD_CLOEXEC)
        try:
            _write_all(descriptor, data)
            yield f"/proc/self/fd/{descriptor}"
        finally:
            os.close(descriptor)
        return
    # Use only known extensions for the temporary file, since file names in packages are arbitrary.
    ending = ending if ending in _BY_ENDING else ""
    descriptor, file = tempfile.mkstemp(suffix=ending, prefix="wavecomb-")
    try:
        try:
            _write_all(descriptor, data)
        finally:
            os.close(descriptor)
        yield file
    finally:
        os.unlink(file)


def _write_all(descriptor: int, data: Any) -> None:
    rest = memoryview(data or b"")
    while len(rest):
        rest = rest[os.write(descriptor, rest) :]


_WRAP_WORDS = {"periodic": "repeat"} | {w: w for w in ("black", "clamp", "repeat", "mirror")}


def _wraps(spec: Any) -> tuple[str, str]:
    """Returns the wrap modes in s and t that a file declares; black if there are none."""
    both = str(spec.getattribute("wrapmodes") or "").split(",")
    words = [
        spec.getattribute(name) or both[min(i, len(both) - 1)]
        for i, name in enumerate(("wrapS", "wrapT"))
    ]
    s, t = (_WRAP_WORDS.get(str(word).strip(), "black") for word in words)
    return s, t


def _encoded(spec: Any) -> bool | None:
    """Returns whether a file declares its colours as sRGB (True) or linear (False), else None."""
    if spec.nchannels < 3:
        return None
    if str(spec.getattribute("oiio:ColorSpace") or "").startswith("lin"):
        return False
    profile = str(spec.getattribute("ICCProfile:profile_description") or "")
    return True if spec.getattribute("Exif:ColorSpace") == 1 or "sRGB" in profile else None


def _read_file(
    path: str, stamp: Stamp | None, header_only: bool = False, called: str | None = None
) -> Image:
    """Reads an image file; ``called`` is its name in messages."""
    # Import OpenImageIO only when an image is read, since the library takes 30 MB of memory.
    import OpenImageIO as oiio

    progress_notes.note("decoding", called or path, "image")
    # Read colours as they are stored in the file, without multiplying them by alpha.
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    source = oiio.ImageInput.open(path, config)
    if source is None:
        progress_notes.note("", "", "image")
        raise TextureError(" ".join(problem_of(oiio).split()) or "not a known image file")
    try:
        spec = source.spec()
        channels = min(spec.nchannels, 4)
        base = spec.format.basetype
        dtype = {oiio.UINT8: np.uint8, oiio.HALF: np.float16, oiio.UINT16: np.float16}.get(
            base, np.float32
        )
        if spec.width < 1 or spec.height < 1 or channels < 1:
            raise TextureError("it has no pixels")
        known = oiio.UINT8, oiio.HALF
        ask = oiio.TypeDesc(base if base in known else oiio.FLOAT)
        size = _decoding_bytes(spec, channels, np.dtype(dtype).itemsize, ask.basesize())
        if max(spec.width, spec.height) > MAX_SIDE or size > MAX_BYTES or spec.depth > 1:
            raise TextureError(f"{spec.width} x {spec.height} is too large")
        if header_only:
            nothing = np.broadcast_to(np.zeros(1, dtype), (spec.height, spec.width, channels))
            return Image(nothing, stamp, _wraps(spec), _encoded(spec))
        pixels = _decoded(source, spec, channels, dtype, ask)
        if pixels is None:
            raise TextureError(" ".join(problem_of(source).split()) or "it cannot be read")
    finally:
        source.close()
        progress_notes.note("", "", "image")
    return Image(pixels, stamp, _wraps(spec), _encoded(spec))


_BAND = 64
"""Number of rows that are converted together if OpenImageIO's type differs from the stored type."""


def _decoding_bytes(spec: Any, channels: int, itemsize: int, asked: int) -> int:
    """Returns an upper bound of the memory that decoding takes, in bytes.

    The memory holds OpenImageIO's buffers, its result and the stored pixels.

    Args:
        spec: OpenImageIO's description of the file.
        channels: Number of channels to store.
        itemsize: Size of a stored channel value, in bytes.
        asked: Size of a channel value that OpenImageIO returns, in bytes.
    """
    pixels = int(spec.width) * int(spec.height)
    held = spec.pixel_bytes(True) + channels * itemsize
    if itemsize != asked and spec.tile_width:
        held += channels * asked
    return pixels * held


def _decoded(source: Any, spec: Any, channels: int, dtype: Any, ask: Any) -> NDArray[Any] | None:
    """Returns the pixels in their stored type, with finite values; None if they cannot be read."""
    shape = spec.height, spec.width, channels
    if np.dtype(dtype).itemsize == ask.basesize() or spec.tile_width:
        pixels = source.read_image(0, 0, 0, channels, ask)
        if pixels is None:
            return None
        return _finite(np.asarray(pixels).reshape(shape), dtype)
    kept = np.empty(shape, dtype)
    for row in range(0, spec.height, _BAND):
        end = min(row + _BAND, spec.height)
        band = source.read_scanlines(spec.y + row, spec.y + end, 0, 0, channels, ask)
        if band is None:
            return None
        kept[row:end] = _finite(np.asarray(band).reshape(end - row, *shape[1:]), dtype)
    return kept


def _finite(pixels: NDArray[Any], dtype: Any) -> NDArray[Any]:
    if pixels.dtype != np.uint8 and not is_finite(pixels):
        limit = 65504.0 if dtype == np.float16 else 3.4e38
        pixels = np.nan_to_num(pixels, copy=False, nan=0.0, posinf=limit, neginf=-limit)
    return np.ascontiguousarray(pixels, dtype)


_EXPONENTS = {2: (0x7C00, 0xFC00), 4: (0x7F800000, 0xFF800000)}
"""Bit patterns of positive and negative infinity, by the size of the float type in bytes."""


def is_finite(pixels: NDArray[Any]) -> bool:
    """Returns whether all float16 or float32 values are finite, for any number of dimensions.

    For float16, comparing bit patterns is faster; NumPy's isfinite takes longer than decoding.
    """
    size = pixels.dtype.itemsize
    if pixels.size == 0 or size not in _EXPONENTS or not pixels.flags.c_contiguous:
        return bool(np.isfinite(pixels).all())
    positive, negative = _EXPONENTS[size]
    flat = pixels.reshape(-1)
    return bool(
        int(flat.view(f"<i{size}").max()) < positive
        and int(flat.view(f"<u{size}").max()) < negative
    )


class ReadAhead:
    """Reads images on separate threads before they are needed.

    Contract: only one thread uses this object. At most ``threads`` + 1 images are ready or being
    read, which bounds memory. A requested image that no thread reads yet is read immediately.
    """

    def __init__(self, threads: int = 0, limit_bytes: int | None = None) -> None:
        """``threads`` is the number of reader threads: 0 means one per core, 1 never reads ahead.

        ``limit_bytes`` limits the pixels that are ready or being read; None means no limit.
        """
        self._threads = threads or usable_cores()
        self._limit_bytes = limit_bytes
        self._sizes: dict[str, int] = {}
        self._pool: ThreadPoolExecutor | None = None
        self._seen: set[str] = set()
        self._waiting: deque[str] = deque()
        self._ready: dict[str, Future[Image]] = {}

    def want(self, paths: Iterable[str]) -> None:
        """Queues images that will be needed, in the order in which they are expected."""
        if self._threads == 1:
            return
        for path in paths:
            if path and path not in self._seen:
                self._seen.add(path)
                self._waiting.append(path)
        self._start()

    def read(self, path: str) -> Image:
        """Returns the result of ``read_image``, which may have been read ahead."""
        self._seen.add(path)
        future = self._ready.pop(path, None)
        if future is None:
            if path in self._waiting:
                self._waiting.remove(path)
            return read_image(path)
        try:
            return future.result()
        finally:
            # Delete the future, whose exception refers to this stack frame. The reference cycle
            # would keep the stage open.
            del future
            self._start()

    def close(self) -> None:
        """Discards images that were read ahead but not requested."""
        self._waiting.clear()
        self._ready.clear()
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)
            self._pool = None

    @property
    def bytes(self) -> int:
        """Memory of the pixels that are ready or being read; 0 if there is no limit."""
        return sum(self._sizes[path] for path in self._ready) if self._sizes else 0

    def _fits(self, path: str) -> bool:
        """Returns whether reading another image would keep the memory within the limit."""
        if self._limit_bytes is None:
            return True
        if path not in self._sizes:
            try:
                header = read_header(path)
                bytes_ = header.size[0] * header.size[1] * header.channels * header.dtype.itemsize
            except (TextureError, OSError, ValueError):
                # Ignore the error here. It is reported when the image is read for the scene.
                bytes_ = 0
            self._sizes[path] = bytes_
        return self._sizes[path] + self.bytes <= self._limit_bytes

    def _start(self) -> None:
        while self._waiting and len(self._ready) <= self._threads:
            if not self._fits(self._waiting[0]):
                return
            if self._pool is None:
                from concurrent.futures import ThreadPoolExecutor

                self._pool = ThreadPoolExecutor(self._threads, "wavecomb-image")
            path = self._waiting.popleft()
            self._ready[path] = self._pool.submit(read_image, path)
