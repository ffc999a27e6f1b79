# SPDX-License-Identifier: Apache-2.0
"""Image files to arrays, on threads of their own ahead of need."""

from __future__ import annotations

import os
import tempfile
from collections import deque
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pxr import Ar

from wavecomb.files import problem_of
from wavecomb.isolate import trail
from wavecomb.machine import usable_cores

if TYPE_CHECKING:
    from concurrent.futures import Future, ThreadPoolExecutor

MAX_SIDE = 65536
MAX_BYTES = 8 << 30


Stamp = tuple[int, int]
"""When a file was changed, in ns, and its size in bytes."""


class TextureError(ValueError):
    """An image that cannot be used; says why in a few words."""


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
            raise TextureError("no such file")
        return _read_file(path, stamp, header_only)
    asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path))
    if not asset:
        raise TextureError("no such file in the package")
    data = bytes(asset.GetBuffer())
    suffix = Path(Ar.SplitPackageRelativePathInner(path)[1]).suffix
    descriptor, name = tempfile.mkstemp(suffix=suffix, prefix="wavecomb-")
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(data)
        return _read_file(name, stamp, header_only)
    finally:
        os.unlink(name)


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


def _read_file(path: str, stamp: Stamp | None, header_only: bool = False) -> Image:
    # Not before an image is read: the library takes 30 MB as soon as it is loaded.
    import OpenImageIO as oiio

    trail.note("decoding", path, "image")
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
        size = spec.width * spec.height * channels * np.dtype(dtype).itemsize
        if max(spec.width, spec.height) > MAX_SIDE or size > MAX_BYTES or spec.depth > 1:
            raise TextureError(f"{spec.width} x {spec.height} is too large")
        if header_only:
            nothing = np.broadcast_to(np.zeros(1, dtype), (spec.height, spec.width, channels))
            return Image(nothing, stamp, _wraps(spec), _encoded(spec))
        ask = oiio.TypeDesc(oiio.UINT8 if base == oiio.UINT8 else oiio.FLOAT)
        pixels = source.read_image(0, 0, 0, channels, ask)
        if pixels is None:
            raise TextureError(" ".join(problem_of(source).split()) or "it cannot be read")
    finally:
        source.close()
        trail.note("", "", "image")
    pixels = np.asarray(pixels).reshape(spec.height, spec.width, channels)
    if pixels.dtype != np.uint8:
        limit = 65504.0 if dtype == np.float16 else 3.4e38
        pixels = np.nan_to_num(pixels, copy=False, nan=0.0, posinf=limit, neginf=-limit)
    return Image(np.ascontiguousarray(pixels, dtype), stamp, _wraps(spec), _encoded(spec))


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
        """Of the pixels that are ready or under way; 0 where no limit was set."""
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
