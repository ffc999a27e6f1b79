# SPDX-License-Identifier: Apache-2.0
"""What does not change from frame to frame of an open stage, and is read once."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from pxr import Gf, Sdf, Usd

from wavecomb.usd.looks.texture import TextureCache
from wavecomb.usd.stage.report import LoadReport

if TYPE_CHECKING:
    from wavecomb.usd.cameras.camera import View
    from wavecomb.usd.geometry.cage import Cage
    from wavecomb.usd.geometry.curves import CurveArrays
    from wavecomb.usd.geometry.mesh_arrays import MeshArrays


class MeshCache:
    """Arrays of gprims that no frame changes, with what there was to say of them.

    Those that a frame does not ask for are forgotten at its end.
    """

    def __init__(self, varying: Varying) -> None:
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
        """The arrays of a gprim: those of the frame before where they are the same.

        Args:
            read: Makes them, and tells a report.
            prim: The gprim.
            matrix: From it to its group.
            options: What else decides over the arrays; hashable.
            inherited: Primvars of its ancestors.
            report: Is told the same in every frame.
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
        """Forgets what the frame did not use."""
        self._kept, self._used = self._used, {}


class RefinedCache:
    """Refined surfaces whose cages and levels no frame changes.

    Not of those that are displaced or that colour single triangles: materials have a say in them.
    """

    def __init__(self) -> None:
        self._kept: dict[int, tuple[Cage, int, dict[str, Any]]] = {}
        self._used: dict[int, tuple[Cage, int, dict[str, Any]]] = {}

    def get(self, cage: Cage, level: int) -> dict[str, Any] | None:
        """What the frame before made of a cage; None where it did not."""
        known = self._kept.get(id(cage))
        if known is None or known[0] is not cage or known[1] != level:
            return None
        self._used[id(cage)] = known
        return known[2]

    def put(self, cage: Cage, level: int, refined: dict[str, Any]) -> None:
        """Keeps what was made for the frame after this."""
        self._used[id(cage)] = cage, level, refined

    def end_frame(self) -> None:
        """Forgets what the frame did not use."""
        self._kept, self._used = self._used, {}


class FrameCache:
    """For ``load_stage``: what it may take from the frame before, and leaves for the next one.

    ``has_same_levels`` says of another view, and the size of its picture (None: as it was), whether
    subdivision surfaces would be refined as much.

    Contract: for one open stage, which does not change but in time.
    """

    def __init__(self, stage: Usd.Stage, opening: LoadReport) -> None:
        """``opening``: what there was to say when the stage was opened."""
        self.varying = Varying(stage)
        self.meshes = MeshCache(self.varying)
        self.refined = RefinedCache()
        self.has_same_levels: Callable[[View, tuple[int, int] | None], bool] = lambda view, size: (
            True
        )
        self.textures: TextureCache | None = None
        self.opening = opening

    def end_frame(self) -> None:
        """Forgets what the frame did not use."""
        self.meshes.end_frame()
        self.refined.end_frame()


# Prototypes of point instancers may be overs or classes.
_ANY = Usd.PrimIsActive & Usd.PrimIsLoaded
_PROXIES = Usd.TraverseInstanceProxies(_ANY)

_FRAMES = ("", "Xform", "Scope", "Camera")
"""Types of prims that draw nothing and give nothing to what is drawn."""

_UNREAD = ("RenderSettings", "RenderProduct", "RenderVar", "RenderPass")
"""Types whose values at a time are never read."""


class Varying:
    """The attributes of a stage whose values may change with time, found once.

    By samples, splines and value clips, as USD says. The stage must not change meanwhile.
    """

    def __init__(self, stage: Usd.Stage) -> None:
        self._prims: dict[Sdf.Path, list[str]] = {}
        sources: set[Sdf.Path] = set()
        # Clips may bring values to attributes that nothing else authors.
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
        """Whether at most the views of cameras change: all that is drawn stays."""
        return self._is_view_only

    @property
    def paths(self) -> list[Sdf.Path]:
        """Prims with attributes that change."""
        return list(self._prims)

    def of(self, prim: Usd.Prim, inherited: Sequence[Any] = ()) -> bool:
        """Whether the attributes of a prim change, or the primvars that it inherits."""
        if not self._prims:
            return False
        path = prim.GetPath()
        return path in self._prims or any(
            primvar.GetAttr().GetPrimPath() in self._prims for primvar in inherited
        )

    def _is_harmless(self, path: Sdf.Path, names: Sequence[str]) -> bool:
        """Whether what changes on a prim acts on cameras only."""
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
    """Every prim that may be read, those of instances once."""
    yield from Usd.PrimRange.Stage(stage, _ANY)
    for prototype in stage.GetPrototypes():
        yield from Usd.PrimRange(prototype, _ANY)


def _carries(attribute: Usd.Attribute) -> bool:
    """Whether a single sample of it moves points at other times."""
    return attribute.GetName() == "velocities" and attribute.GetNumTimeSamples() > 0
