# SPDX-License-Identifier: Apache-2.0
"""Reads UsdVol volumes for the core, with motion blur by velocity grids."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdVol

from wavecomb import vdb
from wavecomb.image.working_space import from_rec709
from wavecomb.usd.materials.draw_item import DrawItem
from wavecomb.usd.materials.network import number
from wavecomb.usd.stage.context import LoadContext
from wavecomb.usd.volumes.grids import Field, Grid, GridFacts, GridTable, read_fields
from wavecomb.usd.volumes.material import VolumeMaterials
from wavecomb.usd.volumes.optical_properties import BLACK, Colour, OpticalProperties

GLOW = 1e-4
"""Minimum product of emission and size for which a volume counts as a light."""

_MAX_ANISOTROPY = 0.999


@dataclass(frozen=True)
class Volume:
    """A volume without its world transform.

    Attributes:
        options: Arguments of ``SceneBuilder.add_volume`` except ``to_world``.
        corners: (8, 3) corners of the volume's bounds in object space.
        grids: Descriptions of the volume's grids.
        may_light: Whether the volume's emission may be strong enough to light a scene.
    """

    options: dict[str, Any]
    corners: NDArray[np.float64]
    grids: tuple[GridFacts, ...]
    may_light: bool


class VolumeReader:
    """Reader of the volumes of one stage.

    Attributes:
        may_light: Whether the emission of any volume may be strong enough to light the scene.
    """

    def __init__(self, context: LoadContext) -> None:
        self._time, self._report = context.time, context.report
        self._working = context.options.working_space
        self._velocities = VelocityReader(context)
        self._grids = GridTable(context)
        metres = UsdGeom.GetStageMetersPerUnit(context.stage)
        self._materials = VolumeMaterials(self._time, metres, self._report)
        self.may_light = False

    def read(self, draw: DrawItem) -> Volume | None:
        """Reads the volume of a prim; reports and returns None if there is nothing to render.

        Raises:
            WavecombError: A file is corrupt or contains values that are invalid for a volume.
        """
        prim = draw.prim
        fields = read_fields(prim, self._time, self._report)
        if not fields and UsdVol.Volume(prim).GetFieldPaths():
            # All fields of the volume are invalid, and read_fields() has reported them.
            return None
        properties = self._materials.of(draw.material, prim)
        if fields and not vdb.is_there():
            self._report.missing(f"Volume without {vdb.ABSENT}: left out", prim.GetPath())
            return None
        density = self._density(prim, fields, properties) if fields else None
        corners = density.corners if density is not None else None
        options: dict[str, Any] = {"density": None if density is None else density.handle}
        if not fields:
            bounds = self._extent(prim)
            if bounds is None:
                what = "volume without fields and without an extent: left out"
                self._report.warn(what, prim.GetPath())
                return None
            options["bounds"] = (tuple(bounds[0].tolist()), tuple(bounds[1].tolist()))
            corners = np.array([[bounds[i, 0], bounds[j, 1], bounds[k, 2]]
                                for i in (0, 1) for j in (0, 1) for k in (0, 1)])  # fmt: skip
        if corners is None:
            return None
        colour = self._named(fields, properties.colour, "colour")
        use = "temperature" if properties.kelvin else "emission"
        emission_field = (
            self._named(fields, properties.emission_field, use, properties.kelvin)
            if any(properties.emission)
            else None
        )
        velocity = self._velocities.find(prim, fields, self._grids, self._time)
        if density is not None and velocity is not None:
            options |= {"velocity": velocity.grid.handle, "seconds": velocity.seconds}
        emission = (
            properties.emission
            if emission_field is not None or not properties.emission_field
            else BLACK
        )
        options |= {
            "color": None if colour is None else colour.handle,
            "emission_grid": None if emission_field is None else emission_field.handle,
            "extinction": self._working_colour(properties.extinction),
            "albedo": self._working_colour(properties.albedo),
            "anisotropy": self._anisotropy(properties, prim),
            "emission": self._working_colour(emission),
            "name": self._report.place(prim.GetPath()),
        }
        velocity_grid = None if velocity is None else velocity.grid
        used = tuple(
            grid.facts
            for grid in (density, colour, emission_field, velocity_grid)
            if grid is not None
        )
        size = float(np.ptp(corners, axis=0).max())
        may_light = max(emission) * size > GLOW
        self.may_light = self.may_light or may_light
        return Volume(options, corners, used, may_light)

    def _density(
        self, prim: Usd.Prim, fields: dict[str, Field], properties: OpticalProperties
    ) -> Grid | None:
        """Returns the density grid of a volume."""
        field = self._grids.find(fields, properties.density) if properties.density else None
        if field is None:
            if properties.density and properties.density != "density":
                what = f"volume without the field {properties.density}: its density used"
                self._report.warn(what, prim.GetPath())
            field = fields.get("density") or self._grids.densest(fields)
        return None if field is None else self._grids.get(field, "density")

    def _named(
        self, fields: dict[str, Field], name: str, use: str, kelvin: float = 0.0
    ) -> Grid | None:
        field = self._grids.find(fields, name) if name and fields else None
        return None if field is None else self._grids.get(field, use, kelvin)

    def _extent(self, prim: Usd.Prim) -> NDArray[np.float64] | None:
        value = UsdGeom.Boundable(prim).GetExtentAttr().Get(self._time)
        if value is None or len(value) != 2:
            return None
        bounds = np.array(value, np.float64)
        is_box = np.isfinite(bounds).all() and (bounds[0] < bounds[1]).all()
        return bounds if is_box else None

    def _working_colour(self, colour: Colour) -> Colour:
        r, g, b = (max(float(c), 0.0) for c in from_rec709(np.array(colour), self._working))
        return (r, g, b)

    def _anisotropy(self, properties: OpticalProperties, prim: Usd.Prim) -> float:
        limited = min(max(properties.anisotropy, -_MAX_ANISOTROPY), _MAX_ANISOTROPY)
        if limited != properties.anisotropy:
            what = f"anisotropy {properties.anisotropy:g} of a volume: {limited:g} used"
            self._report.warn(what, properties.name or prim.GetPath())
        return limited


_NAMES = ("velocity", "vel", "v")
_PARTS = {name + sign + axis for name in _NAMES for sign in ("", "_", ".") for axis in "xyz"}
_SCALES = ("primvars:arnold:velocity_scale", "arnold:velocity_scale")


@dataclass(frozen=True)
class Velocity:
    """Velocities of a moving volume.

    Attributes:
        grid: Grid of vectors in object-space units per second.
        seconds: Opening and closing time of the shutter relative to the frame, times the velocity
            scale.
    """

    grid: Grid
    seconds: tuple[float, float]


class VelocityReader:
    """Reader of the velocity grids of the volumes of one stage."""

    def __init__(self, context: LoadContext) -> None:
        per_second, motion = context.stage.GetTimeCodesPerSecond(), context.motion
        self._seconds = (0.0, 0.0)
        if motion is not None and per_second > 0:
            opens, closes = motion.shutter
            self._seconds = (opens / per_second, closes / per_second)
        self._is_blurred = motion is not None
        self._report = context.report

    def find(
        self, prim: Usd.Prim, fields: Mapping[str, Field], grids: GridTable, time: Usd.TimeCode
    ) -> Velocity | None:
        """Returns the velocities of a volume; None if it is static. Reports motion that is ignored.

        Raises:
            WavecombError: The file is corrupt or contains values that are invalid as velocities.
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
            if attribute.HasAuthoredValue():
                return number(attribute.Get(time), 1.0)
        return 1.0
