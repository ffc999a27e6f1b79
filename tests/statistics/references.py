# SPDX-License-Identifier: Apache-2.0
"""Disk cache of Mitsuba's reference images, keyed by a hash of everything that they depend on.

The hash covers the recorded scene, settings, number of samples, seed, Mitsuba's version and
variant, and the sources that translate a scene. Images are in build/references;
`WAVECOMB_REFERENCES=0` renders every image again, and `make clean` removes the images.
"""

from __future__ import annotations

import dataclasses
import hashlib
import os
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from parts import is_on

if TYPE_CHECKING:
    from mitsuba_bridge import MitsubaScene, PeerSettings
    from recorded import Recorded

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "build" / "references"
MAX_BYTES = 300_000_000
"""Size of the cache; beyond it, the least recently used images are removed."""

Image = NDArray[np.float32]


class Cache:
    """Arrays stored in a folder by key."""

    def __init__(self, folder: Path, most_bytes: int = MAX_BYTES) -> None:
        self._folder = folder
        self._most_bytes = most_bytes

    def get(self, key: str, make: Callable[[], Image]) -> Image:
        """Return the array of a key; make it if it is missing or unreadable."""
        path = self._folder / f"{key}.npy"
        try:
            found: Image = np.load(path)
            os.utime(path)
            return found
        except (OSError, ValueError, EOFError):
            pass
        made = make()
        self._folder.mkdir(parents=True, exist_ok=True)
        # Write to a temporary file first: pytest workers share the folder.
        handle, part = tempfile.mkstemp(dir=self._folder, suffix=".part")
        with os.fdopen(handle, "wb") as file:
            np.save(file, made)
        os.replace(part, path)
        self._prune()
        return made

    def _prune(self) -> None:
        files = []
        for path in self._folder.glob("*.npy"):
            try:
                state = path.stat()
            except OSError:
                continue
            files.append((state.st_mtime, state.st_size, path))
        total = sum(size for _, size, _ in files)
        for _, size, path in sorted(files):
            if total <= self._most_bytes:
                break
            path.unlink(missing_ok=True)
            total -= size


def key_of(*values: Any) -> str:
    """Hash of numbers, texts, bytes, arrays, and containers of them.

    Raises:
        TypeError: A value has another type, whose content cannot be hashed.
    """
    told = hashlib.sha256()

    def tell(value: Any) -> None:
        if isinstance(value, np.ndarray):
            told.update(f"array {value.dtype.str} {value.shape} ".encode())
            told.update(np.ascontiguousarray(value).tobytes())
        elif dataclasses.is_dataclass(value) and not isinstance(value, type):
            told.update(f"{type(value).__name__} ".encode())
            tell({one.name: getattr(value, one.name) for one in dataclasses.fields(value)})
        elif isinstance(value, dict):
            told.update(f"dict {len(value)} ".encode())
            for name in sorted(value):
                tell(name)
                tell(value[name])
        elif isinstance(value, (list, tuple)):
            told.update(f"list {len(value)} ".encode())
            for one in value:
                tell(one)
        elif isinstance(value, np.generic):
            tell(value.item())
        elif isinstance(value, bytes):
            told.update(f"bytes {len(value)} ".encode() + value)
        elif value is None or isinstance(value, (bool, int, float, str)):
            told.update(f"{type(value).__name__} {len(repr(value))} {value!r} ".encode())
        else:
            raise TypeError(f"cannot hash a {type(value).__name__}")

    for value in values:
        tell(value)
    return told.hexdigest()


@cache
def _sources() -> str:
    """Hash of the sources that translate a scene."""
    peers = ROOT / "benchmarks" / "peers"
    files = [peers / "recorded.py", *sorted(peers.glob("mitsuba_*.py"))]
    return key_of({file.name: file.read_bytes() for file in files})


class Reference:
    """A recorded scene as Mitsuba renders it. Mitsuba is only used if an image is not cached."""

    def __init__(
        self,
        mitsuba: ModuleType,
        recorded: Recorded,
        settings: PeerSettings,
        kind: type[MitsubaScene] | None = None,
        about: object = (),
    ) -> None:
        """Take the arguments of a ``MitsubaScene``.

        Args:
            mitsuba: The module.
            recorded: The scene.
            settings: Image size and path depth.
            kind: Class derived from ``MitsubaScene`` that adds features which cannot be recorded.
            about: All parameters of that class; part of the cache key.
        """
        from mitsuba_bridge import MitsubaScene
        from recorded import Recorded

        self._kind = kind or MitsubaScene
        self._arguments = (mitsuba, recorded, settings)
        self._peer: MitsubaScene | None = None
        self._is_kept = "WAVECOMB_REFERENCES" not in os.environ or is_on("WAVECOMB_REFERENCES")
        self._key = ""
        if self._is_kept:
            # Skip attributes that only the recording has, such as the scene that it built.
            names = [one.name for one in dataclasses.fields(Recorded)]
            content = {name: getattr(recorded, name) for name in names}
            # The name of a texture is its file path, in a temporary folder.
            content["textures"] = [
                {key: value for key, value in one.items() if key != "name"}
                for one in recorded.textures
            ]
            tool = [mitsuba.__version__, mitsuba.variant(), _sources()]
            self._key = key_of(tool, content, settings, about)

    def render(self, spp: int, seed: int = 0) -> Image:
        """Render ``spp`` samples per pixel, or return the cached image."""
        if not self._is_kept:
            return self._render(spp, seed)
        key = key_of(self._key, spp, seed)
        return Cache(FOLDER).get(key, lambda: self._render(spp, seed))

    def _render(self, spp: int, seed: int) -> Image:
        if self._peer is None:
            self._peer = self._kind(*self._arguments)
        return self._peer.render(spp, seed)
