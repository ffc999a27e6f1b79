# SPDX-License-Identifier: Apache-2.0
"""The window's stage is made of what the sandbox sends: it shows what the stage itself would."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import mtlx_stage
import pytest
import scene_stage
from parts import needs, only_where, written_scenes
from pxr import Sdf, Usd, UsdGeom, UsdLux, UsdShade

from wavecomb.errors import WavecombError
from wavecomb.gui.loader import Read, Request, Source, copied, read
from wavecomb.gui.scene.edit_layer import save_edits
from wavecomb.gui.scene.light_inputs import inputs_of
from wavecomb.gui.scene.scene_model import PREDICATE, SceneModel
from wavecomb.gui.scene.stage_edits import StageEdits
from wavecomb.gui.viewport.scene_lookup import camera_pose, prim_bounds
from wavecomb.run.isolate import landlock
from wavecomb.scenes import write_scene
from wavecomb.usd import open_editable
from wavecomb.usd.looks.parameters import light_values, material_parameters
from wavecomb.usd.looks.surface_values import surface_values
from wavecomb.usd.stage.outline_layer import NOWHERE
from wavecomb.usd.stage.times import time_code

pytestmark = [needs("wavecomb._core"), only_where(sys.platform == "linux", "isolation is Linux's")]

ASSETS = Path(__file__).parents[4] / "shared/assets/usd"
TIME, WORLD = Usd.TimeCode(1), Sdf.Path("/World")
SMALL = {
    "triangles": 10_000, "teapot_level": 4, "texture_size": 64, "texture_mb": 0.5, "voxels": 24,
}  # fmt: skip
SOME = [
    "StandardShaderBall/standard_shader_ball_scene.usda",
    "Teapot/Teapot.usd",
    "Vehicles/USD_Mini_Car_Kit/assets/vehicles/vehicleVariants.usda",
    "cornell-box/mtlx-ref/cornell-box.usda",
    "cornell-box/mtlx-usdshade/cornell-box.usda",
    "cornell-box/usdpreviewsurface/cornell-box.usda",
    "kaolin/amsterdam.usda",
    "kaolin/avocado.usda",
    "openusd/MotionBlurTest/motionBlur.usda",
    "openusd/testUsdImagingGLInstancing/nestedInstance.usda",
    "openusd/testUsdImagingGLInstancing/ni_pi.usda",
    "openusd/testUsdImagingGLPointInstancer/ni_pi_variant.usda",
    "openusd/testUsdImagingGLPurpose/world.usda",
    "usdlux/camera.usda",
    "usdlux/iesTest.usda",
]


@pytest.fixture(autouse=True)
def isolated(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("WAVECOMB_ISOLATE", raising=False)
    monkeypatch.delenv("WAVECOMB_DEBUG", raising=False)


def asset(name: str) -> Path:
    """A stage of the assets."""
    if not (ASSETS / name).exists():
        pytest.skip(f"shared/assets/usd/{name} is not there")
    return ASSETS / name


def opened(path: Path, **more: object) -> Read:
    got = read(Request(Source(path, **more)))  # type: ignore[arg-type]
    got.settle()
    return got


def rows(usd: Usd.Stage, time: Usd.TimeCode) -> list[object]:
    """All that the tree says of each prim."""
    edits = StageEdits(usd, time)
    model = SceneModel(SimpleNamespace(usd=usd, edits=edits, time=time))  # type: ignore[arg-type]
    out: list[object] = []
    for prim in Usd.PrimRange.Stage(usd, PREDICATE):
        texts = [model._text(prim, column) for column in range(4)]
        tips = [model._tip(prim, column) for column in range(4)]
        out.append((str(prim.GetPath()), prim.IsInstanceProxy(), texts, tips))
    return out


def close(values: dict[str, object] | None) -> object:
    """Numbers of a light, but for the last bits: transforms are multiplied in another order."""
    if values is None:
        return None
    return {name: pytest.approx(value) for name, value in values.items()}


def assert_alike(path: Path, got: Read, own: Usd.Stage) -> None:
    """The window's stage says what the stage itself says."""
    made = got.usd
    time = time_code(own, None)
    up = str(UsdGeom.GetStageUpAxis(own))
    assert str(UsdGeom.GetStageUpAxis(made)) == up
    assert time_code(made, None) == time
    assert rows(made, time) == rows(own, time)
    for prim in Usd.PrimRange.Stage(own, PREDICATE):
        other = made.GetPrimAtPath(prim.GetPath())
        bound, same = (
            UsdShade.MaterialBindingAPI(one).ComputeBoundMaterial()[0].GetPath()
            for one in (prim, other)
        )
        assert bound == same, prim
        if prim.IsA(UsdShade.Material):
            assert material_parameters(other, time) == material_parameters(prim, time), prim
            mine, theirs = surface_values(other, time), surface_values(prim, time)
            if theirs is None or mine is None:
                assert mine is theirs
            else:
                assert mine.constants == theirs.constants
                assert without_folders(mine.structure) == without_folders(theirs.structure)
        elif prim.HasAPI(UsdLux.LightAPI):
            assert light_values(other, time, up) == close(light_values(prim, time, up)), prim
            for one in inputs_of(prim):
                assert one.read(other, time) == one.read(prim, time), (prim, one.name)
            assert inputs_of(other) == inputs_of(prim)
        elif prim.IsA(UsdGeom.Camera):
            mine, theirs = (camera_pose(one, str(prim.GetPath()), None) for one in (made, own))
            assert (mine is None) == (theirs is None)
            if mine is not None and theirs is not None:
                assert mine.position == pytest.approx(theirs.position)
                assert mine.back == pytest.approx(theirs.back)


def without_folders(structure: str) -> str:
    """What a material asks for, with names of files as outlines have them."""
    return structure.replace(NOWHERE, "").replace("[", "/").replace("]", "")


@pytest.mark.slow
@pytest.mark.usefixtures("forked")
@pytest.mark.parametrize("name", written_scenes())
def test_outlines_of_scenes_are_the_scenes(name: str, tmp_path: Path) -> None:
    path = tmp_path / f"{name}.usda"
    write_scene(name, path, **SMALL)
    assert_alike(path, opened(path), open_editable(path))


@pytest.mark.slow
@pytest.mark.usefixtures("forked")
@pytest.mark.parametrize("name", SOME)
def test_outlines_of_assets_are_the_assets(name: str) -> None:
    path = asset(name)
    assert_alike(path, opened(path), open_editable(path))


SHUT = """
import os, sys
from pathlib import Path
from wavecomb.gui import loader
from wavecomb.run.isolate import landlock

path = Path(sys.argv[1])
loader._spare.prepare()  # is not shut out
rules = landlock.Ruleset(landlock.READS)
for one in path.parents[1:]:
    rules.allow([
        other for other in one.iterdir() if other not in path.parents and not other.is_symlink()
    ], landlock.READS)
rules.apply()
try:
    path.read_bytes()
except PermissionError:
    print("shut")
found = loader.read(loader.Request(loader.Source(path)))
found.settle()
from pxr import Sdf, Usd, UsdShade
from wavecomb.usd.looks.parameters import material_parameters
from wavecomb.usd.looks.surface_values import surface_values

time, count = Usd.TimeCode.EarliestTime(), 0
for prim in Usd.PrimRange.Stage(found.usd, Usd.TraverseInstanceProxies()):
    if prim.IsA(UsdShade.Material):
        surface_values(prim, time)
        count += bool(material_parameters(prim, time))
files = [one.realPath for one in Sdf.Layer.GetLoadedLayers()]
print(count, [one for one in files if one.startswith(str(path.parent))])
sys.stdout.flush()
os._exit(0)
"""


@pytest.mark.slow
@pytest.mark.skipif(not landlock.version(), reason="this kernel has no Landlock")
@pytest.mark.parametrize("name", ["scene", "mtlx", "referring", "rig"])
def test_the_window_opens_no_file_of_a_stage(name: str, tmp_path: Path) -> None:
    """The kernel keeps the stage's folder from a process that has a stage read."""
    path, materials = stage(name, tmp_path)
    found = subprocess.run(
        [sys.executable, "-c", SHUT, str(path)], capture_output=True, text=True, timeout=60,
        env={**os.environ, "WAVECOMB_ISOLATE": "1"}, check=False,
    )  # fmt: skip
    assert (found.stdout, found.stderr) == (f"shut\n{materials} []\n", "")


def stage(name: str, folder: Path) -> tuple[Path, int]:
    """A stage with variants and instances, MaterialX, a .mtlx file or lights; its materials."""
    inner = folder / "stage"
    inner.mkdir()
    if name == "rig":
        (inner / "rig.usda").write_text(RIG)
        return inner / "rig.usda", 0
    if name == "scene":
        return scene_stage.write_stage(inner), 5
    if name == "mtlx":
        return mtlx_stage.write_stage(inner), mtlx_stage.STAGE.count('def Material "') + 1
    return mtlx_stage.write_referring(inner), 1


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


@pytest.mark.usefixtures("forked")
@pytest.mark.parametrize("name", ["scene", "mtlx", "referring", "rig"])
def test_outlines_of_small_stages(name: str, tmp_path: Path) -> None:
    path, _ = stage(name, tmp_path)
    assert_alike(path, opened(path), open_editable(path))


def choices(usd: Usd.Stage) -> dict[str, str]:
    """The variants of the stage's root prim."""
    return {one.name: one.choice for one in StageEdits(usd, TIME).variant_sets(WORLD)}


@pytest.mark.usefixtures("forked")
def test_variants_that_are_asked_for_are_selected_in_the_window(tmp_path: Path) -> None:
    path, _ = stage("rig", tmp_path)
    variants = {"/World{rig}": "one"}
    got = opened(path, variants=variants)
    assert_alike(path, got, open_editable(path, variants))
    session = got.usd.GetSessionLayer()
    assert dict(session.GetPrimAtPath("/World").variantSelections) == {"rig": "one"}
    assert choices(got.usd) == {"rig": "one", "look": ""}
    session.Clear()  # undone: what the stage itself selects
    assert choices(got.usd) == {"rig": "two", "look": ""}


@pytest.mark.usefixtures("forked")
def test_edits_lie_above_the_outline(tmp_path: Path) -> None:
    """Values that are edited are not in it; variants bring another onto the same stage."""
    path, _ = stage("rig", tmp_path)
    first = opened(path)
    usd = first.usd
    edits = StageEdits(usd, TIME)
    step = edits.visible([Sdf.Path("/World/B")], False)
    assert step is not None
    edits.apply(step)
    hidden = read(Request(Source(path), usd, copied(usd.GetSessionLayer())))
    assert hidden.usd is usd and hidden.content is None  # nothing to bring
    assert len(hidden.stage.light_paths) < len(first.stage.light_paths)
    usd.GetSessionLayer().Clear()
    assert usd.GetPrimAtPath("/World/B").GetAttribute("visibility").Get() == "inherited"

    chosen = edits.variant(WORLD, "rig", "one")
    assert chosen is not None
    edits.apply(chosen)
    other = read(Request(Source(path), usd, copied(usd.GetSessionLayer())))
    assert not usd.GetPrimAtPath("/World/Bulb")
    other.settle()
    assert other.usd is usd and usd.GetPrimAtPath("/World/Bulb")
    assert_alike(path, other, open_editable(path, {"/World{rig}": "one"}))


@pytest.mark.usefixtures("forked")
def test_what_changed_on_disk_comes_onto_the_same_stage(tmp_path: Path) -> None:
    path, _ = stage("rig", tmp_path)
    usd = opened(path).usd
    path.write_text(RIG.replace('def Sphere "Ball"', 'def Cube "Dice"'))
    again = read(Request(Source(path), usd, None, True))
    again.settle()
    assert again.usd is usd and not usd.GetPrimAtPath("/World/Ball")
    assert usd.GetPrimAtPath("/World/Dice")
    assert_alike(path, again, open_editable(path))


@pytest.mark.usefixtures("forked")
def test_saved_edits_lie_over_the_stage_itself(tmp_path: Path) -> None:
    path, _ = stage("rig", tmp_path)
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


@pytest.mark.usefixtures("forked")
@pytest.mark.parametrize("how", ["0", "1"])
def test_bounds_are_of_what_is_drawn(
    how: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("WAVECOMB_ISOLATE", how)
    path, _ = stage("scene", tmp_path)
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
