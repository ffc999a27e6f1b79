# SPDX-License-Identifier: Apache-2.0
"""Reads and writes NumPy archives (.npz) with a JSON header.

Reading an untrusted archive needs at most as much memory as the archive's file size.
"""

from __future__ import annotations

import json
import os
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from wavecomb.errors import WavecombError
from wavecomb.image.files.output_file import check_regular, replacing
from wavecomb.version import version

MAX_HEADER = 1 << 24
"""Maximum number of bytes of an archive's header."""

MAX_ENTRIES = 4096


class ArchiveError(Exception):
    """A file is not an archive of the expected kind, or is damaged."""


def read_archive(path: str | os.PathLike[str]) -> tuple[Any, dict[str, Any]]:
    """Reads an uncompressed archive.

    Returns the archive's header as parsed JSON, and all other arrays.

    Raises:
        ArchiveError: The file is not an archive, is damaged, or declares more data than it
            contains.
        OSError: The file cannot be opened.
    """
    with Path(path).open("rb") as file:
        try:
            _check_sizes(file)
            with np.load(file, allow_pickle=False) as archive:
                header = archive["header"]
                if header.nbytes > MAX_HEADER:
                    raise ArchiveError("its header is too large")
                return json.loads(header.tobytes()), {
                    name: archive[name] for name in archive.files if name != "header"
                }
        except ArchiveError:
            raise
        # RuntimeError includes the RecursionError of deeply nested JSON, and the
        # NotImplementedError and RuntimeError of unsupported zip files.
        except (
            ValueError, KeyError, TypeError, AttributeError, EOFError, OSError, OverflowError,
            MemoryError, RuntimeError, SyntaxError, struct.error, zipfile.BadZipFile, zlib.error,
            tokenize.TokenError,
        ) as error:  # fmt: skip
            raise ArchiveError(f"{type(error).__name__}: {error}") from error


def write_archive(
    path: str | os.PathLike[str],
    header: Mapping[str, Any],
    arrays: Mapping[str, Any],
    *,
    durable: bool = False,
) -> None:
    """Writes an archive atomically, in the form that ``read_archive`` reads.

    Args:
        path: The file.
        header: Values that are stored as the JSON header.
        arrays: Numeric arrays by name.
        durable: Whether the file must be on disk, not only in the system's cache, before it gets
            its name.
    """
    parts = {name: np.asarray(value) for name, value in arrays.items()}
    parts["header"] = np.frombuffer(json.dumps(header).encode("utf-8"), np.uint8)
    with replacing(path, durable=durable) as part, part.open("wb") as file:
        np.savez(file, **parts)  # type: ignore[arg-type]


def read_kind(
    path: str | os.PathLike[str], kind: str, of_format: int, option: str, advice: str
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Reads a Wavecomb archive, whose header states its kind, format and version.

    Args:
        path: The file.
        kind: Expected kind.
        of_format: Format number that the header must have.
        option: Option of `wavecomb render` that writes such a file.
        advice: Advice in the error message for a file with another format.

    Raises:
        ArchiveError: The file is damaged, or it is an archive of another kind.
        OSError: The file cannot be opened.
        WavecombError: The file has another format.
    """
    name = os.fspath(path)
    if not Path(name).exists():
        raise FileNotFoundError(f"{name}: no such file; a render with {option} makes one")
    check_regular(name)
    header, arrays = read_archive(name)
    if not isinstance(header, dict) or header.get("kind") != kind:
        raise ArchiveError("it is of another kind")
    if header.get("format") != of_format:
        raise WavecombError(
            f"{name}: has format {header.get('format')} and was written by Wavecomb "
            f"{header.get('version')}; this is Wavecomb {version()}, which reads format "
            f"{of_format}: {advice}"
        )
    return header, arrays


def _check_sizes(file: Any) -> None:
    """Raises ArchiveError if the members of an archive declare more bytes than the file has."""
    size = os.fstat(file.fileno()).st_size
    with zipfile.ZipFile(file) as archive:
        parts = archive.infolist()
        if len(parts) > MAX_ENTRIES:
            raise ArchiveError(f"it has {len(parts)} parts")
        if any(part.compress_type != zipfile.ZIP_STORED for part in parts):
            raise ArchiveError("it is compressed")
        if sum(part.file_size for part in parts) > size:
            raise ArchiveError("it declares more data than it holds")
        for part in parts:
            with archive.open(part) as member:
                _check_shape(member, part.file_size)
    file.seek(0)


def _check_shape(member: Any, size: int) -> None:
    """Raises ArchiveError if an array declares more values than the archive contains."""
    version = np.lib.format.read_magic(member)
    if version == (1, 0):
        shape, _, dtype = np.lib.format.read_array_header_1_0(member)
    elif version == (2, 0):
        shape, _, dtype = np.lib.format.read_array_header_2_0(member)
    else:
        raise ArchiveError(f"its arrays are of version {version}")
    count = 1
    for edge in shape:
        count *= edge
    if min(shape, default=1) < 0 or dtype.hasobject or count * dtype.itemsize > size:
        raise ArchiveError("it declares more data than it holds")
