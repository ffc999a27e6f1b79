# SPDX-License-Identifier: Apache-2.0
"""What the frames of a stage that stays open share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from pxr import Gf, Usd

from wavecomb.usd.looks.texture import TextureCache
from wavecomb.usd.stage.report import LoadReport
from wavecomb.usd.stage.varying import Varying

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
