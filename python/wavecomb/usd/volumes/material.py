# SPDX-License-Identifier: Apache-2.0
"""Reads the volume output of a material, for volumes and for meshes that bound a medium."""

from __future__ import annotations

import math

from pxr import Sdf, Tf, Usd, UsdGeom, UsdShade

from wavecomb.usd.materials.network import shader_id
from wavecomb.usd.materials.surface import Surface
from wavecomb.usd.stage.report import LoadReport
from wavecomb.usd.volumes.optical_properties import (
    DEFAULT_PROPERTIES,
    WHITE,
    Colour,
    OpticalProperties,
)
from wavecomb.usd.volumes.shaders import (
    CLOSURES,
    STANDARD,
    ClosureReader,
    Inputs,
    read_standard,
)

_CONTEXTS = ("mtlx", "", "arnold")
"""Render contexts whose volume outputs are read, in order of preference."""


def volume_shader(material: UsdShade.Material) -> UsdShade.Shader | None:
    """Returns the shader of a material's volume output if it is supported, else None."""
    known = STANDARD + CLOSURES
    for context in _CONTEXTS:
        shader = material.ComputeVolumeSource(context)[0]
        if shader_id(shader) in known:
            return shader
    return None


class VolumeMaterials:
    """The volume properties of materials; each material is read once."""

    def __init__(self, time: Usd.TimeCode, metres_per_unit: float, report: LoadReport) -> None:
        """``metres_per_unit`` is the stage's scale; MaterialX's coefficients are per metre."""
        self._time = time
        self._metres = metres_per_unit
        self._report = report
        self._known: dict[Sdf.Path, OpticalProperties] = {}

    def of(self, material: UsdShade.Material | None, volume: Usd.Prim) -> OpticalProperties:
        """Returns the properties of a volume; default ones if its material is unsupported."""
        if material is None:
            return DEFAULT_PROPERTIES
        path = material.GetPath()
        properties = self._known.get(path)
        if properties is None:
            try:
                properties = self._read(material, volume)
            except (Tf.ErrorException, RecursionError):
                what = "volume network cannot be read: default used"
                self._report.warn(what, path)
                properties = DEFAULT_PROPERTIES
            self._known[path] = properties
        return properties

    def _read(self, material: UsdShade.Material, volume: Usd.Prim) -> OpticalProperties:
        prim = material.GetPrim()
        inputs = Inputs(prim, self._time, self._report)
        unknown = ""
        for context in _CONTEXTS:
            shader = material.ComputeVolumeSource(context)[0]
            kind = shader_id(shader)
            if kind in STANDARD:
                return read_standard(shader, inputs)
            if kind in CLOSURES:
                return ClosureReader(inputs, self._metres).read(shader)
            unknown = unknown or kind
        if unknown:
            self._report.missing(f"volume shader {unknown} (default used)", material.GetPath())
        else:
            what = "volume with a material without a volume shader: default used"
            self._report.warn(what, volume.GetPath())
        return DEFAULT_PROPERTIES


def filling(material: UsdShade.Material, time: Usd.TimeCode, report: LoadReport) -> Surface | None:
    """Returns an index-matched surface that bounds the medium of a material's volume output.

    Returns None if the material has no supported volume output.
    """
    prim = material.GetPrim()
    if volume_shader(material) is None:
        return None
    metres = UsdGeom.GetStageMetersPerUnit(prim.GetStage())
    properties = VolumeMaterials(time, metres, report).of(material, prim)
    if any(properties.emission):
        report.missing("emission of a volume in a mesh (left out)", prim.GetPath())
    if properties.density or properties.colour:
        report.missing("fields of a volume in a mesh (1 is used)", prim.GetPath())
    most = max(properties.extinction)
    depth = 1.0 / most if most > 0 else 1.0
    red, green, blue = (math.exp(-e * depth) for e in properties.extinction)
    scatter: Colour = (
        properties.extinction[0] * properties.albedo[0] * depth,
        properties.extinction[1] * properties.albedo[1] * depth,
        properties.extinction[2] * properties.albedo[2] * depth,
    )
    layers = {
        "transmission_weight": 1.0,
        "transmission_color": (red, green, blue),
        "transmission_depth": depth,
        "transmission_scatter": scatter,
        "transmission_scatter_anisotropy": properties.anisotropy,
    }
    parameters = {
        "ior": 1.0,
        "roughness": 0.0,
        "specular_color": WHITE,
        "openpbr": layers,
    }
    return Surface(str(prim.GetPath()), "openpbr", parameters)
