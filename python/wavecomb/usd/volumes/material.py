# SPDX-License-Identifier: Apache-2.0
"""The volume terminal of a material as a look."""

from __future__ import annotations

from pxr import Sdf, Tf, Usd, UsdShade

from wavecomb.usd.looks.network import shader_id
from wavecomb.usd.stage.report import LoadReport
from wavecomb.usd.volumes import closures, standard_volume
from wavecomb.usd.volumes.inputs import Inputs
from wavecomb.usd.volumes.look import DEFAULT_LOOK, VolumeLook

_CONTEXTS = ("mtlx", "", "arnold")
"""Render contexts whose terminals are looked at, in this order."""


def volume_shader(material: UsdShade.Material) -> UsdShade.Shader | None:
    """The shader of a material's volume terminal, where it is one that is known."""
    known = standard_volume.IDENTIFIERS + closures.IDENTIFIERS
    for context in _CONTEXTS:
        shader = material.ComputeVolumeSource(context)[0]
        if shader_id(shader) in known:
            return shader
    return None


class VolumeLooks:
    """Reads the looks of materials, each once."""

    def __init__(self, time: Usd.TimeCode, metres_per_unit: float, report: LoadReport) -> None:
        """``metres_per_unit``: of the stage; MaterialX's coefficients are per metre."""
        self._time = time
        self._metres = metres_per_unit
        self._report = report
        self._known: dict[Sdf.Path, VolumeLook] = {}

    def of(self, material: UsdShade.Material | None, volume: Usd.Prim) -> VolumeLook:
        """The look of a volume that wears a material; the default where it says none."""
        if material is None:
            return DEFAULT_LOOK
        path = material.GetPath()
        look = self._known.get(path)
        if look is None:
            try:
                look = self._read(material, volume)
            except (Tf.ErrorException, RecursionError):
                what = "volume network cannot be read: default taken"
                self._report.warn(what, path)
                look = DEFAULT_LOOK
            self._known[path] = look
        return look

    def _read(self, material: UsdShade.Material, volume: Usd.Prim) -> VolumeLook:
        prim = material.GetPrim()
        inputs = Inputs(prim, self._time, self._report)
        unknown = ""
        for context in _CONTEXTS:
            shader = material.ComputeVolumeSource(context)[0]
            kind = shader_id(shader)
            if kind in standard_volume.IDENTIFIERS:
                return standard_volume.read(shader, inputs)
            if kind in closures.IDENTIFIERS:
                return closures.ClosureReader(inputs, self._metres).read(shader)
            unknown = unknown or kind
        if unknown:
            self._report.missing(f"volume shader {unknown} (default taken)", material.GetPath())
        else:
            what = "volume with a material without a volume shader: default taken"
            self._report.warn(what, volume.GetPath())
        return DEFAULT_LOOK
