# SPDX-License-Identifier: Apache-2.0
"""The door to OpenVDB and NanoVDB: the one module that imports the plug-in ``wavecomb._vdb``.

The plug-in is built where OpenVDB is there (tools/setup_openvdb), and loaded only where something
asks for a .vdb or .nvdb file.
"""

from __future__ import annotations

import functools
import importlib
from collections.abc import Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb import vdb_writer
from wavecomb.errors import WavecombError
from wavecomb.run.isolate import memory

if TYPE_CHECKING:
    from collections.abc import Iterator

BRING = "tools/setup_openvdb && make build"
"""The command that brings OpenVDB to a source tree."""

ABSENT = f"OpenVDB, which this build is without ({BRING})"
"""What is said where a .vdb file is asked for and cannot be read."""

BRICK = vdb_writer.BRICK
"""Edge of a brick, in voxels."""

_NUMBERS = {"float", "double", "vec3s", "vec3d", "fp4", "fp8", "fp16", "fpn"}


@dataclass(frozen=True)
class GridHead:
    """A grid as the table of a file has it.

    Attributes:
        number: Place in the file.
        name: Several may share one.
        index: Among those of its name.
        type_name: OpenVDB's, as "Tree_float_5_4_3"; of .nvdb files also "Tree_fp8_5_4_3".
        is_half: Whether its floats are kept in 16 bits.
    """

    number: int
    name: str
    index: int
    type_name: str
    is_half: bool

    @property
    def is_vector(self) -> bool:
        """Whether a value is several numbers."""
        return self.type_name.startswith("Tree_vec")

    @property
    def is_of_numbers(self) -> bool:
        """Whether a value is a number, or three, as are read; not integers, say."""
        return self.type_name.removeprefix("Tree_").partition("_")[0] in _NUMBERS

    @property
    def value_name(self) -> str:
        """OpenVDB's word for a value, and half for floats in 16 bits: "float", "vec3s" ..."""
        word = self.type_name.removeprefix("Tree_").partition("_")[0]
        return {"float": "half", "vec3s": "vec3h"}.get(word, word) if self.is_half else word


@dataclass(frozen=True)
class GridInfo(GridHead):
    """A grid as it is without its values.

    Attributes:
        is_read: Whether there are bricks of it.
        kind: "fog volume", "level set", "staggered" or "unknown".
        voxels: That are active.
        box: (2, 3) first and last index of these; None: there are none.
        index_to_object: (4, 4), p' = p M; None where it is not affine.
        background: Of 1 or 3 numbers.
        metadata: As texts.
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
        origins: int32 (n, 3), index of the first voxel of each.
        values: float16 or float32 (n, 8, 8, 8) or (n, 8, 8, 8, 3), x slowest.
        index_to_object: As of ``GridInfo``, and so are background, kind, voxels and box.
        not_finite: How many numbers are infinite or none.
        negative: How many are below 0.
        least: Of all, and 0.
        greatest: Likewise.
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
    """Whether .vdb files can be read, and .nvdb files where ``nano_version`` is a number."""
    try:
        _plugin()
    except ImportError:
        return False
    return True


def version() -> str | None:
    """Of OpenVDB; None: it is not there."""
    return str(_plugin().version) if is_there() else None


def nano_version() -> int | None:
    """The major version of .nvdb files that are read; None: none are."""
    return int(_plugin().nano_version) or None if is_there() else None


def _plugin() -> Any:
    # First the core, which brings the one oneTBB of the process.
    importlib.import_module("wavecomb._core")
    return importlib.import_module("wavecomb._vdb")


def _needed(path: str | Path) -> Any:
    if not is_there():
        raise WavecombError(f"{path}: needs {ABSENT}")
    return _plugin()


def grid_heads(path: str | Path) -> list[GridHead]:
    """The grids of a file, by its table alone.

    Raises:
        WavecombError: It is none, is broken, or there is no OpenVDB.
    """
    plugin = _needed(path)
    with _errors(plugin, path):
        found = plugin.grids(str(path), True)
    return [_head(number, one) for number, one in enumerate(found)]


def grids(path: str | Path) -> list[GridInfo]:
    """The grids of a file, with what can be said of them without their values.

    Raises:
        WavecombError: As ``grid_heads``.
    """
    plugin = _needed(path)
    with _errors(plugin, path):
        found = plugin.grids(str(path))
    return [_info(number, one) for number, one in enumerate(found)]


def read(
    path: str | Path, head: GridHead, *, background_is_zero: bool = False, whole: bool = True
) -> Bricks:
    """The values of a grid: its leaves, and its active tiles as bricks.

    Args:
        path: The file.
        head: Of ``grid_heads``.
        background_is_zero: Voxels that are not active and hold the background become 0.
        whole: With bricks that hold nothing but zeros.

    Raises:
        WavecombError: The file is broken, the grid too large, or of a type that is not read.
    """
    plugin = _needed(path)
    with _errors(plugin, path, head.name):
        # The tree and the bricks of it are there at once.
        found = plugin.bricks(
            str(path), head.number, memory.room() // 2, background_is_zero, not whole
        )
    names = ("origins", "values", "kind", "voxels", "not_finite", "negative", "least", "greatest")
    return Bricks(
        index_to_object=_matrix(found["index_to_object"]),
        background=tuple(found["background"]),
        box=_box(found["box"]),
        **{name: found[name] for name in names},
    )


def write(path: str | Path, made: Sequence[Mapping[str, Any]]) -> None:
    """Writes a .vdb file of grids, also without OpenVDB; the same grids give the same bytes.

    Args:
        path: File to write. The caller sees to it that it is whole or absent.
        made: Of each grid ``name``, ``origins``, ``values`` (as of ``Bricks``; those of float16
            are kept in 16 bits) and ``index_to_object``; with ``tiles`` bricks of one value become
            tiles, which takes less room; ``boxes`` (first index, last index, value), which begin
            and end at multiples of 8 voxels, are filled before bricks are added.

    Raises:
        WavecombError: It is another kind of file, arrays do not fit each other, or the file cannot
            be written.
    """
    if Path(path).suffix.lower() == ".nvdb":
        raise WavecombError(f"{path}: .nvdb files are read, not written: name a .vdb file")
    vdb_writer.write(path, made)


@contextmanager
def _errors(plugin: Any, path: str | Path, grid: str = "") -> Iterator[None]:
    """What the plug-in raises as a line that names file and grid."""
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
