# SPDX-License-Identifier: Apache-2.0
"""Materials of meshes that have a volume terminal alone: the mesh bounds what they say."""

from __future__ import annotations

import math

from pxr import Usd, UsdGeom, UsdShade

from wavecomb.usd.looks.surface import Surface
from wavecomb.usd.stage.report import LoadReport
from wavecomb.usd.volumes.look import WHITE, Colour
from wavecomb.usd.volumes.material import VolumeLooks, volume_shader


def filling(material: UsdShade.Material, time: Usd.TimeCode, report: LoadReport) -> Surface | None:
    """A surface that does nothing but bound the medium of a material's volume terminal.

    None where it has no such terminal that is known.
    """
    prim = material.GetPrim()
    if volume_shader(material) is None:
        return None
    metres = UsdGeom.GetStageMetersPerUnit(prim.GetStage())
    look = VolumeLooks(time, metres, report).of(material, prim)
    if any(look.emission):
        report.missing("emission of a volume in a mesh (left out)", prim.GetPath())
    if look.density or look.colour:
        report.missing("fields of a volume in a mesh (taken for 1)", prim.GetPath())
    most = max(look.extinction)
    depth = 1.0 / most if most > 0 else 1.0
    red, green, blue = (math.exp(-e * depth) for e in look.extinction)
    scatter: Colour = (
        look.extinction[0] * look.albedo[0] * depth,
        look.extinction[1] * look.albedo[1] * depth,
        look.extinction[2] * look.albedo[2] * depth,
    )
    layers = {
        "transmission_weight": 1.0,
        "transmission_color": (red, green, blue),
        "transmission_depth": depth,
        "transmission_scatter": scatter,
        "transmission_scatter_anisotropy": look.anisotropy,
    }
    parameters = {
        "ior": 1.0,
        "roughness": 0.0,
        "specular_color": WHITE,
        "openpbr": layers,
    }
    return Surface(str(prim.GetPath()), "openpbr", parameters)
