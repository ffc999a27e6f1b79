# SPDX-License-Identifier: Apache-2.0
"""Filters of lights: barn doors, pictures that are thrown, decay.

Filters have no schema of their own in UsdLux: what one is, its prim's type says, or what
``lightFilter:shaderId`` names, and its inputs are called as the renderer has it whose filter it is.
Read are RenderMan's barns and cookies, which stand where their prim is, and Arnold's barn doors,
gobos and decay.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdShade

from wavecomb.usd.looks.colour_space import space_of
from wavecomb.usd.looks.network import number, word
from wavecomb.usd.looks.texture import TextureTable, asset_file
from wavecomb.usd.stage.report import LoadReport

if TYPE_CHECKING:
    from wavecomb import _core

Line = tuple[float, float, float]
"""a, b, c of a x + b y + c."""

_PREFIXES = (
    "inputs:", "inputs:ri:light:", "inputs:ri:lightFilter:", "inputs:arnold:", "arnold:",
    "primvars:arnold:", "ri:light:", "ri:lightFilter:", "",
)  # fmt: skip
"""What inputs of filters begin with, by who wrote them."""

_OPEN: Line = (0.0, 0.0, 1.0)
_SHARP = 1e5
"""Steps in a window's size over which a hard edge falls."""


@dataclass(frozen=True)
class Filter:
    """A filter, as ``SceneBuilder.add_light_filter`` takes it.

    Attributes:
        matrix: (4, 4) from its own space to the light's.
        distance: Of the window, along -z; 0: none.
        sides: Four lines that light must be above.
        picture: Lines that give u and v of the texture.
        texture: Its id.
        decay: near start, near end, far start, far end.
        density: How much of it there is.
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
    """The number of the filters of a light that is placed by ``transform``, together."""
    known: int | None = None
    for one in filters:
        known = builder.add_light_filter(
            np.ascontiguousarray(one.matrix @ transform), float(one.distance), tuple(one.sides),
            *one.picture, one.texture, one.decay, float(one.density), known,
        )  # fmt: skip
    return known


class FilterReader:
    """Reads the filters of the lights of one stage."""

    def __init__(
        self, time: Usd.TimeCode, textures: TextureTable | None, report: LoadReport
    ) -> None:
        self._time = time
        self._textures = textures
        self._report = report
        self._readers: dict[str, Callable[[Usd.Prim, Usd.Prim], Filter | None]] = {
            "pxrbarnlightfilter": self._barn, "pxrbarn": self._barn,
            "pxrcookielightfilter": self._cookie, "pxrcookie": self._cookie,
            "arnoldbarndoor": self._doors, "barndoor": self._doors,
            "arnoldgobo": self._gobo, "gobo": self._gobo,
            "arnoldlightdecay": self._decay, "lightdecay": self._decay,
        }  # fmt: skip

    def of(self, light: Usd.Prim, kind: str) -> tuple[Filter, ...]:
        """What is read of a light's ``light:filters``; the rest is listed."""
        relationship = light.GetRelationship("light:filters")
        targets = relationship.GetForwardedTargets() if relationship else []
        if targets and kind not in ("rect", "disk", "sphere", "cylinder"):
            self._report.missing(f"light filters of {kind} lights", light.GetPath())
            return ()
        found = []
        for target in targets:
            prim = light.GetStage().GetPrimAtPath(target)
            if not prim:
                self._report.warn(f"light filter {target} is not there", light.GetPath())
                continue
            name = _kind(prim)
            reader = self._readers.get(name.lower().replace("_", "").rsplit(":", 1)[-1])
            if reader is None:
                self._report.missing(f"light filter {name or prim.GetTypeName()}", prim.GetPath())
                continue
            one = reader(prim, light)
            if one is not None:
                found.append(replace(one, density=self._number(prim, "density", 1.0)))
        return tuple(found)

    # ---- kinds -----------------------------------------------------------------------------

    def _barn(self, prim: Usd.Prim, light: Usd.Prim) -> Filter:
        """A window at the prim's own origin, whose edge lies outside."""
        if word(self._value(prim, "barnMode"), "physical") != "physical":
            self._report.missing("analytic light barns (as physical ones)", prim.GetPath())
        if self._number(prim, "radius", 0.0) > 0:
            self._report.missing("round corners of light barns (square)", prim.GetPath())
        half = 0.5 * self._number(prim, "width", 1.0) * self._number(prim, "scaleWidth", 1.0)
        tall = 0.5 * self._number(prim, "height", 1.0) * self._number(prim, "scaleHeight", 1.0)
        edge = self._number(prim, "edgeThickness", self._number(prim, "edge", 0.0))
        sides = []
        for name, x, y, room in (
            ("Left", 1.0, 0.0, half), ("Right", -1.0, 0.0, half),
            ("Bottom", 0.0, 1.0, tall), ("Top", 0.0, -1.0, tall),
        ):  # fmt: skip
            room += self._number(prim, f"refine{name}", 0.0)
            thick = edge * self._number(prim, f"edge{name}", 1.0)
            sides.append(_side(x, y, room + thick, thick, max(half, tall)))
        return Filter(_before(prim, light, self._time), 1.0, sides)

    def _cookie(self, prim: Usd.Prim, light: Usd.Prim) -> Filter | None:
        """A picture at the prim's own origin, as seen from where light comes; black beyond it."""
        texture = self._texture(prim, "textureMap", self._word(prim, "tileMode", "off"))
        if texture is None:
            return None
        w, h = (max(self._number(prim, name, 1.0), 1e-6) for name in ("width", "height"))
        return Filter(
            _before(prim, light, self._time), 1.0,
            picture=((1 / w, 0.0, 0.5), (0.0, 1 / h, 0.5)), texture=texture,
        )  # fmt: skip

    def _doors(self, prim: Usd.Prim, light: Usd.Prim) -> Filter:
        """Flaps over the square around a spot light's cone, from 0 at its left and top to 1."""
        away, size = self._cone(prim, light)
        usual = {"top": 0.0, "left": 0.0, "bottom": 1.0, "right": 1.0}
        ends = {"top": ("left", "right"), "bottom": ("left", "right")}
        sides = []
        for flap, shut in usual.items():
            first, last = (
                self._number(prim, f"barndoor_{flap}_{end}", shut)
                for end in ends.get(flap, ("top", "bottom"))
            )
            edge = self._number(prim, f"barndoor_{flap}_edge", 0.0)
            # (across, along) = what the flap moves by, and what its ends are at; in the square.
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

    def _gobo(self, prim: Usd.Prim, light: Usd.Prim) -> Filter | None:
        """A picture over the square around a spot light's cone."""
        texture = self._texture(prim, "slidemap", self._word(prim, "swrap", "clamp"))
        if texture is None:
            return None
        away, size = self._cone(prim, light)
        angle = math.radians(self._number(prim, "rotate", 0.0))
        cos, sin = math.cos(angle), math.sin(angle)
        s, t = (self._number(prim, name, 1.0) for name in ("sscale", "tscale"))
        k = 0.5 / size
        u: Line = (k * cos * s, k * sin * s, 0.5)
        v: Line = (-k * sin * t, k * cos * t, 0.5)
        return Filter(np.eye(4), away, picture=(u, v), texture=texture)

    def _decay(self, prim: Usd.Prim, light: Usd.Prim) -> Filter:
        decay = [0.0] * 4
        for i, name in enumerate(("near", "far")):
            if self._value(prim, f"use_{name}_atten"):
                decay[2 * i] = self._number(prim, f"{name}_start", 0.0)
                decay[2 * i + 1] = self._number(prim, f"{name}_end", 0.0)
        return Filter(np.eye(4), decay=(decay[0], decay[1], decay[2], decay[3]))

    # ---- inputs ----------------------------------------------------------------------------

    def _attribute(self, prim: Usd.Prim, name: str) -> Usd.Attribute | None:
        for prefix in _PREFIXES:
            attribute = prim.GetAttribute(prefix + name)
            if attribute and (attribute.HasAuthoredValue() or attribute.HasAuthoredConnections()):
                return attribute
        return None

    def _value(self, prim: Usd.Prim, name: str) -> Any:
        attribute = self._attribute(prim, name)
        return None if attribute is None else attribute.Get(self._time)

    def _number(self, prim: Usd.Prim, name: str, default: float) -> float:
        value = self._value(prim, name)
        return default if value is None else number(value, default)

    def _word(self, prim: Usd.Prim, name: str, default: str) -> str:
        value = self._value(prim, name)
        return default if value is None else word(value, default)

    def _cone(self, prim: Usd.Prim, light: Usd.Prim) -> tuple[float, float]:
        """A distance at which the light is small; half the side of the square around its cone."""
        attribute = light.GetAttribute("inputs:shaping:cone:angle")
        angle = number(attribute.Get(self._time), 90.0) if attribute else 90.0
        if not angle < 89.0:
            self._report.missing(
                "doors of lights without a cone (as of 45 degrees)", prim.GetPath()
            )
            angle = 45.0
        sizes = [light.GetAttribute(f"inputs:{name}") for name in ("radius", "width", "height")]
        extent = max((number(a.Get(self._time), 0.0) for a in sizes if a), default=0.0)
        away = 10.0 * max(abs(extent), 0.1)
        return away, away * math.tan(math.radians(max(angle, 0.1)))

    def _texture(self, prim: Usd.Prim, name: str, wrap: str) -> int | None:
        """The id of a file that an input names, or the image that is connected to it."""
        attribute = self._attribute(prim, name)
        if attribute is not None and attribute.HasAuthoredConnections():
            sources = UsdShade.Utils.GetValueProducingAttributes(UsdShade.Input(attribute))
            node = sources[0].GetPrim() if sources else None
            attribute = None
            for one in ("filename", "file"):
                if node is not None and attribute is None:
                    attribute = self._attribute(node, one)
        value = attribute.Get(self._time) if attribute is not None else None
        path = asset_file(value, attribute) if value is not None else ""
        if not path or self._textures is None:
            self._report.missing(f"light filter without a file for {name}", prim.GetPath())
            return None
        image = self._textures.image(path, prim.GetPath())
        if image is None:
            return None
        over = {"periodic": "repeat", "tile": "repeat", "mirror": "mirror", "clamp": "clamp"}
        edge = over.get(wrap, "black")
        tag = space_of(attribute) or "auto"
        return self._textures.add(path, image, tag, edge, edge, is_colour=True)


def _kind(prim: Usd.Prim) -> str:
    """What a filter is."""
    name = str(prim.GetTypeName())
    if name in ("LightFilter", "PluginLightFilter", ""):
        attribute = prim.GetAttribute("lightFilter:shaderId")
        name = word(attribute.Get(), "") if attribute else ""
    return name


def _before(prim: Usd.Prim, light: Usd.Prim, time: Usd.TimeCode) -> NDArray[np.float64]:
    """From a filter, whose window is at its origin, to the light's space."""
    cache = UsdGeom.XformCache(time)
    there = np.array(cache.GetLocalToWorldTransform(light), np.float64)
    # Types that USD does not know have transforms that its caches do not see.
    local = UsdGeom.Xformable(prim).GetLocalTransformation(time)
    own = np.array(local, np.float64) @ np.array(cache.GetParentToWorldTransform(prim), np.float64)
    forward = np.eye(4)
    forward[3, 2] = 1.0  # a window is at -1
    return np.asarray(forward @ own @ np.linalg.pinv(there), np.float64)


def _scaled(line: Line, edge: float, size: float) -> Line:
    """A line that light passes within ``edge``; of 0 at once."""
    k = 1.0 / edge if edge > size / _SHARP else _SHARP / size
    return (line[0] * k, line[1] * k, line[2] * k)


def _side(x: float, y: float, room: float, edge: float, size: float) -> Line:
    """The side towards -(x, y), ``room`` from the middle."""
    return _scaled((x, y, room), edge, max(size, 1e-6))
