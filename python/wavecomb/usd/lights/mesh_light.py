# SPDX-License-Identifier: Apache-2.0
"""Reads mesh lights: UsdLuxMeshLightAPI, or UsdLuxLightAPI on a mesh or implicit shape."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pxr import Sdf, Usd, UsdLux

from wavecomb.usd.lights.light import LightReader
from wavecomb.usd.materials.draw_item import DrawItem
from wavecomb.usd.materials.material import MaterialTable
from wavecomb.usd.materials.network import word
from wavecomb.usd.materials.surface import Surface
from wavecomb.usd.stage.context import LoadContext

NO_RESPONSE = "noMaterialResponse"
SYNC_MODES = ("materialGlowTintsLight", "independent", NO_RESPONSE)
"""Values of ``light:materialSyncMode``."""


def is_mesh_light(prim: Usd.Prim) -> bool:
    """Returns whether a gprim is a light."""
    return bool(prim.HasAPI(UsdLux.LightAPI))


@dataclass(frozen=True)
class MeshLight:
    """A light made of the triangles of a gprim.

    Attributes:
        number: Light id for ``add_mesh``.
        material: Id of the material that replaces the bound material; None keeps the bound
            material.
        is_sampled_only: Whether only light sampling accounts for the light, so that BSDF sampling
            must ignore its emission.
    """

    number: int
    material: int | None
    is_sampled_only: bool


class MeshLights:
    """Creates the mesh lights of one stage and adds them to the scene.

    Attributes:
        any: Whether the stage has a mesh light.
    """

    def __init__(self, context: LoadContext, lights: LightReader, materials: MaterialTable) -> None:
        self.any = False
        self._builder, self._report = context.builder, context.report
        self._lights = lights
        self._materials = materials

    def of(self, draw: DrawItem, kind: str) -> MeshLight | None:
        """Returns the mesh light of a gprim; None if the gprim is not a light.

        ``draw`` is the gprim with its transform, and ``kind`` is its ``DrawItem.kind``.
        """
        if not is_mesh_light(draw.prim):
            return None
        path = draw.prim.GetPath()
        if kind not in ("mesh", "patch", "shape"):
            self._report.missing(f"{kind} as lights (only their materials emit)", path)
            return None
        sync = word(draw.prim.GetAttribute("light:materialSyncMode").Get(), NO_RESPONSE)
        if sync not in SYNC_MODES:
            self._report.warn(f"unknown light:materialSyncMode {sync}: {NO_RESPONSE}", path)
            sync = NO_RESPONSE
        options = self._lights.read_mesh(draw.prim)
        material = None
        if sync == NO_RESPONSE:
            material = self._light_material(self._lights.hidden)
            options["visible"] = not self._lights.hidden
        number = self._builder.add_mesh_light(np.array(draw.matrix), sync, **options)
        self.any = True
        self._report.tally("mesh lights")
        kept = {"shadow_link", "shadow_color", "shadow_distance"} & options.keys()
        return MeshLight(number, material, sync == "independent" or bool(kept))

    def report_motion(self, path: Sdf.Path) -> None:
        """Reports settings of mesh lights that are not supported if the light moves."""
        what = "shadow settings and the sync mode independent of moving mesh lights"
        self._report.missing(what, path)

    def _light_material(self, hidden: bool) -> int:
        """Returns a material that emits radiance 1, which the core scales for each light."""
        parameters = {"emission": (1.0, 1.0, 1.0)}
        if not hidden:
            return self._materials.add(Surface("mesh light", "emissive", parameters))
        unseen = {**parameters, "opacity": 0.0, "presence": True}
        return self._materials.add(Surface("mesh light, hidden", "emissive", unseen))
