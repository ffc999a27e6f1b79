# SPDX-License-Identifier: Apache-2.0
"""Caches of an open stage for values that do not change between frames."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from pxr import Gf, Sdf, Usd

from wavecomb.usd.materials.texture import TextureCache
from wavecomb.usd.stage.report import LoadReport

if TYPE_CHECKING:
    from wavecomb.usd.cameras.camera import View
    from wavecomb.usd.geometry.cage import Cage
    from wavecomb.usd.geometry.curves import CurveArrays
    from wavecomb.usd.geometry.mesh_arrays import MeshArrays


class MeshCache:
    """Arrays of gprims that are not animated, with the messages of reading them.

    At the end of a frame, arrays that the frame did not use are removed.
    """

    def __init__(self, varying: AnimatedAttributes) -> None:
        self._varying = varying
        self._kept: dict[Any, tuple[MeshArrays | CurveArrays | None, LoadReport]] = {}
        self._used: dict[Any, tuple[MeshArrays | CurveArrays | None, LoadReport]] = {}

    def get(
        self,
        read: Callable[[LoadReport], MeshArrays | CurveArrays | None],
        prim: Usd.Prim,
        matrix: Gf.Matrix4d,
        options: tuple[Any, ...],
        inherited: Sequence[Any],
        report: LoadReport,
    ) -> MeshArrays | CurveArrays | None:
        """Returns the arrays of a gprim, reused from the previous frame if nothing changed.

        Args:
            read: Function that reads the arrays and adds messages to a report.
            prim: The gprim.
            matrix: Transform from the gprim to its group.
            options: Further values that the arrays depend on; hashable.
            inherited: Constant primvars of the gprim's ancestors.
            report: Receives the same messages in every frame.
        """
        if self._varying.of(prim, inherited):
            return read(report)
        key = (prim.GetPath(), tuple(map(tuple, matrix)), options)
        known = self._kept.get(key)
        if known is None:
            told = LoadReport()
            known = read(told), told
        self._used[key] = known
        report.absorb(known[1])
        return known[0]

    def end_frame(self) -> None:
        """Removes gprim arrays that the frame did not use."""
        self._kept, self._used = self._used, {}


class RefinedCache:
    """Refined meshes whose cages and subdivision levels are not animated.

    The cache excludes displaced meshes and meshes with per-face values, since materials affect
    them.
    """

    def __init__(self) -> None:
        self._kept: dict[int, tuple[Cage, int, dict[str, Any]]] = {}
        self._used: dict[int, tuple[Cage, int, dict[str, Any]]] = {}

    def get(self, cage: Cage, level: int) -> dict[str, Any] | None:
        """Returns the refined mesh of a cage from the previous frame, or None."""
        known = self._kept.get(id(cage))
        if known is None or known[0] is not cage or known[1] != level:
            return None
        self._used[id(cage)] = known
        return known[2]

    def put(self, cage: Cage, level: int, refined: dict[str, Any]) -> None:
        """Stores a refined mesh for the next frame."""
        self._used[id(cage)] = cage, level, refined

    def end_frame(self) -> None:
        """Removes refined meshes that the frame did not use."""
        self._kept, self._used = self._used, {}


class FrameCache:
    """Data that ``load_stage`` reuses from the previous frame and stores for the next one.

    ``has_same_levels`` returns whether another view needs the same subdivision levels. An image
    size of None means the previous size.

    The cache serves one open stage. Only the time may change between frames.
    """

    def __init__(self, stage: Usd.Stage, opening: LoadReport) -> None:
        """``opening`` holds messages from opening the stage."""
        self.varying = AnimatedAttributes(stage)
        self.meshes = MeshCache(self.varying)
        self.refined = RefinedCache()
        self.has_same_levels: Callable[[View, tuple[int, int] | None], bool] = lambda view, size: (
            True
        )
        self.textures: TextureCache | None = None
        self.opening = opening

    def end_frame(self) -> None:
        """Removes cached data that the frame did not use."""
        self.meshes.end_frame()
        self.refined.end_frame()


# Prototypes of point instancers may be overs or classes.
_ANY = Usd.PrimIsActive & Usd.PrimIsLoaded
_PROXIES = Usd.TraverseInstanceProxies(_ANY)

_FRAMES = ("", "Xform", "Scope", "Camera")
"""Types of prims that neither render nor affect rendered prims."""

_UNREAD = ("RenderSettings", "RenderProduct", "RenderVar", "RenderPass")
"""Prim types whose time-varying values are never read."""


class AnimatedAttributes:
    """The attributes of a stage whose values may change over time, searched once.

    The search covers time samples, splines and value clips, as USD reports them. The stage must not
    be edited afterwards.
    """

    def __init__(self, stage: Usd.Stage) -> None:
        self._prims: dict[Sdf.Path, list[str]] = {}
        sources: set[Sdf.Path] = set()
        # Value clips may provide values for attributes that are not authored otherwise.
        clipped = any(prim.HasAuthoredMetadata("clips") for prim in _everything(stage))
        for prim in _everything(stage):
            names = []
            for attribute in prim.GetAttributes() if clipped else prim.GetAuthoredAttributes():
                if attribute.ValueMightBeTimeVarying() or _carries(attribute):
                    names.append(attribute.GetName())
                if attribute.HasAuthoredConnections():
                    sources.update(path.GetPrimPath() for path in attribute.GetConnections())
            if names:
                self._prims[prim.GetPath()] = names
        self._stage = stage
        self._is_view_only = all(
            path not in sources and self._is_harmless(path, names)
            for path, names in self._prims.items()
        )

    @property
    def is_view_only(self) -> bool:
        """Whether only the views of cameras change, and no rendered geometry, material or light."""
        return self._is_view_only

    @property
    def paths(self) -> list[Sdf.Path]:
        """Paths of prims with animated attributes."""
        return list(self._prims)

    def of(self, prim: Usd.Prim, inherited: Sequence[Any] = ()) -> bool:
        """Returns whether attributes of a prim, or primvars that it inherits, are animated."""
        if not self._prims:
            return False
        path = prim.GetPath()
        return path in self._prims or any(
            primvar.GetAttr().GetPrimPath() in self._prims for primvar in inherited
        )

    def _is_harmless(self, path: Sdf.Path, names: Sequence[str]) -> bool:
        """Returns whether the animation of a prim affects cameras only."""
        prim = self._stage.GetPrimAtPath(path)
        kind = prim.GetTypeName()
        if kind in _UNREAD:
            return True
        if kind != "Camera" and not all(
            name.startswith("xformOp:") or name == "visibility" for name in names
        ):
            return False
        return all(
            below.GetTypeName() in _FRAMES and not below.IsInstance()
            for below in Usd.PrimRange(prim, _PROXIES)
        )


def _everything(stage: Usd.Stage) -> Iterator[Usd.Prim]:
    """Yields every prim that may be read; prims of prototypes are included once."""
    yield from Usd.PrimRange.Stage(stage, _ANY)
    for prototype in stage.GetPrototypes():
        yield from Usd.PrimRange(prototype, _ANY)


def _carries(attribute: Usd.Attribute) -> bool:
    """Returns whether one sample of an attribute moves points over time, as velocities do."""
    return attribute.GetName() == "velocities" and attribute.GetNumTimeSamples() > 0
