# SPDX-License-Identifier: Apache-2.0
"""Converts MaterialX's ``chiang_hair_bsdf`` to the program "hair".

The program takes a colour and roughnesses (docs/hair.md); the node takes absorption and, per lobe,
variance and scale. If a node drives the absorption, a value graph converts the absorption to a
colour.
"""

from __future__ import annotations

import math
from typing import Any

from pxr import UsdShade

from wavecomb.image.working_space import LUMINANCE
from wavecomb.usd.graphs.values import fit, is_constant, numbers
from wavecomb.usd.materials.network import colour, number, pair, shader_id, source_of, value_of
from wavecomb.usd.materials.surface import Surface
from wavecomb.usd.materialx.nodes.colours import color_divisor
from wavecomb.usd.materialx.surfaces.openpbr import SurfaceReader

_LOBES = {"R": (0.1, 0.1), "TT": (0.05, 0.05), "TRT": (0.2, 0.2)}
"""Lobes of the hair model and their default roughnesses."""


def variance(roughness: float) -> float:
    """Returns the longitudinal variance of a lobe for a roughness (Chiang et al. 2016, eq. 7)."""
    r = roughness
    return float((0.726 * r + 0.812 * r**2 + 3.7 * r**20) ** 2)


def scale(roughness: float) -> float:
    """Returns the azimuthal scale of a lobe for a roughness, as in MaterialX (eq. 8)."""
    r = roughness
    return float(0.265 * r + 1.194 * r**2 + 5.372 * r**22)


def _inverse(function: Any, wanted: float) -> float:
    """Inverts an increasing function of roughness on [0.001, 1] by bisection."""
    low, high = 0.001, 1.0
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if function(middle) < wanted else (low, middle)
    return 0.5 * (low + high)


class HairReader(SurfaceReader):
    """Reader of ``chiang_hair_bsdf`` shaders."""

    def read(self, shader: UsdShade.Shader) -> Surface:
        """Returns the surface; reports unsupported inputs."""
        parameters = self.parameters
        self.put("ior", self.drivers.value(shader, "ior", "ior") or (1.55,))
        if parameters.get("ior", 1.55) < 1.0:
            self.report.warn("ior of hair below 1: set to 1.55", self.material.GetPath())
            parameters["ior"] = 1.55
        self._roughness(shader)
        self._colour(shader)
        # MaterialX's cuticle angle ranges from 0 to 1, where 0.5 means no tilt, and has the
        # opposite sign of Wavecomb's cuticle tilt in degrees.
        angle = self._number(shader, "cuticle_angle", 0.5)
        parameters["cuticle_tilt"] = min(max(90.0 - 180.0 * angle, -90.0), 90.0)
        for lobe in _LOBES:
            parameters[f"tint_{lobe.lower()}"] = self._tint(shader, f"tint_{lobe}")
        for name in ("normal", "curve_direction"):
            if source_of(shader, name, self.time) is not None:
                self.missing(f"MaterialX chiang_hair_bsdf input {name} (the curve's own)")
        return self.drivers.surface("hair", parameters)

    def _roughness(self, shader: UsdShade.Shader) -> None:
        """Reads roughnesses from a common helper node, else from the lobes' variances."""
        helper, parameters = self._helper(shader), self.parameters
        if helper is not None:
            along = self.drivers.value(helper, "longitudinal", "roughness") or (0.1,)
            low = self.drivers.networks.make.op(
                "clamp", fit(along, 1), numbers(0.001), numbers(1.0)
            )
            self.put("roughness", low)
            about = self._number(helper, "azimuthal", 0.2)
            parameters["scale_tt"] = self._number(helper, "scale_TT", 0.5)
            parameters["scale_trt"] = self._number(helper, "scale_TRT", 2.0)
        else:
            pairs = {lobe: self._pair(shader, lobe) for lobe in _LOBES}
            scales = {s for _, s in pairs.values()}
            if max(scales) > min(scales):
                self.missing(
                    "MaterialX chiang_hair_bsdf lobes of different azimuthal roughness "
                    "(that of roughness_R for all)"
                )
            v, s = pairs["R"]
            parameters["roughness"] = _inverse(variance, v)
            about = _inverse(scale, s)
            parameters["scale_tt"] = math.sqrt(pairs["TT"][0] / v)
            parameters["scale_trt"] = math.sqrt(pairs["TRT"][0] / v)
        parameters["azimuthal_roughness"] = min(max(about, 0.001), 1.0)
        for name in ("scale_tt", "scale_trt"):
            parameters[name] = min(max(parameters[name], 0.0), 10.0)

    def _helper(self, shader: UsdShade.Shader) -> UsdShade.Shader | None:
        """Returns the ``chiang_hair_roughness`` node that feeds all lobes.

        Returns None if no such node feeds all lobes.
        """
        found = []
        for lobe in _LOBES:
            source = source_of(shader, f"roughness_{lobe}", self.time)
            node = None if source is None else source.shader
            if node is None or not shader_id(node).startswith("ND_chiang_hair_roughness"):
                return None
            found.append(node)
        return found[0] if len({node.GetPath() for node in found}) == 1 else None

    def _pair(self, shader: UsdShade.Shader, lobe: str) -> tuple[float, float]:
        """Returns the variance and the scale of a lobe, clamped to MaterialX's ranges."""
        source = source_of(shader, f"roughness_{lobe}", self.time)
        given = None if source is None else source.value
        if source is not None and source.shader is not None:
            if shader_id(source.shader).startswith("ND_chiang_hair_roughness"):
                factor = {"R": 1.0, "TT": self._number(source.shader, "scale_TT", 0.5),
                          "TRT": self._number(source.shader, "scale_TRT", 2.0)}[lobe]  # fmt: skip
                along = min(max(self._number(source.shader, "longitudinal", 0.1), 0.001), 1.0)
                about = min(max(self._number(source.shader, "azimuthal", 0.2), 0.001), 1.0)
                given = (variance(along) * factor**2, scale(about))
            else:
                self.missing(
                    f"MaterialX chiang_hair_bsdf input roughness_{lobe} by a node (its default)"
                )
        v, s = pair(given, _LOBES[lobe])
        return min(max(v, 0.001), 1.0), min(max(s, 0.001), 1.0)

    def _colour(self, shader: UsdShade.Shader) -> None:
        """Sets the colour that gives the requested absorption at the hair's roughness."""
        about = self.parameters["azimuthal_roughness"]
        name = "absorption_coefficient"
        source = source_of(shader, name, self.time)
        node = None if source is None else source.shader
        if node is not None and shader_id(node).startswith("ND_chiang_hair_absorption_from_color"):
            given = value_of(node, "azimuthal_roughness", self.time, 0.2)
            if abs(number(given, 0.2) - about) < 1e-6:
                value = self.drivers.value(node, "color", "base_color") or (1.0,)
                self.put("base_color", fit(value, 3))
                return
        absorption = fit(self.drivers.value(shader, name, "base_color") or (0.0,), 3)
        m = self.drivers.networks.make
        root = m.op("sqrt", m.op("max", absorption, numbers(0.0)))
        value = m.op("exp", m.op("multiply", root, numbers(-color_divisor(about))))
        self.put("base_color", value)

    def _number(self, shader: UsdShade.Shader, name: str, default: float) -> float:
        """Returns an input that must be a constant number."""
        value = self.drivers.value(shader, name, "roughness")
        if value is None:
            return default
        if not is_constant(value):
            what = f"MaterialX {shader_id(shader).removeprefix('ND_')} input {name} by a node"
            self.missing(f"{what} (its default)")
            return default
        return float(value[0])  # type: ignore[arg-type]

    def _tint(self, shader: UsdShade.Shader, name: str) -> float:
        """Returns the luminance of a tint, since the program "hair" has no coloured tints."""
        source = source_of(shader, name, self.time)
        if source is None:
            return 1.0
        white = (1.0, 1.0, 1.0)
        value = self.drivers.value(shader, name, "base_color")
        if value is None or not is_constant(value):
            self.missing(f"MaterialX chiang_hair_bsdf input {name} by a node (white)")
            return 1.0
        rgb = colour(fit(value, 3), white)
        if max(rgb) - min(rgb) > 1e-4:
            self.missing(f"MaterialX chiang_hair_bsdf input {name} in a colour (its luminance)")
        return min(max(sum(a * b for a, b in zip(rgb, LUMINANCE, strict=True)), 0.0), 1.0)
