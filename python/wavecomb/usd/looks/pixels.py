# SPDX-License-Identifier: Apache-2.0
"""Image files to arrays, on threads of their own ahead of need."""

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

from wavecomb.machine import usable_cores
from wavecomb.picture.files import kind_of, problem_of
from wavecomb.run.isolate import trail

if TYPE_CHECKING:
    from concurrent.futures import Future, ThreadPoolExecutor

MAX_SIDE = 65536
MAX_BYTES = 8 << 30
"""Most memory that decoding one image may take."""


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


class TextureError(ValueError):
    """An image that cannot be used; says why in a few words."""


def stamp_of(path: str) -> Stamp | None:
    """The stamp of a file, or of the package that it is in; None: it is not there."""
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
        TextureError: It is missing, unreadable or too large.
    """
    return _read(path, False)


def read_header(path: str) -> Image:
    """As ``read_image``, but for the pixels: they are all 0 and take no memory.

    Raises:
        TextureError: Likewise.
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
"""Kinds that OpenImageIO tells by the name only."""


@contextmanager
def _unpacked(data: Any, name: str) -> Iterator[str]:
    """A file with the content of one in a package, by a name that it has while this lasts.

    It is in memory and has no name in any folder: whatever ends this process, nothing is left.
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
    # The ending is one of ours: a package may call its files as it likes.
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
    """WrapS and wrapT of a file, or ``wrapmodes`` as texture tools write it; else black."""
    both = str(spec.getattribute("wrapmodes") or "").split(",")
    words = [
        spec.getattribute(name) or both[min(i, len(both) - 1)]
        for i, name in enumerate(("wrapS", "wrapT"))
    ]
    s, t = (_WRAP_WORDS.get(str(word).strip(), "black") for word in words)
    return s, t


def _encoded(spec: Any) -> bool | None:
    """Whether a file of a coloured image says that it is sRGB, or linear; None: neither."""
    if spec.nchannels < 3:
        return None
    if str(spec.getattribute("oiio:ColorSpace") or "").startswith("lin"):
        return False
    profile = str(spec.getattribute("ICCProfile:profile_description") or "")
    return True if spec.getattribute("Exif:ColorSpace") == 1 or "sRGB" in profile else None


def _read_file(
    path: str, stamp: Stamp | None, header_only: bool = False, called: str | None = None
) -> Image:
    """``called``: the file in messages."""
    # Not before an image is read: the library takes 30 MB as soon as it is loaded.
    import OpenImageIO as oiio

    trail.note("decoding", called or path, "image")
    # Colours as stored: not multiplied by alpha.
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    source = oiio.ImageInput.open(path, config)
    if source is None:
        trail.note("", "", "image")
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
        trail.note("", "", "image")
    return Image(pixels, stamp, _wraps(spec), _encoded(spec))


_BAND = 64
"""Rows that are converted at a time, where the library's type is not ours."""


def _decoding_bytes(spec: Any, channels: int, itemsize: int, asked: int) -> int:
    """Memory that decoding takes at most: what the library may hold, what it gives, what we keep.

    Args:
        spec: Of the file.
        channels: That we keep.
        itemsize: Of our values, bytes.
        asked: Of those that the library gives.
    """
    pixels = int(spec.width) * int(spec.height)
    held = spec.pixel_bytes(True) + channels * itemsize
    if itemsize != asked and spec.tile_width:
        held += channels * asked
    return pixels * held


def _decoded(source: Any, spec: Any, channels: int, dtype: Any, ask: Any) -> NDArray[Any] | None:
    """The pixels as they are kept, finite; None where the library cannot read them."""
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
"""Bits of positive and negative infinity, by the size of the type."""


def is_finite(pixels: NDArray[Any]) -> bool:
    """Whether all float16 or float32 values are, in any number of dimensions.

    As whole numbers: NumPy looks at float16 one value at a time, and takes longer than decoding.
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
    """Reads images before they are asked for.

    Contract: used by one thread. At most one more than ``threads`` images lie ready, so that memory
    is bounded; whatever is asked for and not under way is read at once.
    """

    def __init__(self, threads: int = 0, limit_bytes: int | None = None) -> None:
        """``threads`` read, 0: one for each core; with 1 nothing is read ahead.

        ``limit_bytes``: of the pixels that lie ready or are under way; None: any.
        """
        self._threads = threads or usable_cores()
        self._limit_bytes = limit_bytes
        self._sizes: dict[str, int] = {}
        self._pool: ThreadPoolExecutor | None = None
        self._seen: set[str] = set()
        self._waiting: deque[str] = deque()
        self._ready: dict[str, Future[Image]] = {}

    def want(self, paths: Iterable[str]) -> None:
        """Says that images will be asked for, most likely in this order."""
        if self._threads == 1:
            return
        for path in paths:
            if path and path not in self._seen:
                self._seen.add(path)
                self._waiting.append(path)
        self._start()

    def read(self, path: str) -> Image:
        """As ``read_image``, from what was read ahead where it was."""
        self._seen.add(path)
        future = self._ready.pop(path, None)
        if future is None:
            if path in self._waiting:
                self._waiting.remove(path)
            return read_image(path)
        try:
            return future.result()
        finally:
            # Its exception holds this frame: a circle that would keep the stage open.
            del future
            self._start()

    def close(self) -> None:
        """Drops what was not asked for."""
        self._waiting.clear()
        self._ready.clear()
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)
            self._pool = None

    @property
    def bytes(self) -> int:
        """Memory of the pixels that are ready or under way; 0 where no limit was set."""
        return sum(self._sizes[path] for path in self._ready) if self._sizes else 0

    def _fits(self, path: str) -> bool:
        """Whether an image may be read now, beside those that are ready."""
        if self._limit_bytes is None:
            return True
        if path not in self._sizes:
            try:
                header = read_header(path)
                bytes_ = header.size[0] * header.size[1] * header.channels * header.dtype.itemsize
            except (TextureError, OSError, ValueError):
                bytes_ = 0  # reading it says what is wrong
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
