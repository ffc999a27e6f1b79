# SPDX-License-Identifier: Apache-2.0
"""Write a stage with all expensive features: graphs, images, subsurface, hair, smoke, glass.

.venv/bin/python benchmarks/everything.py out/everything.usda
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from pxr import Gf, Usd, UsdGeom, UsdLux

from wavecomb.scenes import write_scene

_PARTS: dict[str, tuple[dict[str, Any], tuple[float, float, float], float]] = {
    "heavy": ({"materials": 32, "texture_mb": 32.0, "triangles": 100_000}, (0, 0, 0), 1.0),
    "candles": ({}, (-6.5, 2.0, 6.0), 0.35),
    "head": ({"strands": 20_000}, (0.5, 4.6, 5.0), 1.0),
    "smoke": ({"voxels": 96}, (6.0, 1.0, 3.0), 1.6),
}
"""Generated stages with their options, positions and sizes."""


def write(path: Path) -> Path:
    """Write the stage and the stages it references, with camera and lights of scene ``heavy``."""
    path.parent.mkdir(parents=True, exist_ok=True)
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 0.1)
    world = UsdGeom.Xform.Define(stage, "/World")
    stage.SetDefaultPrim(world.GetPrim())
    for name, (options, place, size) in _PARTS.items():
        file = path.with_name(f"{path.stem}-{name}.usdc")
        write_scene(name, file, **options)
        part = UsdGeom.Xform.Define(stage, f"/World/{name.capitalize()}")
        part.GetPrim().GetReferences().AddReference(f"./{file.name}")
        part.ClearXformOpOrder()
        part.AddTranslateOp().Set(Gf.Vec3d(*place))
        part.AddScaleOp().Set(Gf.Vec3f(size))
        if name == "heavy":
            continue
        for prim in Usd.PrimRange(part.GetPrim()):
            ground = prim.GetName() in ("Set", "Ground")
            if ground or prim.HasAPI(UsdLux.LightAPI) or prim.IsA(UsdGeom.Camera):
                prim.SetActive(False)
    stage.GetRootLayer().Save()
    return path


if __name__ == "__main__":
    print(f"wrote {write(Path(sys.argv[1]))}")
