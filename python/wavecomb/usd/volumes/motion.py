# SPDX-License-Identifier: Apache-2.0
"""How volumes move while the shutter is open: by a field of velocities."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pxr import Usd

from wavecomb.usd.geometry.shutter import Motion
from wavecomb.usd.looks.network import number
from wavecomb.usd.stage.report import LoadReport
from wavecomb.usd.volumes.fields import Field
from wavecomb.usd.volumes.grids import Grid, GridTable

_NAMES = ("velocity", "vel", "v")
_PARTS = {name + sign + axis for name in _NAMES for sign in ("", "_", ".") for axis in "xyz"}
_SCALES = ("primvars:arnold:velocity_scale", "arnold:velocity_scale")


@dataclass(frozen=True)
class Velocity:
    """What moves a volume.

    Attributes:
        grid: Of vectors, in object space over a second.
        seconds: When the shutter opens and closes, from the frame, times the volume's scale.
    """

    grid: Grid
    seconds: tuple[float, float]


class VelocityReader:
    """Finds what moves the volumes of one stage."""

    def __init__(self, stage: Usd.Stage, motion: Motion | None, report: LoadReport) -> None:
        """``motion``: None where the shutter is open for no time."""
        per_second = stage.GetTimeCodesPerSecond()
        self._seconds = (0.0, 0.0)
        if motion is not None and per_second > 0:
            opens, closes = motion.shutter
            self._seconds = (opens / per_second, closes / per_second)
        self._is_blurred = motion is not None
        self._report = report

    def find(
        self, prim: Usd.Prim, fields: Mapping[str, Field], grids: GridTable, time: Usd.TimeCode
    ) -> Velocity | None:
        """The velocities of a volume; None where it stands still. Says what cannot be blurred.

        Raises:
            WavecombError: The file is broken, or holds what no velocity can be.
        """
        if not self._is_blurred:
            return None
        if any(field.changes for field in fields.values()):
            what = "volumes whose files change while the shutter is open (still)"
            self._report.missing(what, prim.GetPath())
        field = grids.first_vector(fields, _NAMES)
        if field is None:
            if any(name.lower() in _PARTS for name in fields):
                what = "velocities of volumes in three grids (still)"
                self._report.missing(what, prim.GetPath())
            return None
        scale = self._scale(prim, time)
        seconds = (self._seconds[0] * scale, self._seconds[1] * scale)
        if seconds == (0.0, 0.0):
            return None
        grid = grids.get(field, "velocity")
        return None if grid is None else Velocity(grid, seconds)

    def _scale(self, prim: Usd.Prim, time: Usd.TimeCode) -> float:
        for name in _SCALES:
            attribute = prim.GetAttribute(name)
            if attribute and attribute.HasAuthoredValue():
                return number(attribute.Get(time), 1.0)
        return 1.0
