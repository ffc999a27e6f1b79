# SPDX-License-Identifier: Apache-2.0
"""Light filters: barn doors, gobos (projected images) and decay.

UsdLux does not define types of light filters. The type of a filter is its prim type or its
``lightFilter:shaderId``. Its inputs have the names that the filter's renderer defines. Supported
filters are RenderMan's barn and cookie (positioned by their prims), Arnold's barn doors, gobo and
decay, and Karma's barn doors (also as inputs of the light) and gobo.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdShade

from wavecomb.usd.lights.filter_inputs import (
    GELS,
    OF_LIGHTS,
    FilterInputs,
    filter_prims,
    kind_of,
    plain_kind,
)
from wavecomb.usd.materials.network import asset_file, number, space_of
from wavecomb.usd.materials.texture import TextureTable
from wavecomb.usd.stage.collections import Collections
from wavecomb.usd.stage.context import LoadContext

if TYPE_CHECKING:
    from wavecomb import _core

Line = tuple[float, float, float]
"""Coefficients a, b, c of a x + b y + c."""

_OPEN: Line = (0.0, 0.0, 1.0)
_FLAPS = {"left": (1.0, 0.0), "right": (-1.0, 0.0), "bottom": (0.0, 1.0), "top": (0.0, -1.0)}
"""Karma's four barn doors, each with its direction in (x, y)."""
_SHARP = 1e5
"""Slope of a hard edge, relative to the size of the filter window."""


@dataclass(frozen=True)
class Filter:
    """A light filter for ``SceneBuilder.add_light_filter``.

    Attributes:
        matrix: (4, 4) transform from filter space to light space.
        distance: Distance of the filter window along -z; 0 disables the window.
        sides: Four linear functions, one for each edge; light passes where all four are positive.
        picture: Two linear functions that compute the texture coordinates u and v.
        texture: Texture id.
        decay: Distances at which light decays: near start, near end, far start and far end.
        density: Strength of the filter.
    """

    matrix: NDArray[np.float64]
    distance: float = 0.0
    sides: Sequence[Line] = (_OPEN,) * 4
    picture: tuple[Line, Line] = ((1.0, 0.0, 0.5), (0.0, 1.0, 0.5))
    texture: int | None = None
    decay: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    density: float = 1.0


def add_filters(
    builder: _core.SceneBuilder, filters: Sequence[Filter], transform: NDArray[np.float64]
) -> int | None:
    """Adds the filters of a light with the given transform; returns the id of their combination."""
    known: int | None = None
    for one in filters:
        known = builder.add_light_filter(
            np.ascontiguousarray(one.matrix @ transform), float(one.distance), tuple(one.sides),
            *one.picture, one.texture, one.decay, float(one.density), known,
        )  # fmt: skip
    return known


class FilterReader:
    """Reader of the light filters of one stage."""

    def __init__(self, context: LoadContext, textures: TextureTable | None) -> None:
        self._time, self._report = context.time, context.report
        self._textures = textures
        self._collections = Collections(self._report)
        self._readers: dict[str, Callable[[FilterInputs, Usd.Prim], Filter | None]] = {
            "pxrbarnlightfilter": self._barn, "pxrbarn": self._barn,
            "pxrcookielightfilter": self._cookie, "pxrcookie": self._cookie,
            "arnoldbarndoor": self._doors, "barndoor": self._doors,
            "arnoldgobo": self._gobo, "gobo": self._gobo,
            "arnoldlightdecay": self._decay, "lightdecay": self._decay,
            "kmalfilterbarndoor": self._flaps, "kmalfiltergobo": self._slide,
        }  # fmt: skip

    def of(self, light: Usd.Prim, kind: str) -> tuple[Filter, ...]:
        """Returns a light's filters and built-in barn doors; reports unsupported filters.

        Gels are not returned, since ``gel_of`` reads them.
        """
        prims = [(path, prim) for path, prim in filter_prims(light) if not _gel(prim)]
        doors = FilterInputs(light, self._time, OF_LIGHTS)
        has_doors = any(
            doors.number(f"barndoor{flap}{end}", 0.0) > 0 for flap in _FLAPS for end in ("", "edge")
        )
        if (prims or has_doors) and kind not in ("rect", "disk", "sphere", "cylinder"):
            self._report.missing(f"light filters of {kind} lights", light.GetPath())
            return ()
        found = [self._flaps(doors, light, "barndoor")] if has_doors else []
        for path, prim in prims:
            if prim is None:
                self._report.warn(f"light filter {path} does not exist", light.GetPath())
                continue
            reader = self._readers.get(plain_kind(prim))
            if reader is None:
                name = kind_of(prim) or prim.GetTypeName()
                self._report.missing(f"light filter {name}", prim.GetPath())
                continue
            if self._collections.rules(prim, "filterLink") is not None:
                self._report.missing("filterLink (light is filtered everywhere)", prim.GetPath())
            inputs = FilterInputs(prim, self._time)
            one = reader(inputs, light)
            if one is not None:
                found.append(replace(one, density=inputs.number("density", 1.0, "effect")))
        return tuple(found)

    # ---- kinds -----------------------------------------------------------------------------

    def _barn(self, inputs: FilterInputs, light: Usd.Prim) -> Filter:
        """Reads a RenderMan barn as a window at the origin of its prim with a soft edge outside."""
        if inputs.word("barnMode", "physical") != "physical":
            self._report.missing("analytic light barns (as physical ones)", inputs.prim.GetPath())
        if inputs.number("radius", 0.0) > 0:
            self._report.missing("round corners of light barns (square)", inputs.prim.GetPath())
        half = 0.5 * inputs.number("width", 1.0) * inputs.number("scaleWidth", 1.0)
        tall = 0.5 * inputs.number("height", 1.0) * inputs.number("scaleHeight", 1.0)
        edge = inputs.number("edgeThickness", inputs.number("edge", 0.0))
        sides = []
        for name, x, y, room in (
            ("Left", 1.0, 0.0, half), ("Right", -1.0, 0.0, half),
            ("Bottom", 0.0, 1.0, tall), ("Top", 0.0, -1.0, tall),
        ):  # fmt: skip
            room += inputs.number(f"refine{name}", 0.0)
            thick = edge * inputs.number(f"edge{name}", 1.0)
            sides.append(_side(x, y, room + thick, thick, max(half, tall)))
        return Filter(_before(inputs.prim, light, self._time), 1.0, sides)

    def _cookie(self, inputs: FilterInputs, light: Usd.Prim) -> Filter | None:
        """Reads a RenderMan cookie as an image at its prim's origin, surrounded by black."""
        texture = self._texture(inputs, inputs.word("tileMode", "off"), "textureMap")
        if texture is None:
            return None
        w, h = (max(inputs.number(name, 1.0), 1e-6) for name in ("width", "height"))
        return Filter(
            _before(inputs.prim, light, self._time), 1.0,
            picture=((1 / w, 0.0, 0.5), (0.0, 1 / h, 0.5)), texture=texture,
        )  # fmt: skip

    def _doors(self, inputs: FilterInputs, light: Usd.Prim) -> Filter:
        """Reads Arnold barn doors, which cover the square around the cone of a spot light.

        Door positions are 0 at the left or top edge of the square and 1 at the opposite edge.
        """
        away, size = self._cone(inputs, light)
        usual = {"top": 0.0, "left": 0.0, "bottom": 1.0, "right": 1.0}
        ends = {"top": ("left", "right"), "bottom": ("left", "right")}
        sides = []
        for flap, shut in usual.items():
            first, last = (
                inputs.number(f"barndoor_{flap}_{end}", shut)
                for end in ends.get(flap, ("top", "bottom"))
            )
            edge = inputs.number(f"barndoor_{flap}_edge", 0.0)
            # `across` and `along` are linear functions that compute coordinates in the filter's
            # square: `across` in the direction in which the barn door moves, and `along` in the
            # direction of the door's edge.
            across, along = (
                ((0.0, -0.5 / size, 0.5), (0.5 / size, 0.0, 0.5))
                if flap in ends
                else ((0.5 / size, 0.0, 0.5), (0.0, -0.5 / size, 0.5))
            )
            line = [a - (last - first) * b for a, b in zip(across, along, strict=True)]
            line[2] -= first
            sign = 1.0 if shut == 0.0 else -1.0
            a, b, c = (sign * x for x in line)
            sides.append(_OPEN if first == last == shut else _scaled((a, b, c), edge, 1.0))
        return Filter(np.eye(4), away, sides)

    def _gobo(self, inputs: FilterInputs, light: Usd.Prim) -> Filter | None:
        """Reads an Arnold gobo as an image on the square around the cone of a spot light."""
        texture = self._texture(inputs, inputs.word("swrap", "clamp"), "slidemap")
        if texture is None:
            return None
        away, size = self._cone(inputs, light)
        angle = math.radians(inputs.number("rotate", 0.0))
        cos, sin = math.cos(angle), math.sin(angle)
        s, t = (inputs.number(name, 1.0) for name in ("sscale", "tscale"))
        k = 0.5 / size
        u: Line = (k * cos * s, k * sin * s, 0.5)
        v: Line = (-k * sin * t, k * cos * t, 0.5)
        return Filter(np.eye(4), away, picture=(u, v), texture=texture)

    def _decay(self, inputs: FilterInputs, light: Usd.Prim) -> Filter:
        decay = [0.0] * 4
        for i, name in enumerate(("near", "far")):
            if inputs.value(f"use_{name}_atten"):
                decay[2 * i] = inputs.number(f"{name}_start", 0.0)
                decay[2 * i + 1] = inputs.number(f"{name}_end", 0.0)
        return Filter(np.eye(4), decay=(decay[0], decay[1], decay[2], decay[3]))

    def _flaps(self, inputs: FilterInputs, light: Usd.Prim, before: str = "") -> Filter:
        """Reads Karma barn doors, whose positions and edge softness range from 0 (open) to 1."""
        if inputs.value("invert", "invertblockers", "invert_blockers"):
            self._report.missing("inverted light doors (not inverted)", inputs.prim.GetPath())
        away, size = self._cone(inputs, light)
        sides = []
        for flap, (x, y) in _FLAPS.items():
            shut, edge = (
                max(inputs.number(f"{before}{flap}{end}", 0.0), 0.0) for end in ("", "edge")
            )
            sides.append(
                _scaled((x * 0.5 / size, y * 0.5 / size, 0.5 - shut), edge, 1.0)
                if shut > 0 or edge > 0
                else _OPEN
            )
        return Filter(np.eye(4), away, sides)

    def _slide(self, inputs: FilterInputs, light: Usd.Prim) -> Filter | None:
        """Reads a Karma gobo as an image on the square around the cone of a spot light."""
        for name in ("blur", "invert", "invertcolor"):
            if inputs.value(name):
                self._report.missing(f"{name} of a light's gobo", inputs.prim.GetPath())
        wrap = {"streak": "clamp", "decal": "black"}.get(
            inputs.word("wrap", "decal", "wrapmode", "wrap_mode"), "periodic"
        )
        texture = self._texture(inputs, wrap, "texture", "map", "texturemap")
        if texture is None:
            return None
        away, size = self._cone(inputs, light)
        lines = []
        for i, axis in enumerate("uv"):
            scale = inputs.number(f"{axis}scale", 1.0, f"{axis}_scale")
            offset = inputs.number(f"{axis}offset", 0.0, f"{axis}_offset")
            k = 0.5 / (size * scale) if abs(scale) > 1e-6 else 0.5 / size
            lines.append((0.0 if i else k, k if i else 0.0, 0.5 - offset))
        return Filter(np.eye(4), away, picture=(lines[0], lines[1]), texture=texture)

    # ---- inputs ----------------------------------------------------------------------------

    def _cone(self, inputs: FilterInputs, light: Usd.Prim) -> tuple[float, float]:
        """Returns a distance much larger than the light, and the cone's radius at this distance."""
        angle = number(light.GetAttribute("inputs:shaping:cone:angle").Get(self._time), 90.0)
        if not angle < 89.0:
            self._report.missing(
                "doors of lights without a cone (as of 45 degrees)", inputs.prim.GetPath()
            )
            angle = 45.0
        sizes = [light.GetAttribute(f"inputs:{name}") for name in ("radius", "width", "height")]
        extent = max((number(a.Get(self._time), 0.0) for a in sizes if a), default=0.0)
        away = 10.0 * max(abs(extent), 0.1)
        return away, away * math.tan(math.radians(max(angle, 0.1)))

    def _texture(self, inputs: FilterInputs, wrap: str, *names: str) -> int | None:
        """Returns the texture of a file input, or of the image node connected to the input."""
        attribute = inputs.attribute(*names)
        if attribute is not None and attribute.HasAuthoredConnections():
            sources = UsdShade.Utils.GetValueProducingAttributes(UsdShade.Input(attribute))
            node = sources[0].GetPrim() if sources else None
            attribute = node and FilterInputs(node, self._time).attribute("filename", "file")
        path = asset_file(attribute.Get(self._time), attribute) if attribute is not None else ""
        if not path or self._textures is None:
            self._report.missing(
                f"light filter without a file for {names[0]}", inputs.prim.GetPath()
            )
            return None
        image = self._textures.image(path, inputs.prim.GetPath())
        if image is None:
            return None
        over = {"periodic": "repeat", "tile": "repeat", "mirror": "mirror", "clamp": "clamp"}
        edge = over.get(wrap, "black")
        tag = space_of(attribute) or "auto"
        return self._textures.add(path, image, tag, edge, edge, is_colour=True)


def _gel(prim: Usd.Prim | None) -> bool:
    """Returns whether a filter has no effect besides a gel."""
    return prim is not None and plain_kind(prim) in GELS


def _before(prim: Usd.Prim, light: Usd.Prim, time: Usd.TimeCode) -> NDArray[np.float64]:
    """Returns the transform from a filter with a window at its origin to light space."""
    cache = UsdGeom.XformCache(time)
    there = np.array(cache.GetLocalToWorldTransform(light), np.float64)
    # XformCache ignores the transforms of prim types that USD does not know.
    local = UsdGeom.Xformable(prim).GetLocalTransformation(time)
    own = np.array(local, np.float64) @ np.array(cache.GetParentToWorldTransform(prim), np.float64)
    forward = np.eye(4)
    # Move the filter to z = 0, since the core places filter windows at z = -1.
    forward[3, 2] = 1.0
    return np.asarray(forward @ own @ np.linalg.pinv(there), np.float64)


def _scaled(line: Line, edge: float, size: float) -> Line:
    """Scales a linear function to rise by 1 over the distance ``edge``; 0 is a hard edge."""
    k = 1.0 / edge if edge > size / _SHARP else _SHARP / size
    return (line[0] * k, line[1] * k, line[2] * k)


def _side(x: float, y: float, room: float, edge: float, size: float) -> Line:
    """Returns the linear function of the window edge at distance ``room`` in direction -(x, y)."""
    return _scaled((x, y, room), edge, max(size, 1e-6))
