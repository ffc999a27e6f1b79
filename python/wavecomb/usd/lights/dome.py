# SPDX-License-Identifier: Apache-2.0
"""Orientation, image formats and portals of dome lights.

UsdLux names image formats but does not define their orientation. In Wavecomb, the image centre of
each format maps to the dome's +z, and the top of the image to +y. Angular maps and cube crosses
show the environment from inside, so that the right side of the image is at -x. A mirrored ball is a
photograph of a reflection, so that the right side of the image is at +x.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from wavecomb.usd.instances.point_instancer import are_valid
from wavecomb.usd.materials.colour_space import LINEAR, OCIO_NAMES, RAW, SRGB, canonical, convert
from wavecomb.usd.materials.network import number, word
from wavecomb.usd.materials.pixels import Image, read_image
from wavecomb.usd.materials.texture import TextureTable
from wavecomb.usd.stage.context import LoadContext

Matrices = NDArray[np.float64]

Y_TO_Z = np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0], [0, -1.0, 0, 0], [0, 0, 0, 1.0]])
"""Rotation from +Y to +Z for row vectors, which UsdLux applies to domes on Z-up stages."""


class DomeReader:
    """Reader of the dome lights of one stage."""

    def __init__(self, context: LoadContext, textures: TextureTable | None) -> None:
        """Creates a reader; images are not read if ``textures`` is None."""
        self.time, self.report = context.time, context.report
        self.up_axis = context.up_axis
        self.textures = textures
        self._made: dict[tuple[str, str, str], int] = {}

    def pole(self, prim: Usd.Prim) -> Matrices:
        """Returns the rotation (4, 4) of +Y to the pole, which is poleAxis for DomeLight_1."""
        axis = prim.GetAttribute("poleAxis").Get(self.time)
        if axis == "scene":
            axis = self.up_axis
        return Y_TO_Z if axis == "Z" else np.eye(4)

    def resampled(self, prim: Usd.Prim, path: str, image: Image, tag: str) -> int | None:
        """Returns a texture of the image resampled to latlong; None if the image is latlong.

        ``tag`` is the colour space of the image, or "auto".
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
        form = word(prim.GetAttribute("inputs:texture:format").Get(self.time), "automatic")
        if form not in (*FORMATS, "automatic"):
            self.report.warn(f"unknown texture format {form}: read as latlong", prim.GetPath())
            return "latlong"
        return form

    def portals(self, prim: Usd.Prim, local: Matrices) -> Matrices | None:
        """Returns the transform (k, 4, 4) of each portal from the unit square to dome space.

        Returns None if the light has no valid portal. ``local`` is the dome's rotation from
        ``pole``.
        """
        relation = prim.GetRelationship("portals")
        found = []
        for path in relation.GetForwardedTargets() if relation else ():
            portal = prim.GetStage().GetPrimAtPath(path)
            if not portal or portal.GetTypeName() != "PortalLight":
                self.report.warn(f"portal {path} is not a PortalLight: left out", prim.GetPath())
                continue
            cache = UsdGeom.XformCache(self.time)
            dome = local @ np.array(cache.GetLocalToWorldTransform(prim))
            sides = [portal.GetAttribute(f"inputs:{s}").Get(self.time) for s in ("width", "height")]
            size = [abs(number(side, 1.0)) for side in sides]
            place = np.array(cache.GetLocalToWorldTransform(portal))
            square = np.diag((*size, 1.0, 1.0)) @ place
            if not are_valid(np.stack([dome, square])).all():
                self.report.warn("portal left out: its transform has no inverse", path)
                continue
            found.append(square @ np.linalg.inv(dome))
        return np.stack(found) if found else None


def soft_dome() -> NDArray[np.float32]:
    """Returns the default environment (64, 128, 3), which is bright above and warm grey below."""
    rows = (np.arange(64, dtype=np.float32) + 0.5) / 64
    height = np.cos(np.pi * rows)[:, None]
    blend = 1.0 / (1.0 + np.exp(-6.0 * height))
    sky, ground = np.array([1.0, 1.03, 1.08]), np.array([0.42, 0.40, 0.38])
    image = ground + blend * (sky - ground)
    return np.ascontiguousarray(np.repeat(image[:, None], 128, axis=1), np.float32)


FORMATS = ("latlong", "mirroredBall", "angular", "cubeMapVerticalCross")
MAX_HEIGHT = 2048
"""Largest height of a resampled latlong image in pixels."""

_SUBSAMPLES = 2
_ROWS = 64

Floats = NDArray[np.float64]


def format_of(name: str, size: tuple[int, int]) -> str:
    """Returns ``name``, or the format of an image (height, width) if the name is "automatic".

    An image whose height to width ratio is 4 to 3 is a cross; any other image is latlong.
    """
    if name != "automatic":
        return name
    height, width = size
    return "cubeMapVerticalCross" if 3 * height == 4 * width else "latlong"


def to_latlong(pixels: NDArray[Any], form: str) -> NDArray[np.float32]:
    """Resamples an image (h, w, c) of one of ``FORMATS`` to latlong (n, 2 n, c).

    Each pixel is the mean of several bilinear samples of the original.
    """
    height, width, channels = pixels.shape
    face = height // 4 if form == "cubeMapVerticalCross" else 0
    rows = min(max(2 * face or min(height, width), 4), MAX_HEIGHT)
    out = np.empty((rows, 2 * rows, channels), np.float32)
    source = np.asarray(pixels, np.float32)
    n = _SUBSAMPLES
    lon = np.pi - (np.arange(2 * rows * n) + 0.5) * (np.pi / (rows * n))
    for first in range(0, rows, _ROWS):
        last = min(first + _ROWS, rows)
        lat = np.pi / 2 - (np.arange(first * n, last * n) + 0.5) * (np.pi / (rows * n))
        ring = np.cos(lat)[:, None]
        x, y, z = np.broadcast_arrays(
            ring * np.sin(lon), np.sin(lat)[:, None], ring * np.cos(lon)
        )  # fmt: skip
        u, v, low, high = _image_coordinates(x, y, z, form)
        values = _bilinear(source, u, v, low, high)
        fine = values.reshape(last - first, n, 2 * rows, n, channels)
        out[first:last] = fine.mean(axis=(1, 3))
    return out


def _image_coordinates(
    x: Floats, y: Floats, z: Floats, form: str
) -> tuple[Floats, Floats, Any, Any]:
    """Maps directions to image coordinates (u, v) in [0, 1]; u grows rightwards, v downwards.

    Also returns the range of (u, v) that bilinear filtering may read.
    """
    if form == "mirroredBall":
        # The normal of the mirrored ball is halfway between the reflected direction (x, y, z) and
        # the direction +z to the viewer.
        length = np.sqrt(np.maximum(2.0 + 2.0 * z, 1e-30))
        return 0.5 + 0.5 * x / length, 0.5 - 0.5 * y / length, (0.0, 0.0), (1.0, 1.0)
    if form == "angular":
        across = np.hypot(x, y)
        scale = 0.5 / np.pi * np.arctan2(across, z) / np.maximum(across, 1e-30)
        return 0.5 - scale * x, 0.5 - scale * y, (0.0, 0.0), (1.0, 1.0)
    return _cross(x, y, z)


def _cross(x: Floats, y: Floats, z: Floats) -> tuple[Floats, Floats, Any, Any]:
    ax, ay, az = np.abs(x), np.abs(y), np.abs(z)
    along_x = (ax > ay) & (ax > az)
    along_y = ~along_x & (ay > az)
    along_z = ~along_x & ~along_y
    faces = (
        # Each row describes a face of the cube map: the mask of directions that hit the face, the
        # column and row of the face in the image, the coordinate to the right and the coordinate
        # upwards.
        (along_z & (z > 0), 1, 1, -x, y),
        (along_y & (y > 0), 1, 0, -x, -z),
        (along_y & (y <= 0), 1, 2, -x, z),
        (along_z & (z <= 0), 1, 3, -x, -y),
        (along_x & (x > 0), 0, 1, z, y),
        (along_x & (x <= 0), 2, 1, -z, y),
    )
    major = np.maximum(np.maximum(ax, ay), az)
    u, v = np.empty_like(major), np.empty_like(major)
    column, row = np.empty_like(major), np.empty_like(major)
    for where, at_column, at_row, right, up in faces:
        column[where], row[where] = at_column, at_row
        u[where] = (at_column + 0.5 + 0.5 * (right / major)[where]) / 3
        v[where] = (at_row + 0.5 - 0.5 * (up / major)[where]) / 4
    return u, v, (column / 3, row / 4), ((column + 1) / 3, (row + 1) / 4)


def _bilinear(image: NDArray[np.float32], u: Floats, v: Floats, low: Any, high: Any) -> Any:
    height, width = image.shape[:2]

    def taps(at: Floats, size: int, lowest: Any, highest: Any) -> tuple[Any, Any, Any]:
        first, last = np.asarray(lowest) * size, np.asarray(highest) * size - 1
        place = np.clip(at * size - 0.5, first, np.maximum(last, first))
        index = np.minimum(place.astype(np.int64), size - 1)
        after = np.minimum(index + 1, np.maximum(last, first).round().astype(np.int64))
        return index, after, (place - index)[..., None].astype(np.float32)

    x0, x1, fx = taps(u, width, low[0], high[0])
    y0, y1, fy = taps(v, height, low[1], high[1])
    top = image[y0, x0] * (1 - fx) + image[y0, x1] * fx
    bottom = image[y1, x0] * (1 - fx) + image[y1, x1] * fx
    return top * (1 - fy) + bottom * fy
