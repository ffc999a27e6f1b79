# SPDX-License-Identifier: Apache-2.0
"""Keeps the textures of a stage within a memory limit by leaving out mip levels.

Before loading, the module reads the headers of all image files and computes the memory of their
textures. While the sum exceeds the limit, the module removes the finest mip level of the texture
with the most texels per image pixel. Renders therefore do not wait for files, and the same stage,
view and limit always give the same image.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pxr import Tf, Usd, UsdGeom

from wavecomb.usd.geometry.mesh_arrays import UV_NAMES
from wavecomb.usd.lights.light import KINDS, LightReader
from wavecomb.usd.materials.bindings import bound_materials
from wavecomb.usd.materials.material import MaterialTable
from wavecomb.usd.materials.pixels import Image, TextureError, read_header
from wavecomb.usd.materials.texture import MEGABYTE, Key, TextureTable, stored_type
from wavecomb.usd.stage.collections import LightGroups
from wavecomb.usd.stage.context import LoadContext
from wavecomb.usd.stage.report import LoadReport

if TYPE_CHECKING:
    from wavecomb.usd.geometry.cage import ViewSize

MAX_PRIMS = 100_000
"""Number of prims whose size in the image is computed; textures of further prims keep all mip
levels."""

_TILE = 8
_WRAPPED = 2.0
"""Factor on the required texels, for surfaces that do not face the camera."""


def pyramid_bytes(width: int, height: int, channels: int, dtype: Any) -> int:
    """Returns the memory in bytes of a texture with all its mip levels, as the core stores it."""
    texels = 0
    while True:
        texels += -(-width // _TILE) * -(-height // _TILE) * _TILE * _TILE
        if width == height == 1:
            break
        width, height = max(width // 2, 1), max(height // 2, 1)
    return texels * (1 if channels == 1 else 4) * np.dtype(dtype).itemsize


@dataclass
class _Entry:
    """A texture that the stage needs, and its number of omitted mip levels.

    Attributes:
        wanted: Largest texture width in texels that the image can resolve; None if unknown; all mip
            levels are then kept.
        drop: Number of finest mip levels that are not loaded.
    """

    key: Key
    width: int
    height: int
    channels: int
    dtype: Any
    wanted: float | None = None
    drop: int = 0

    @property
    def size(self) -> tuple[int, int]:
        return max(self.width >> self.drop, 1), max(self.height >> self.drop, 1)

    @property
    def bytes(self) -> int:
        return pyramid_bytes(*self.size, self.channels, self.dtype)

    def surplus(self) -> float:
        """Returns the ratio of the texture's width to the width that the image can resolve."""
        return 0.0 if self.wanted is None else max(self.size) / max(self.wanted, 1e-3)


class _Plan(TextureTable):
    """A texture table that reads only headers of images and records which textures are needed."""

    def __init__(self, context: LoadContext) -> None:
        super().__init__(context)
        self.entries: dict[int, _Entry] = {}
        self._headers: dict[str, Image | None] = {}

    def expect(self, material: Usd.Prim, time: Usd.TimeCode) -> None:
        """Does nothing, since image headers are not read ahead."""

    def _image(self, path: str, prim: object) -> Image | None:
        if path not in self._headers:
            try:
                self._headers[path] = read_header(path)
            except (TextureError, OSError, ValueError):
                self._headers[path] = None
        return self._headers[path]

    def _add(self, path: str, image: Image, space: str, wrap_s: str, wrap_t: str) -> int:
        number = self._builder.add_texture(None, srgb=False)  # type: ignore[arg-type]
        height, width = image.size
        dtype = stored_type(image, space)
        key = (path, space, wrap_s, wrap_t)
        self.entries[number] = _Entry(key, width, height, image.channels, dtype)
        return number

    def reached(self, number: int) -> list[_Entry]:
        """Returns the texture with an id, or its tiles if it is a UDIM texture."""
        parts = self._builder.tiles.get(number, [number])  # type: ignore[attr-defined]
        return [self.entries[part] for part in parts if part in self.entries]


class _NoBuilder:
    """Scene builder that assigns texture ids but creates no textures."""

    def __init__(self) -> None:
        self.count = 0
        self.tiles: dict[int, list[int]] = {}

    def add_texture(self, pixels: Any, **options: Any) -> int:
        self.count += 1
        return self.count - 1

    def add_tiles(self, name: str, tiles: Sequence[tuple[int, int]], missing: Any) -> int:
        number = self.add_texture(None)
        self.tiles[number] = [tile for _, tile in tiles]
        return number


def plan_levels(context: LoadContext, view: ViewSize, limit_bytes: float) -> dict[Key, int]:
    """Returns the number of finest mip levels to omit for each texture."""
    report = context.report
    options = replace(context.options, threads=1)
    builder: Any = _NoBuilder()
    quiet = replace(context, builder=builder, report=LoadReport(), options=options)
    plan = _Plan(quiet)
    _note_lights(quiet, plan)
    _note_materials(quiet, plan, view)
    entries = list(plan.entries.values())
    before = total = sum(entry.bytes for entry in entries)
    heap = [(-entry.surplus(), -entry.bytes, i) for i, entry in enumerate(entries)]
    heapq.heapify(heap)
    while total > limit_bytes and heap:
        at = heapq.heappop(heap)[2]
        entry = entries[at]
        if max(entry.size) == 1:
            continue
        total -= entry.bytes
        entry.drop += 1
        total += entry.bytes
        heapq.heappush(heap, (-entry.surplus(), -entry.bytes, at))
    reduced = [entry for entry in entries if entry.drop]
    if reduced:
        short = sum(entry.wanted is not None and entry.surplus() < 1 for entry in reduced)
        report.note(
            f"texture limit {limit_bytes / MEGABYTE:g} MB: {len(reduced)} of {len(entries)} "
            f"textures without their finest levels, {short} of them coarser than the image shows "
            f"({before / MEGABYTE:.1f} MB become {total / MEGABYTE:.1f} MB)"
        )
    if total > limit_bytes:
        report.warn(
            f"texture limit {limit_bytes / MEGABYTE:g} MB: {len(entries)} textures take "
            f"{total / MEGABYTE:.1f} MB even without detail; give more"
        )
    return {entry.key: entry.drop for entry in reduced}


def _note_lights(context: LoadContext, plan: _Plan) -> None:
    reader = LightReader(context, plan, LightGroups(context.report))
    for prim in _prims(context.stage):
        if str(prim.GetTypeName()) in KINDS:
            reader.read(prim)


def _note_materials(context: LoadContext, plan: _Plan, view: ViewSize) -> None:
    """Records the textures of bound materials and the widths that the image can resolve."""
    time = context.time
    materials = MaterialTable(context, plan)
    bounds = UsdGeom.BBoxCache(time, [UsdGeom.Tokens.default_, UsdGeom.Tokens.render], True)
    prims = [p for p in _prims(context.stage) if p.IsA(UsdGeom.Gprim) or p.IsA(UsdGeom.Subset)]
    for at, (prim, material) in enumerate(zip(prims, bound_materials(prims), strict=True)):
        if material is None:
            continue
        surface = materials.surface(material)
        uses = surface.texture_uses()
        if isinstance(surface.displacement, dict):
            uses.append(surface.displacement)
        if not uses:
            continue
        pixels = math.inf
        if at < MAX_PRIMS and not isinstance(surface.displacement, dict):
            shape = prim.GetParent() if prim.IsA(UsdGeom.Subset) else prim
            pixels = _pixels_across(shape, bounds, view) / _uv_extent(shape, time)
        for use in uses:
            a, b, _, c, d, _ = use["uv"]
            stretch = math.sqrt(max(a * a + c * c, b * b + d * d)) or 1.0
            for entry in plan.reached(use["texture"]):
                if not math.isfinite(pixels):
                    entry.wanted = math.inf
                elif stretch > 0:
                    wanted = _WRAPPED * pixels / stretch
                    entry.wanted = max(entry.wanted or 0.0, wanted)
    for entry in plan.entries.values():
        if entry.wanted == math.inf:
            entry.wanted = None


def _prims(stage: Usd.Stage) -> Iterator[Usd.Prim]:
    """Yields active, defined prims; prototypes of point instancers are visited once.

    Prims inside native instances are visited once per instance. Ends after ``4 * MAX_PRIMS`` prims.
    """
    proxies = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)
    seen: set[Any] = set()
    for count, prim in enumerate(Usd.PrimRange.Stage(stage, proxies)):
        if count > 4 * MAX_PRIMS:
            break
        yield prim
        if prim.IsA(UsdGeom.PointInstancer):
            targets = UsdGeom.PointInstancer(prim).GetPrototypesRel().GetForwardedTargets()
            for target in targets:
                root = stage.GetPrimAtPath(target)
                if root and target not in seen and not target.HasPrefix(prim.GetPath()):
                    seen.add(target)
                    yield from Usd.PrimRange(root, Usd.PrimIsActive & Usd.PrimIsLoaded)


def _pixels_across(prim: Usd.Prim, bounds: UsdGeom.BBoxCache, view: ViewSize) -> float:
    """Returns a prim's largest possible size in pixels; infinite if it is unknown."""
    instancer = prim
    while instancer and not instancer.IsA(UsdGeom.PointInstancer):
        instancer = instancer.GetParent()
    try:
        own = bounds.ComputeWorldBound(prim).ComputeAlignedRange()
        place = bounds.ComputeWorldBound(instancer).ComputeAlignedRange() if instancer else own
    except Tf.ErrorException:
        return math.inf
    if own.IsEmpty() or place.IsEmpty():
        return math.inf
    length = own.GetSize().GetLength()
    corners = np.array([place.GetCorner(i) for i in range(8)])
    local = corners @ view.to_camera[:3, :3] + view.to_camera[3, :3]
    centre = local.mean(axis=0)
    distance = float(np.linalg.norm(centre) - 0.5 * np.linalg.norm(local[7] - local[0]))
    nearest = max(distance, float((-local[:, 2]).min()))
    return math.inf if nearest <= 0 else length * view.pixels / nearest


def _uv_extent(prim: Usd.Prim, time: Usd.TimeCode) -> float:
    """Returns the extent of texture coordinates over a prim, or 1 if it is unknown."""
    reader = UsdGeom.PrimvarsAPI(prim)
    for name in UV_NAMES:
        primvar = reader.FindPrimvarWithInheritance(name)
        value = primvar.Get(time) if primvar else None
        if value is None or len(value) == 0:
            continue
        array: NDArray[Any] = np.asarray(value)
        if array.ndim == 2 and array.shape[1] >= 2 and np.isfinite(array).all():
            extent = float(np.ptp(array[:, :2], axis=0).max())
            return extent if extent > 0 else 1.0
    return 1.0
