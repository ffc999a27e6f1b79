# SPDX-License-Identifier: Apache-2.0
"""What domes have of their own: how they are turned, images in other formats, portals."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from wavecomb.usd.lights.dome_formats import FORMATS, format_of, to_latlong
from wavecomb.usd.looks.colour_space import LINEAR, OCIO_NAMES, RAW, SRGB, canonical, convert
from wavecomb.usd.looks.network import number, word
from wavecomb.usd.looks.pixels import Image, read_image
from wavecomb.usd.looks.texture import TextureTable
from wavecomb.usd.stage.instancing import sound
from wavecomb.usd.stage.report import LoadReport

Matrices = NDArray[np.float64]

Y_TO_Z = np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0], [0, -1.0, 0, 0], [0, 0, 0, 1.0]])
"""Turns +Y to +Z, row vectors: what UsdLux does to a dome on a Z-up stage."""


class DomeReader:
    """Reads the domes of one stage."""

    def __init__(
        self,
        time: Usd.TimeCode,
        up_axis: str,
        textures: TextureTable | None,
        report: LoadReport,
    ) -> None:
        """``textures``: None: images are not asked for."""
        self.time = time
        self.up_axis = up_axis
        self.textures = textures
        self.report = report
        self._made: dict[tuple[str, str, str], int] = {}

    def pole(self, prim: Usd.Prim) -> Matrices:
        """Where the pole starts (4, 4): +Y for DomeLight, by poleAxis for DomeLight_1."""
        attribute = prim.GetAttribute("poleAxis")
        axis = attribute.Get(self.time) if attribute else "Y"
        if axis == "scene":
            axis = self.up_axis
        return Y_TO_Z if axis == "Z" else np.eye(4)

    def resampled(self, prim: Usd.Prim, path: str, image: Image, tag: str) -> int | None:
        """The texture of an image in a format other than latlong, as a latlong one.

        None: it is latlong. ``tag``: colour space, or auto.
        """
        form = format_of(self._format(prim), image.size)
        if form == "latlong" or self.textures is None:
            return None
        key = (path, tag, form)
        if key not in self._made:
            space = canonical(tag) if tag != "auto" else None
            if space is None:
                space = SRGB if image.automatic_srgb else LINEAR
            pixels = read_image(path).take()
            if image.channels < 3:
                pixels = np.repeat(pixels[..., :1], 3, axis=2)
            pixels = pixels[..., :3]
            working = self.textures.working
            if pixels.dtype == np.uint8 or space not in (RAW, OCIO_NAMES[working]):
                pixels = convert(pixels, OCIO_NAMES[working] if space == RAW else space, working)
            self._made[key] = self.textures.add_pixels(path, to_latlong(pixels, form))
        return self._made[key]

    def _format(self, prim: Usd.Prim) -> str:
        attribute = prim.GetAttribute("inputs:texture:format")
        form = word(attribute.Get(self.time) if attribute else None, "automatic")
        if form not in (*FORMATS, "automatic"):
            self.report.warn(f"unknown texture format {form}: read as latlong", prim.GetPath())
            return "latlong"
        return form

    def portals(self, prim: Usd.Prim, local: Matrices) -> Matrices | None:
        """The portals of a dome (k, 4, 4), from the unit square to the dome's own space.

        ``local``: From ``pole``. None: there are none.
        """
        relation = prim.GetRelationship("portals")
        found = []
        for path in relation.GetForwardedTargets() if relation else ():
            portal = prim.GetStage().GetPrimAtPath(path)
            if not portal or portal.GetTypeName() != "PortalLight":
                self.report.warn(f"portal {path} is no PortalLight: left out", prim.GetPath())
                continue
            cache = UsdGeom.XformCache(self.time)
            dome = local @ np.array(cache.GetLocalToWorldTransform(prim))
            sides = [portal.GetAttribute(f"inputs:{s}").Get(self.time) for s in ("width", "height")]
            size = [abs(number(side, 1.0)) for side in sides]
            place = np.array(cache.GetLocalToWorldTransform(portal))
            square = np.diag((*size, 1.0, 1.0)) @ place
            if not sound(np.stack([dome, square])).all():
                self.report.warn("portal left out: its transform has no inverse", path)
                continue
            found.append(square @ np.linalg.inv(dome))
        return np.stack(found) if found else None


def soft_dome() -> NDArray[np.float32]:
    """The environment of a stage without lights, (64, 128, 3): bright above, warm grey below."""
    rows = (np.arange(64, dtype=np.float32) + 0.5) / 64
    height = np.cos(np.pi * rows)[:, None]
    blend = 1.0 / (1.0 + np.exp(-6.0 * height))
    sky, ground = np.array([1.0, 1.03, 1.08]), np.array([0.42, 0.40, 0.38])
    image = ground + blend * (sky - ground)
    return np.ascontiguousarray(np.repeat(image[:, None], 128, axis=1), np.float32)


def up_rotation(up_axis: str) -> NDArray[np.float64]:
    """Turns +Y to the stage's up axis, row vectors."""
    return Y_TO_Z if up_axis == "Z" else np.eye(4)
