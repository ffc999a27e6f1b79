# SPDX-License-Identifier: Apache-2.0
"""Reads UsdLux lights."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd

from wavecomb.core_table import (
    EDITABLE,
    MESH,
    LightParameter,
    kind_of_prims,
    light_parameters,
    of_kind,
)
from wavecomb.image.working_space import LUMINANCE, from_rec709
from wavecomb.usd.lights.dome import DomeReader
from wavecomb.usd.lights.filter_inputs import Gel, gel_of
from wavecomb.usd.lights.filters import Filter, FilterReader
from wavecomb.usd.materials.colour_space import Colour
from wavecomb.usd.materials.network import (
    UDIM,
    asset_file,
    colour,
    number,
    read_colour,
    space_of,
    tile_files,
)
from wavecomb.usd.materials.pixels import Image
from wavecomb.usd.materials.texture import TextureTable
from wavecomb.usd.stage.collections import Collections, LightGroups, Rules
from wavecomb.usd.stage.context import LoadContext
from wavecomb.usd.stage.ray_visibility import inherited_rays

KINDS = kind_of_prims()
"""Kinds of supported lights, by prim type."""

_READ_APART = frozenset({
    "color", "normalize", "focus", "focus_tint", "cone_angle", "cone_softness", "ies_angle_scale",
    "ies_normalize",
})  # fmt: skip
"""Parameters that are read separately, since they depend on other inputs or on the kind of
light."""


class Profiles(Protocol):
    """Interface of a table of IES profiles."""

    def add(self, path: str, prim: Sdf.Path) -> int | None:
        """Returns the id of an IES profile; None if the file cannot be read."""


@dataclass(frozen=True)
class Light:
    """A light for ``SceneBuilder.add_light``, without its transform to the world.

    Attributes:
        kind: Kind of the light, one of the values of ``KINDS``.
        options: Keyword arguments of ``SceneBuilder.add_light``.
        local: (4, 4) transform that is applied before the transform of the prim.
        filters: Light filters in light space.
    """

    kind: str
    options: dict[str, Any]
    local: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    filters: tuple[Filter, ...] = ()


def blackbody(kelvin: float) -> tuple[float, float, float]:
    """Returns the linear Rec. 709 colour of a black body, with the luminance of white.

    Like OpenUSD's Embree delegate, this function uses ``Gf.Color``, which has Krystek's
    approximation of the Planckian locus. Temperatures are clamped to the approximation's range of
    1000 to 15000 K. ``UsdLux.BlackbodyTemperatureAsRgb``, a table up to 10000 K, differs by at most
    0.002 above 2000 K. Negative components (blue below 1900 K) become 0.
    """
    found = Gf.Color(Gf.ColorSpace(Gf.ColorSpaceNames.LinearRec709))
    found.SetFromPlanckianLocus(min(max(kelvin, 1000.0), 15000.0), 1.0)
    rgb = found.GetRGB()
    luminance = sum(w * c for w, c in zip(LUMINANCE, rgb, strict=True))
    r, g, b = (max(float(c) / luminance, 0.0) for c in rgb)
    return (r, g, b)


class LightReader:
    """Reader of the lights of one stage."""

    def __init__(
        self,
        context: LoadContext,
        textures: TextureTable | None,
        groups: LightGroups,
        profiles: Profiles | None = None,
        links: LinkTable | None = None,
    ) -> None:
        """Creates a reader; any of ``textures``, ``profiles`` and ``links`` is ignored if None."""
        self.time, self.report = context.time, context.report
        self.hidden = context.hides_lights
        self.textures = textures
        self.groups = groups
        self.profiles = profiles
        self.links = links
        self.domes = DomeReader(context, textures)
        self.filters = FilterReader(context, textures)

    def read(self, prim: Usd.Prim, scale: float = 1.0) -> Light:
        """Reads a light whose prim type is in ``KINDS``.

        ``scale`` is the scale factor of the light's transform.
        """
        kind = KINDS[str(prim.GetTypeName())]
        options = self._common(prim, kind)
        if group := self.groups.of(prim):
            options["group"] = group
        normalize = bool(self._get(prim, "normalize", False))
        local = np.eye(4)
        if kind == "rect":
            options["texture"] = self._texture(prim)
        elif kind == "sphere":
            self._sphere(prim, options, normalize, scale)
            normalize = normalize and options["radius"] > 0
        elif kind == "cylinder":
            normalize = self._cylinder(prim, options, normalize)
        elif kind == "distant":
            angle = number(self._get(prim, "angle", 0.53), 0.53)
            options["angle"] = min(max(angle, 0.0), 360.0)
        elif kind == "dome":
            options["texture"] = self._texture(prim)
            local = self.domes.pole(prim)
            portals = self.domes.portals(prim, local)
            if portals is not None:
                options["portals"] = portals
            normalize = False
        options["normalize"] = normalize
        options.update(self._visibility(prim, kind))
        return Light(kind, options, local, self.filters.of(prim, kind))

    def _visibility(self, prim: Usd.Prim, kind: str) -> dict[str, bool]:
        """Returns which rays hit the light's shape; empty for lights without a shape."""
        if kind not in light_parameters()["visible_to_camera"].kinds:
            return {}
        rays = inherited_rays(prim)
        by_camera, by_bounces = rays.get("camera", True), rays.get("bounces", True)
        seen = prim.GetAttribute("wavecomb:visible").Get(self.time) is not False
        if self.hidden or not seen or not (by_camera or by_bounces):
            return {"visible": False}
        if not by_bounces:
            self.report.missing("lights hidden from bounces only", prim.GetPath())
        return {} if by_camera else {"visible_to_camera": False}

    def read_mesh(self, prim: Usd.Prim) -> dict[str, Any]:
        """Reads a mesh light as keyword arguments of ``SceneBuilder.add_mesh_light``."""
        options = self._common(prim, "mesh")
        options["normalize"] = bool(self._get(prim, "normalize", False))
        self.filters.of(prim, "mesh")
        return options

    def _common(self, prim: Usd.Prim, kind: str) -> dict[str, Any]:
        """Reads options that all kinds of lights have."""
        gel = gel_of(prim, self.time, self.report)
        radiance = self._colour(prim, gel)
        if not all(0 <= value < 1e30 for value in radiance):
            self.report.warn("light whose colour is negative or not finite: black", prim.GetPath())
            radiance = (0.0, 0.0, 0.0)
        options: dict[str, Any] = {"name": self.report.place(prim.GetPath()), "color": radiance}
        self._shaping(prim, kind, options)
        for name, option in (("lightLink", "light_link"), ("shadowLink", "shadow_link")):
            linked = self.links.set_of(prim, name) if self.links else None
            if linked is not None:
                options[option] = linked
        if self.links and not self._get(prim, "shadow:enable", True):
            options["shadow_link"] = self.links.nothing()
        options.update(self._plain(prim, MESH if kind == "mesh" else kind))
        options.update(gel.multiplied(options))
        return options

    def _plain(self, prim: Usd.Prim, kind: str) -> dict[str, Any]:
        """Reads parameters that correspond directly to inputs of the light.

        Values that equal their defaults are left out, except the parameters of the light's shape.
        """
        options = {}
        for row in of_kind(kind):
            if not row.input or row.kind not in EDITABLE or row.name in _READ_APART:
                continue
            value = self._value(prim, row)
            if row.group == "shape" or value != row.default:
                options[row.name] = value
        return options

    def _value(self, prim: Usd.Prim, row: LightParameter) -> Any:
        """Returns a parameter clamped to its valid range; negative sizes are made positive."""
        found = self._get(prim, row.input, row.default)
        if row.kind == "flag":
            return bool(found)
        low = -math.inf if row.least is None else row.least
        high = math.inf if row.most is None else row.most
        if row.kind == "colour":
            given = self._linear(prim, row.input, colour(found, row.default))
            return tuple(min(max(float(one), low), high) for one in given)
        value = number(found, row.default)
        return min(max(abs(value) if row.group == "shape" else value, low), high)

    def _get(self, prim: Usd.Prim, name: str, default: Any) -> Any:
        attribute = prim.GetAttribute(f"inputs:{name}")
        if attribute.HasAuthoredConnections():
            self.report.missing(f"light input {name} from a shader", prim.GetPath())
        value = attribute.Get(self.time)
        return default if value is None else value

    def _colour(self, prim: Usd.Prim, gel: Gel) -> tuple[float, float, float]:
        """Returns colour * intensity * 2^exposure * colour temperature, filtered by gels."""
        # NaN marks invalid values, about which the caller warns.
        bad = math.nan
        authored = base = colour(self._get(prim, "color", (1.0, 1.0, 1.0)), (bad, bad, bad))
        base = self._linear(prim, "color", base)
        exposure = min(number(self._get(prim, "exposure", 0.0), bad), 200.0)
        power = number(self._get(prim, "intensity", 1.0), bad) * 2.0**exposure
        tint = (1.0, 1.0, 1.0)
        if self._get(prim, "enableColorTemperature", False):
            kelvin = number(self._get(prim, "colorTemperature", 6500.0), 6500.0)
            tint = blackbody(kelvin)
        r, g, b = (float(c * t * power) for c, t in zip(base, tint, strict=True))
        rgb = gel.apply((r, g, b))
        working = "rec709" if self.textures is None else self.textures.working
        r, g, b = (float(value) for value in from_rec709(np.array(rgb), working))
        # Colours outside the gamut of the working space are clipped.
        if min(authored) >= 0:
            r, g, b = max(r, 0.0), max(g, 0.0), max(b, 0.0)
        return (r, g, b)

    def _linear(self, prim: Usd.Prim, name: str, value: Colour) -> Colour:
        """Converts the colour of an input to linear Rec.709."""
        return read_colour(value, prim.GetAttribute(f"inputs:{name}"), self.report, prim.GetPath())

    def _sphere(
        self, prim: Usd.Prim, options: dict[str, Any], normalize: bool, scale: float
    ) -> None:
        """Converts a sphere of radius 0, or one with ``treatAsPoint``, to a point light."""
        radius = options["radius"]
        point = prim.GetAttribute("treatAsPoint")
        if radius > 0 and not (point and point.Get(self.time)):
            return
        # The intensity of a sphere of radiance L is L pi r^2. With `normalize`, the radiance is
        # divided by the area 4 pi r^2.
        area = 0.25 if normalize or radius == 0 else math.pi * (scale * radius) ** 2
        options["radius"] = 0.0
        options["color"] = tuple(area * value for value in options["color"])
        if radius == 0 and not normalize:
            self.report.note("sphere light of radius 0: treated as normalized", prim.GetPath())

    def _cylinder(self, prim: Usd.Prim, options: dict[str, Any], normalize: bool) -> bool:
        """Gives a cylinder of radius 0 a small radius; returns whether the light is normalised."""
        length: float = options["length"]
        if options["radius"] == 0 and length > 0:
            self.report.note(
                "cylinder light of radius 0: treated as thin and normalized", prim.GetPath()
            )
            options["radius"], normalize = 1e-3 * length, True
        return normalize

    def _shaping(self, prim: Usd.Prim, kind: str, options: dict[str, Any]) -> None:
        """Reads UsdLuxShapingAPI, whose attributes do not exist unless the schema is applied."""

        def read(name: str, default: float) -> float:
            return number(self._get(prim, f"shaping:{name}", default), default)

        shaping: dict[str, Any] = {}
        focus = read("focus", 0.0)
        if focus > 0:
            black = (0.0, 0.0, 0.0)
            tint = colour(self._get(prim, "shaping:focusTint", black), black)
            tint = self._linear(prim, "shaping:focusTint", tint)
            shaping["focus"] = focus
            shaping["focus_tint"] = tuple(min(max(float(c), 0.0), 1e6) for c in tint)
        angle = read("cone:angle", 180.0)
        if angle < 180:
            shaping["cone_angle"] = max(angle, 0.0)
            shaping["cone_softness"] = min(max(read("cone:softness", 0.0), 0.0), 1.0)
        if path := self._profile_file(prim):
            profile = self.profiles.add(path, prim.GetPath()) if self.profiles else None
            if profile is not None:
                shaping["ies"] = profile
                shaping["ies_angle_scale"] = read("ies:angleScale", 0.0)
                shaping["ies_normalize"] = bool(self._get(prim, "shaping:ies:normalize", False))
        if kind != "dome":
            options.update(shaping)
        elif "focus" in shaping or "ies" in shaping or angle < 90:
            self.report.missing(f"shaping of {prim.GetTypeName()}s", prim.GetPath())

    def _profile_file(self, prim: Usd.Prim) -> str:
        attribute = prim.GetAttribute("inputs:shaping:ies:file")
        return asset_file(attribute.Get(self.time), attribute)

    def _texture(self, prim: Usd.Prim) -> int | None:
        attribute = prim.GetAttribute("inputs:texture:file")
        path = asset_file(attribute.Get(self.time), attribute)
        if UDIM in path:
            self.report.missing("UDIM textures of lights (first tile used)", prim.GetPath())
            path = next((file for _, file in tile_files(path)), path)
        if not path or self.textures is None:
            return None
        image = self.textures.image(path, prim.GetPath())
        if image is None:
            return None
        tag = space_of(attribute) or "auto"
        rect = prim.GetTypeName() == "RectLight"
        if not rect and isinstance(image, Image):
            made = self.domes.resampled(prim, path, image, tag)
            if made is not None:
                return made
        wraps = ("clamp", "clamp") if rect else ("repeat", "clamp")
        return self.textures.add(path, image, tag, *wraps, is_colour=True)


class LinkTable:
    """Sets of geometry to which lights of the scene are linked; equal sets are stored once."""

    def __init__(self, context: LoadContext) -> None:
        self._builder = context.builder
        self._collections = Collections(context.report)
        self._known: dict[tuple[tuple[str, str], ...], int] = {}

    def set_of(self, prim: Usd.Prim, name: str) -> int | None:
        """Returns the geometry set of a light's lightLink or shadowLink; None for all geometry."""
        rules = self._collections.rules(prim, name)
        return None if rules is None else self._set(rules)

    def nothing(self) -> int:
        """Returns the empty geometry set."""
        return self._set({})

    def _set(self, rules: Rules) -> int:
        key = tuple(sorted(rules.items()))
        if key not in self._known:
            self._known[key] = self._builder.add_geometry_set(rules)
        return self._known[key]
