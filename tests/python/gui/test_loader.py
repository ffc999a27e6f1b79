# SPDX-License-Identifier: Apache-2.0
"""Tests stage loading in the window: variants, edits, changes on disk and bounds."""

from __future__ import annotations

from pathlib import Path

import pytest
import scene_stage
from parts import needs
from pxr import Sdf, Usd, UsdGeom

from wavecomb.errors import WavecombError
from wavecomb.gui.loader import Read, Request, Source, copied, read
from wavecomb.gui.scene.edit_layer import save_edits
from wavecomb.gui.scene.stage_edits import StageEdits
from wavecomb.gui.viewport.scene_lookup import prim_bounds

pytestmark = needs("wavecomb._core")

TIME, WORLD = Usd.TimeCode(1), Sdf.Path("/World")


def opened(path: Path, **more: object) -> Read:
    """Opens a stage as the window does."""
    return read(Request(Source(path, **more)))  # type: ignore[arg-type]


def written(folder: Path) -> Path:
    """Writes the stage ``RIG`` to a separate folder."""
    inner = folder / "stage"
    inner.mkdir()
    (inner / "rig.usda").write_text(RIG)
    return inner / "rig.usda"


RIG = """#usda 1.0
(
    defaultPrim = "World"
    upAxis = "Z"
    metersPerUnit = 0.01
    startTimeCode = 1
    endTimeCode = 9
)
def Xform "World" (
    variants = { string rig = "two" }
    prepend variantSets = ["rig", "look"]
)
{
    double3 xformOp:translate.timeSamples = { 1: (1, 2, 3), 9: (4, 5, 6) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
    variantSet "look" = {
        "plain" {
        }
    }
    variantSet "rig" = {
        "one" {
            def SphereLight "Bulb" {
                float inputs:intensity = 4
            }
        }
        "two" {
            def Xform "A" (
                instanceable = true
                prepend references = </Lamp>
            )
            {
                double xformOp:rotateX = 30
                uniform token[] xformOpOrder = ["xformOp:rotateX"]
            }
            def Xform "B" (
                instanceable = true
                prepend references = </Lamp>
                variants = { string size = "big" }
            )
            {
            }
            def Xform "C" (
                instanceable = true
                prepend references = </Lamp>
            )
            {
                token visibility = "invisible"
            }
        }
    }
    def Sphere "Ball" {
        token visibility.timeSamples = { 0: "inherited", 1: "invisible", 5: "inherited" }
    }
    def Camera "Eye" {
        float focalLength.timeSamples = { 1: 20, 9: 80 }
        double3 xformOp:translate = (0, 0, 9)
        uniform token[] xformOpOrder = ["!resetXformStack!", "xformOp:translate"]
    }
}
class Xform "Lamp" (
    variants = { string size = "small" }
    prepend variantSets = "size"
)
{
    variantSet "size" = {
        "big" {
            def Xform "Arm" (
                instanceable = true
                prepend references = </Arm>
            )
            {
                float3 xformOp:scale = (2, 2, 2)
                uniform token[] xformOpOrder = ["xformOp:scale"]
            }
        }
        "small" {
            def Xform "Arm" (
                instanceable = true
                prepend references = </Arm>
            )
            {
            }
        }
    }
}
class Xform "Arm"
{
    double3 xformOp:translate = (0, 7, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def SphereLight "Bulb" {
        float inputs:intensity.timeSamples = { 1: 3, 9: 5 }
        float inputs:radius = 0.25
    }
    def Camera "Cam" {
    }
    def Sphere "Shade" {
    }
}
"""


def choices(usd: Usd.Stage) -> dict[str, str]:
    """Returns the variants of the stage's root prim."""
    return {one.name: one.choice for one in StageEdits(usd, TIME).variant_sets(WORLD)}


def test_variants_that_are_asked_for_are_selected_in_the_window(tmp_path: Path) -> None:
    path = written(tmp_path)
    variants = {"/World{rig}": "one"}
    got = opened(path, variants=variants)
    session = got.usd.GetSessionLayer()
    assert dict(session.GetPrimAtPath("/World").variantSelections) == {"rig": "one"}
    assert choices(got.usd) == {"rig": "one", "look": ""}
    session.Clear()
    assert choices(got.usd) == {"rig": "two", "look": ""}


def test_edits_of_the_session_layer_are_in_the_scene(tmp_path: Path) -> None:
    path = written(tmp_path)
    first = opened(path)
    usd = first.usd
    edits = StageEdits(usd, TIME)
    step = edits.visible([Sdf.Path("/World/B")], False)
    assert step is not None
    edits.apply(step)
    hidden = read(Request(Source(path), usd, copied(usd.GetSessionLayer())))
    assert hidden.usd is usd
    assert len(hidden.stage.light_paths) < len(first.stage.light_paths)
    usd.GetSessionLayer().Clear()
    assert usd.GetPrimAtPath("/World/B").GetAttribute("visibility").Get() == "inherited"

    assert not usd.GetPrimAtPath("/World/Bulb")
    chosen = edits.variant(WORLD, "rig", "one")
    assert chosen is not None
    edits.apply(chosen)
    other = read(Request(Source(path), usd, copied(usd.GetSessionLayer())))
    assert other.usd is usd and usd.GetPrimAtPath("/World/Bulb")
    assert "/World/Bulb" in [str(one) for one in other.stage.light_paths]


def test_what_changed_on_disk_comes_onto_the_same_stage(tmp_path: Path) -> None:
    path = written(tmp_path)
    usd = opened(path).usd
    path.write_text(RIG.replace('def Sphere "Ball"', 'def Cube "Dice"'))
    again = read(Request(Source(path), usd, None, True))
    assert again.usd is usd and not usd.GetPrimAtPath("/World/Ball")
    assert usd.GetPrimAtPath("/World/Dice")


def test_saved_edits_lie_over_the_stage_itself(tmp_path: Path) -> None:
    path = written(tmp_path)
    usd = opened(path).usd
    usd.SetEditTarget(usd.GetSessionLayer())
    usd.GetPrimAtPath("/World/Eye").GetAttribute("focalLength").Set(33.0)
    with pytest.raises(WavecombError, match="is a file of the stage"):
        save_edits(usd, path)
    saved = Usd.Stage.Open(str(save_edits(usd, tmp_path / "over.usda")))
    assert saved.GetPrimAtPath("/World/Eye").GetAttribute("focalLength").Get(1) == 33.0
    assert saved.GetPrimAtPath("/World/Ball") and UsdGeom.GetStageUpAxis(saved) == "Z"
    assert saved.GetMetadata("metersPerUnit") == 0.01 and saved.GetEndTimeCode() == 9
    assert not saved.GetRootLayer().customLayerData
    assert list(saved.GetRootLayer().subLayerPaths) == ["./stage/rig.usda"]


def test_bounds_are_of_what_is_drawn(tmp_path: Path) -> None:
    path = scene_stage.write_stage(tmp_path)
    got = opened(path)

    def bounds(prim: str) -> object:
        found = prim_bounds(got.usd, got.stage, prim)
        return None if found is None else pytest.approx(found, abs=0.02)

    assert bounds("/World/Things/Ball") == [[-3, 0, -1], [-1, 2, 1]]
    assert bounds("/World/Things") == [[-3, 0, -2], [3, 4, 1]]
    assert bounds("/World/I1") == [[-1.5, -1.5, 1.5], [-0.5, -0.5, 2.5]]
    assert bounds("/World/I1/Knob") == [[-1.5, -1.5, 1.5], [-0.5, -0.5, 2.5]]
    assert bounds("/World/Lights/Key") == [[-2, 2, 6], [2, 6, 6]]
    assert bounds("/World/Thing") is bounds("/World/Cam") is bounds("no such") is None
