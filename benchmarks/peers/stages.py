# SPDX-License-Identifier: Apache-2.0
"""Generated stages of the comparison."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdVol

from wavecomb.scenes import write_scene

VOLUMES = ("smoke-200", "smoke-500", "clouds-200", "clouds-500", "fog-cornell", "fog-room")
"""Stages with volumes: smoke grids of 200 or 500 voxels per edge, and fog in rooms."""

BELOW = ("head", "candles")
"""Stages with subsurface scattering and hair."""

_BROWN = (0.248, 0.435, 0.923)
"""Hair absorption for melanin 0.52 (the mean in scene `head`), one third of it pheomelanin."""

_FOG = {"cornell": 0.5, "room": 0.25}
"""Optical thickness of the fog in each stage, over a distance of the stage's size."""


def write_stage(name: str, path: Path, plain: bool) -> Path:
    """Write a stage and return its path; volumes are added in a layer over a generated stage."""
    if name in BELOW:
        return _write_below(name, path)
    if name not in VOLUMES:
        write_scene(name, path, aspect=1.0, plain=plain)
        return path
    kind, _, detail = name.partition("-")
    base = path.with_name(f"{path.stem}-base.usdc")
    if kind == "fog":
        write_scene(detail, base, aspect=1.0, plain=True)
    else:
        write_scene(kind, base, aspect=1.0, voxels=int(detail))
    stage = Usd.Stage.CreateInMemory()
    layer = Sdf.Layer.FindOrOpen(str(base))
    stage.GetRootLayer().TransferContent(layer)
    if kind == "fog":
        _fill(stage, _FOG[detail])
    else:
        # Mitsuba's media cannot emit.
        for prim in stage.Traverse():
            edf = UsdShade.Shader(prim).GetInput("edf")
            if edf:
                edf.ClearSources()
    stage.GetRootLayer().Export(str(path))
    return path


def _write_below(name: str, path: Path) -> Path:
    """Write a stage whose hair has one colour, since other renderers get no colour per strand."""
    base = path.with_name(f"{path.stem}-base.usdc")
    write_scene(name, base, aspect=1.0)
    stage = Usd.Stage.Open(str(base))
    for prim in stage.Traverse():
        shader = UsdShade.Shader(prim)
        if shader and shader.GetIdAttr().Get() == "ND_chiang_hair_bsdf":
            absorption = shader.GetInput("absorption_coefficient")
            absorption.ClearSources()
            absorption.Set(Gf.Vec3f(*_BROWN))
    stage.GetRootLayer().Export(str(path))
    return path


def _fill(stage: Usd.Stage, thickness: float) -> None:
    """Fill a stage with fog, with a gap at the walls: Mitsuba misses rays that leave the stage."""
    cache = UsdGeom.BBoxCache(Usd.TimeCode.Default(), [UsdGeom.Tokens.default_])
    box = cache.ComputeWorldBound(stage.GetPseudoRoot()).ComputeAlignedRange()
    low, high = np.array(box.GetMin()), np.array(box.GetMax())
    inset = 1e-2 * (high - low)
    prim = UsdVol.Volume.Define(stage, "/Fog")
    prim.CreateExtentAttr([Gf.Vec3f(*map(float, low + inset)), Gf.Vec3f(*map(float, high - inset))])
    material = UsdShade.Material.Define(stage, "/Fog/Look")
    shader = UsdShade.Shader.Define(stage, "/Fog/Look/Volume")
    shader.CreateIdAttr("ND_volume")
    medium = UsdShade.Shader.Define(stage, "/Fog/Look/Medium")
    medium.CreateIdAttr("ND_anisotropic_vdf")
    metres = UsdGeom.GetStageMetersPerUnit(stage)
    extinction = thickness / float((high - low).max()) / metres
    for key, share in (("absorption", 0.1), ("scattering", 0.9)):
        value = Gf.Vec3f(*[share * extinction] * 3)
        medium.CreateInput(key, Sdf.ValueTypeNames.Vector3f).Set(value)
    medium.CreateInput("anisotropy", Sdf.ValueTypeNames.Float).Set(0.4)
    vdf = shader.CreateInput("vdf", Sdf.ValueTypeNames.Token)
    vdf.ConnectToSource(medium.CreateOutput("out", Sdf.ValueTypeNames.Token))
    terminal = material.CreateVolumeOutput("mtlx")
    terminal.ConnectToSource(shader.CreateOutput("out", Sdf.ValueTypeNames.Token))
    UsdShade.MaterialBindingAPI.Apply(prim.GetPrim()).Bind(material)
