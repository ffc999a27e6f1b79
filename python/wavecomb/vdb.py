# SPDX-License-Identifier: Apache-2.0
"""Interface to OpenVDB and NanoVDB: the only module that imports the plug-in ``wavecomb._vdb``.

The plug-in is built if OpenVDB is installed (tools/setup_openvdb), and loaded only when a .vdb or
.nvdb file is read.
"""

from __future__ import annotations

import functools
import hashlib
import importlib
import uuid
from collections.abc import Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.errors import WavecombError
from wavecomb.run.isolation import memory

if TYPE_CHECKING:
    from collections.abc import Iterator

BRING = "tools/setup_openvdb && make build"
"""Command that adds OpenVDB to a source tree."""

ABSENT = f"OpenVDB, which this build is without ({BRING})"
"""Message if a .vdb file cannot be read without the plug-in."""

BRICK = 8
"""Edge length of a brick in voxels."""

_IDENTIFIER_AT = 21
"""Offset of the identifier in a .vdb file, which is 36 characters long."""

_NUMBERS = {"float", "double", "vec3s", "vec3d", "fp4", "fp8", "fp16", "fpn"}


@dataclass(frozen=True)
class GridHead:
    """Entry of a grid in the table of a .vdb file.

    Attributes:
        number: Position of the grid in the file.
        name: Name of the grid, which several grids may share.
        index: Index among grids with the same name.
        type_name: OpenVDB's type name such as "Tree_float_5_4_3"; in .nvdb files also
            "Tree_fp8_5_4_3".
        is_half: Whether floats are stored in 16 bits.
    """

    number: int
    name: str
    index: int
    type_name: str
    is_half: bool

    @property
    def is_vector(self) -> bool:
        """Whether a value consists of several numbers."""
        return self.type_name.startswith("Tree_vec")

    @property
    def is_of_numbers(self) -> bool:
        """Whether the grid has supported values: a float or three floats, but not integers."""
        return self.type_name.removeprefix("Tree_").partition("_")[0] in _NUMBERS

    @property
    def value_name(self) -> str:
        """OpenVDB's name of the value type, with half variants: "float", "half", "vec3s" ..."""
        word = self.type_name.removeprefix("Tree_").partition("_")[0]
        return {"float": "half", "vec3s": "vec3h"}.get(word, word) if self.is_half else word


@dataclass(frozen=True)
class GridInfo(GridHead):
    """Description of a grid without its values.

    Attributes:
        is_read: Whether the grid can be read as bricks.
        kind: Class of the grid: "fog volume", "level set", "staggered" or "unknown".
        voxels: Number of active voxels.
        box: (2, 3) first and last index of active voxels; None without active voxels.
        index_to_object: (4, 4), p' = p M; None if it is not affine.
        background: Background value of 1 or 3 numbers.
        metadata: Metadata as text.
    """

    is_read: bool = False
    kind: str = "unknown"
    voxels: int = 0
    box: NDArray[np.int32] | None = None
    index_to_object: NDArray[np.float64] | None = None
    background: tuple[float, ...] = ()
    metadata: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Bricks:
    """A grid as bricks of 8^3 voxels.

    Attributes:
        origins: (n, 3) int32, index of the first voxel of each brick.
        values: (n, 8, 8, 8) or (n, 8, 8, 8, 3), float16 or float32, with x slowest.
        index_to_object: Transform (4, 4) as in ``GridInfo``. The attributes background, kind,
            voxels and box have the same meaning as in ``GridInfo``.
        not_finite: Number of infinite and NaN values.
        negative: Number of negative values.
        least: Smallest value, at most 0.
        greatest: Largest value, at least 0.
    """

    origins: NDArray[np.int32]
    values: NDArray[Any]
    index_to_object: NDArray[np.float64] | None
    background: tuple[float, ...]
    kind: str
    voxels: int
    box: NDArray[np.int32] | None
    not_finite: int
    negative: int
    least: float
    greatest: float


@functools.cache
def is_there() -> bool:
    """Returns whether .vdb files can be read; .nvdb files also need ``nano_version``."""
    try:
        _plugin()
    except ImportError:
        return False
    return True


def version() -> str | None:
    """Returns the version of OpenVDB; None if it is not available."""
    return str(_plugin().version) if is_there() else None


def nano_version() -> int | None:
    """Returns the major version of supported .nvdb files; None if no .nvdb file is supported."""
    return int(_plugin().nano_version) or None if is_there() else None


def _plugin() -> Any:
    # Import the core first, since it loads oneTBB, and OpenVDB must use the same copy of oneTBB.
    importlib.import_module("wavecomb._core")
    return importlib.import_module("wavecomb._vdb")


def _needed(path: str | Path) -> Any:
    if not is_there():
        raise WavecombError(f"{path}: needs {ABSENT}")
    return _plugin()


def grid_heads(path: str | Path) -> list[GridHead]:
    """Reads the table of a file and returns its grids.

    Raises:
        WavecombError: The file is not a VDB file or is corrupt, or OpenVDB is missing.
    """
    plugin = _needed(path)
    with _errors(plugin, path):
        found = plugin.grids(str(path), True)
    return [_head(number, one) for number, one in enumerate(found)]


def grids(path: str | Path) -> list[GridInfo]:
    """Returns the grids of a file with their metadata but without values.

    Raises:
        WavecombError: The file is not a VDB file or is corrupt, or OpenVDB is missing.
    """
    plugin = _needed(path)
    with _errors(plugin, path):
        found = plugin.grids(str(path))
    return [_info(number, one) for number, one in enumerate(found)]


def read(
    path: str | Path, head: GridHead, *, background_is_zero: bool = False, whole: bool = True
) -> Bricks:
    """Reads the values of a grid: its leaves, and its active tiles as bricks.

    Args:
        path: The file.
        head: A result of ``grid_heads``.
        background_is_zero: Whether inactive voxels with the background value become 0.
        whole: Whether to include bricks that contain only zeros.

    Raises:
        WavecombError: The file is corrupt, or the grid is too large or has an unsupported type.
    """
    plugin = _needed(path)
    with _errors(plugin, path, head.name):
        # Reading a grid needs memory for OpenVDB's tree and for the bricks at the same time.
        found = plugin.bricks(
            str(path), head.number, memory.available_bytes() // 2, background_is_zero, not whole
        )
    names = ("origins", "values", "kind", "voxels", "not_finite", "negative", "least", "greatest")
    return Bricks(
        index_to_object=_matrix(found["index_to_object"]),
        background=tuple(found["background"]),
        box=_box(found["box"]),
        **{name: found[name] for name in names},
    )


def write(path: str | Path, made: Sequence[Mapping[str, Any]]) -> None:
    """Writes a .vdb file; equal grids give equal bytes.

    Args:
        path: File to write. The caller must make the write atomic.
        made: Grids with ``name``, ``origins``, ``values`` (as in ``Bricks``; float16 is stored in
            16 bits) and ``index_to_object``. With ``tiles``, bricks with a single value are stored
            as tiles, which takes less space. ``boxes`` (first index, last index, value) are filled
            before bricks are added.

    Raises:
        WavecombError: The file has another extension, arrays are inconsistent, the file cannot be
            written, or OpenVDB is missing.
    """
    if Path(path).suffix.lower() == ".nvdb":
        raise WavecombError(f"{path}: .nvdb files are read, not written: name a .vdb file")
    plugin = _needed(path)
    with _errors(plugin, path):
        written = [_described(grid) for grid in made]
        plugin.write(str(path), written)
        # Replace the random identifier that OpenVDB writes by a hash of the grids, so that files
        # are reproducible.
        digest = hashlib.sha256()
        for grid in written:
            digest.update(repr([grid[name] for name in sorted(grid)]).encode())
            digest.update(grid["origins"].tobytes() + grid["values"].tobytes())
        with Path(path).open("r+b") as file:
            file.seek(_IDENTIFIER_AT)
            file.write(str(uuid.UUID(bytes=digest.digest()[:16], version=4)).encode())


def _described(grid: Mapping[str, Any]) -> dict[str, Any]:
    """Returns a grid in the plug-in's form; raises ValueError if its arrays are inconsistent."""
    values, origins = np.asarray(grid["values"]), np.ascontiguousarray(grid["origins"], np.int32)
    channels = 3 if values.ndim == 5 else 1
    count = len(origins)
    if origins.shape != (count, 3) or values.size != count * BRICK**3 * channels:
        raise ValueError("bricks of another shape")
    if (origins % BRICK).any():
        raise ValueError("origins must be multiples of 8")
    matrix = np.asarray(grid["index_to_object"], np.float64)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all() or not np.linalg.det(matrix):
        raise ValueError("a transform without an inverse")
    return {
        "name": grid["name"], "origins": origins, "half": values.dtype == np.float16,
        "values": np.ascontiguousarray(values, np.float32).reshape(count, BRICK**3, channels),
        "index_to_object": matrix.ravel().tolist(), "tiles": grid.get("tiles", False),
        "boxes": list(grid.get("boxes", ())),
    }  # fmt: skip


@contextmanager
def _errors(plugin: Any, path: str | Path, grid: str = "") -> Iterator[None]:
    """Converts exceptions of the plug-in to messages that name file and grid."""
    named = f"{path}: grid {grid!r}" if grid else str(path)
    try:
        yield
    except plugin.BrokenFile as error:
        why = str(error).strip() or "it is damaged"
        kind = ".nvdb" if Path(path).suffix.lower() == ".nvdb" else ".vdb"
        raise WavecombError(f"{named}: no {kind} file that can be read: {why}") from None
    except (plugin.TooLarge, ValueError) as error:
        raise WavecombError(f"{named}: {error}") from None
    except OSError as error:
        raise WavecombError(f"{named}: {error.strerror or error}") from None
    except MemoryError:
        limit = memory.describe_limit()
        raise WavecombError(
            f"{named}: out of memory: it is damaged, or too large for this machine{limit}"
        ) from None


def _text(value: bytes) -> str:
    return value.decode("utf-8", "replace")


def _head(number: int, one: Mapping[str, Any]) -> GridHead:
    return GridHead(*_table_row(number, one))


def _table_row(number: int, one: Mapping[str, Any]) -> tuple[int, str, int, str, bool]:
    return number, _text(one["name"]), one["index"], _text(one["type"]), one["half"]


def _info(number: int, one: Mapping[str, Any]) -> GridInfo:
    row = _table_row(number, one)
    if "is_read" not in one:
        return GridInfo(*row)
    return GridInfo(
        *row,
        one["is_read"],
        one["kind"],
        one["voxels"],
        _box(one["box"]),
        _matrix(one["index_to_object"]),
        tuple(one["background"]),
        {_text(key): _text(value) for key, value in one["metadata"].items()},
    )


def _matrix(rows: Any) -> NDArray[np.float64] | None:
    return None if rows is None else np.array(rows, np.float64)


def _box(corners: Any) -> NDArray[np.int32] | None:
    return None if corners is None else np.array(corners, np.int32)
