# SPDX-License-Identifier: Apache-2.0
"""Reads, validates and describes the fields of volumes; each field becomes one grid of the core."""

from __future__ import annotations

import functools
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdVol

from wavecomb import vdb
from wavecomb.errors import WavecombError
from wavecomb.image.files.output_file import kind_of
from wavecomb.image.working_space import from_rec709
from wavecomb.run.isolation import progress_notes
from wavecomb.usd.lights.light import blackbody
from wavecomb.usd.materials.network import asset_file, word
from wavecomb.usd.stage.context import LoadContext
from wavecomb.usd.stage.report import LoadReport


@dataclass(frozen=True)
class GridFacts:
    """Description of a volume grid.

    Attributes:
        use: Use of the grid: "density", "colour", "emission", "temperature" or "velocity".
        field: Name of the volume's field.
        file: File that holds the grid.
        grid: Name of the grid in the file.
        value: OpenVDB's name of the value type, such as "float", "half" or "vec3s".
        voxels: Number of active voxels of the grid.
        bytes: Memory of the grid's bricks including their borders, in bytes.
    """

    use: str
    field: str
    file: str
    grid: str
    value: str
    voxels: int
    bytes: int


@dataclass(frozen=True)
class VolumeFacts:
    """Description of a volume.

    Attributes:
        name: Prim path of the volume.
        count: Number of instances of the volume.
        low: Lowest corner of the bounds of all instances in world space.
        high: Highest corner of the bounds of all instances in world space.
        grids: Grids of the volume; empty for a homogeneous volume.
    """

    name: str
    count: int
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    grids: tuple[GridFacts, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Returns the description as plain data for JSON."""
        return {
            "name": self.name,
            "count": self.count,
            "bounds": [list(self.low), list(self.high)],
            "grids": [dict(vars(grid)) for grid in self.grids],
        }


_SLIGHTLY = 1e-3
"""Tolerance for negative values, relative to a grid's maximum; resampling filters produce such
values."""

_WARM = ("temperature", "heat", "flame", "flames", "fire", "fuel")
"""Names of fields that serve as density only if the volume has no other field."""

_CHUNK = 4096
"""Number of bricks that are processed together."""


@dataclass(frozen=True)
class Grid:
    """A grid of the scene.

    Attributes:
        handle: Grid object for ``SceneBuilder.add_volume``.
        corners: (8, 3) corners of the bounds of the grid's active voxels in object space.
        facts: Description of the grid for users.
    """

    handle: Any
    corners: NDArray[np.float64]
    facts: GridFacts


class GridTable:
    """Reader of the volume grids of one scene."""

    def __init__(self, context: LoadContext) -> None:
        self._builder, self._report = context.builder, context.report
        self._working = context.options.working_space
        self._tables: dict[str, list[vdb.GridHead] | None] = {}
        self._known: dict[tuple[Any, ...], Grid | None] = {}

    def find(self, fields: Mapping[str, Field], name: str) -> Field | None:
        """Returns the field with a given name, or else a field whose grid has this name."""
        if name in fields:
            return fields[name]
        for field in fields.values():
            head = self._head(field)
            if head is not None and head.name == name:
                return field
        return None

    def first_vector(self, fields: Mapping[str, Field], names: Sequence[str]) -> Field | None:
        """Returns the first vector field whose name or grid name is one of ``names``."""
        for name in names:
            for field in fields.values():
                head = self._head(field)
                known = head is not None and name in (field.name.lower(), head.name.lower())
                if known and head is not None and head.is_vector:
                    return field
        return None

    def densest(self, fields: Mapping[str, Field]) -> Field | None:
        """Returns the first scalar field, preferring fields that are not temperatures."""
        scalar = []
        for field in fields.values():
            head = self._head(field)
            if head is not None and not head.is_vector:
                scalar.append(field)
        cold = [field for field in scalar if field.name.lower() not in _WARM]
        return next(iter(cold or scalar), None)

    def get(self, field: Field, use: str, kelvin: float = 0.0) -> Grid | None:
        """Reads a field as a grid of the scene; reports and returns None if that is not possible.

        Args:
            field: Field of a volume.
            use: "density", "colour", "emission", "temperature" (converted to emission) or
                "velocity".
            kelvin: Temperature that corresponds to a value of 1 in a temperature grid.

        Raises:
            WavecombError: The file is corrupt or contains values that are invalid for a volume.
        """
        key = (field.file, field.grid or field.name, field.index, use, kelvin)
        if key not in self._known:
            progress_notes.note("reading", field.file)
            try:
                self._known[key] = self._read(field, use, kelvin)
            except WavecombError as error:
                raise WavecombError(f"{self._report.place(field.prim)}: {error}") from None
        return self._known[key]

    def _table(self, field: Field) -> list[vdb.GridHead] | None:
        """Returns the grids in a field's file.

        Reports and returns None if the file does not exist.
        """
        if field.file not in self._tables:
            table = None
            if not os.path.isfile(field.file):
                kind = kind_of(field.file)
                why = "missing" if kind is None else f"{kind}, not a regular file"
                what = f"volume file {field.file} is {why}: field left out"
                self._report.warn(what, field.prim)
            else:
                try:
                    table = vdb.grid_heads(field.file)
                except WavecombError as error:
                    raise WavecombError(f"{self._report.place(field.prim)}: {error}") from None
            self._tables[field.file] = table
        return self._tables[field.file]

    def _head(self, field: Field) -> vdb.GridHead | None:
        """Returns the grid of a field; reports and returns None if there is none."""
        table = self._table(field)
        if table is None:
            return None
        wanted = field.grid or field.name
        for head in table:
            if head.name == wanted and head.index == field.index:
                return head
        if not field.grid and len(table) == 1:
            return table[0]
        there = ", ".join(repr(head.name) for head in table[:8]) or "none"
        what = f"{field.file} has no grid {wanted!r} {field.index} (there are {there}): left out"
        self._report.warn(what, field.prim)
        return None

    def _read(self, field: Field, use: str, kelvin: float) -> Grid | None:
        head = self._head(field)
        if head is None:
            return None
        if not head.is_of_numbers:
            self._report.missing(f"grids of {head.value_name} (left out)", field.prim)
            return None
        is_dark = use != "colour"
        found = vdb.read(field.file, head, background_is_zero=is_dark, whole=not is_dark)
        named = f"{field.file}: grid {head.name!r}"
        if found.not_finite:
            numbers = f"{found.not_finite:,} values that are infinite or NaN"
            raise WavecombError(f"{named} has {numbers}: clean it where it was made")
        if found.box is None or not len(found.origins):
            self._report.note(f"empty grid {head.name!r}: left out", field.prim)
            return None
        matrix = found.index_to_object
        if matrix is None:
            self._report.missing("grids in a frustum (left out)", field.prim)
            return None
        if not np.isfinite(matrix).all() or not np.linalg.det(matrix[:3, :3]):
            raise WavecombError(f"{named} has a transform without an inverse")
        if found.values.ndim == 5 and use in ("density", "temperature"):
            self._report.missing(f"vectors as {use} (left out)", field.prim)
            return None
        if found.values.ndim != 5 and use == "velocity":
            self._report.missing("numbers as velocity (left out)", field.prim)
            return None
        if use == "velocity" and found.kind == "staggered":
            what = f"staggered grid {head.name!r}: treated as values at voxel centres"
            self._report.note(what, field.prim)
        self._check_sign(found, named, use, field)
        if use == "colour" and found.greatest > 1:
            self._report.note("colour above 1 of a volume: 1 is used", field.prim)
            np.minimum(found.values, 1, out=found.values)
        background = self._background(found, head, use, field)
        values = self._values(found.values, use, kelvin)
        facts = GridFacts(
            use, field.name, field.file, head.name, head.value_name, found.voxels,
            values.nbytes * (vdb.BRICK + 1) ** 3 // vdb.BRICK**3,
        )  # fmt: skip
        name = self._report.place(field.prim)
        signs = {"is_signed": True} if use == "velocity" else {}
        handle = self._handed_over(found.origins, values, matrix, background, name, **signs)
        return Grid(handle, _corners(found.box, matrix), facts)

    def _check_sign(self, found: vdb.Bricks, named: str, use: str, field: Field) -> None:
        """Rejects grids with negative values; sets slightly negative values to 0."""
        if not found.negative or use == "velocity":
            return
        if found.kind == "level set" and use == "density":
            raise WavecombError(f"{named} is a level set; convert it to a fog volume")
        is_slight = -found.least <= _SLIGHTLY * found.greatest
        if not is_slight and use != "colour":
            raise WavecombError(
                f"{named} has {found.negative:,} numbers below 0, down to {found.least:g}: a "
                f"{use} has none"
            )
        how = "slightly " if is_slight else ""
        self._report.note(f"{use} {how}below 0: 0 is used", field.prim)
        np.maximum(found.values, 0, out=found.values)

    def _background(self, found: vdb.Bricks, head: vdb.GridHead, use: str, field: Field) -> float:
        if use == "colour":
            same = len(set(found.background)) == 1
            return min(max(found.background[0], 0.0), 1.0) if same else 0.0
        if any(found.background):
            values = " ".join(f"{value:g}" for value in found.background)
            what = f"grid {head.name!r} of background {values}: 0 outside of active voxels"
            self._report.note(what, field.prim)
        return 0.0

    def _values(self, values: NDArray[Any], use: str, kelvin: float) -> NDArray[Any]:
        """Converts values to the working space, and temperatures to emission."""
        if use == "temperature":
            made = np.empty((*values.shape, 3), np.float32)
            for at in range(0, len(values), _CHUNK):
                part = np.asarray(values[at : at + _CHUNK], np.float32)
                rgb = from_rec709(radiance(part * kelvin), self._working)
                made[at : at + _CHUNK] = np.maximum(rgb, 0)
            return made
        if values.ndim == 5 and use != "velocity" and self._working != "rec709":
            rgb = from_rec709(np.asarray(values, np.float32), self._working)
            return np.clip(rgb, 0, 1 if use == "colour" else None)
        return values

    def _handed_over(
        self,
        origins: NDArray[np.int32],
        values: NDArray[Any],
        matrix: NDArray[np.float64],
        background: float,
        name: str,
        **signs: bool,
    ) -> Any:
        """Creates the grid in this process, or in the process that builds the scene."""
        make = getattr(self._builder, "make_volume_grid", None)
        if make is None:
            from wavecomb import _core

            make = _core.VolumeGrid
        return make(origins, values, matrix, background, name, **signs)


def _corners(box: NDArray[np.int32], matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the corners (8, 3) of the voxels from the first to the last index in object space."""
    ends = np.array([box[0] - 0.5, box[1] + 0.5])
    index = np.array([[ends[i, 0], ends[j, 1], ends[k, 2]] for i in (0, 1) for j in (0, 1)
                      for k in (0, 1)])  # fmt: skip
    corners: NDArray[np.float64] = index @ matrix[:3, :3] + matrix[3, :3]
    return corners


STEFAN_BOLTZMANN = 5.670374e-8
"""Stefan-Boltzmann constant in W m^-2 K^-4."""

_HOTTEST = 1e5
_FIRST, _LAST, _COUNT = 1000.0, 15000.0, 512


def radiance(kelvin: NDArray[Any]) -> NDArray[np.float32]:
    """Returns black-body radiance in linear Rec.709 (..., 3), with luminance sigma T^4 / pi in MW.

    The unit is the same as in Cycles: the luminance is 1 at 2729 K and 11.3 at 5000 K. Below 1000 K
    the chromaticity of 1000 K is used.
    """
    hot = np.clip(np.asarray(kelvin, np.float64), 0.0, _HOTTEST)
    strength = (STEFAN_BOLTZMANN * 1e-6 / np.pi) * hot**4
    at, table = _colours()
    colours = [np.interp(hot, at, table[:, channel]) for channel in range(3)]
    return np.asarray(np.stack(colours, axis=-1) * strength[..., None], np.float32)


@functools.cache
def _colours() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns temperatures and the corresponding black-body colours of luminance 1."""
    at = np.linspace(_FIRST, _LAST, _COUNT)
    return at, np.array([blackbody(float(kelvin)) for kelvin in at])


@dataclass(frozen=True)
class Field:
    """A field of a volume.

    Attributes:
        name: Name of the relationship without ``field:``.
        file: Path of a .vdb file.
        grid: Name of the grid in the file; "" means the field's name, or the only grid.
        index: Index of the grid among grids with the same name.
        prim: Path of the field asset.
        changes: Whether the file path changes over time.
    """

    name: str
    file: str
    grid: str = ""
    index: int = 0
    prim: str = ""
    changes: bool = False


def read_fields(volume: Usd.Prim, time: Usd.TimeCode, report: LoadReport) -> dict[str, Field]:
    """Returns the fields of a volume by name, sorted; reports those that cannot be read."""
    found: dict[str, Field] = {}
    stage = volume.GetStage()
    for name, path in sorted(UsdVol.Volume(volume).GetFieldPaths().items()):
        prim = stage.GetPrimAtPath(path)
        if not prim:
            report.warn(f"volume field without its asset {path}: left out", volume.GetPath())
            continue
        if prim.GetTypeName() != "OpenVDBAsset":
            kind = str(prim.GetTypeName()) or "prim without a type"
            report.missing(f"{kind} as a volume field (left out)", prim.GetPath())
            continue
        field = _asset(str(name), prim, time)
        if not field.file:
            report.warn("volume field that names no file: left out", prim.GetPath())
            continue
        if prim.GetAttribute("xformOpOrder").HasAuthoredValue():
            report.missing("transforms of volume fields (left out)", prim.GetPath())
        found[str(name)] = field
    return found


def _asset(name: str, prim: Usd.Prim, time: Usd.TimeCode) -> Field:
    asset = UsdVol.OpenVDBAsset(prim)
    file = asset.GetFilePathAttr()
    index = asset.GetFieldIndexAttr().Get(time)
    return Field(
        name,
        asset_file(file.Get(time), file),
        word(asset.GetFieldNameAttr().Get(time)),
        index if isinstance(index, int) and index >= 0 else 0,
        str(prim.GetPath()),
        file.ValueMightBeTimeVarying(),
    )
