# SPDX-License-Identifier: Apache-2.0
"""Tests that objects of the kitchen rest on supports, and that most materials are glossy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdShade

from wavecomb.scenes import write_scene
from wavecomb.scenes.rooms.room_materials import KITCHEN_MATERIALS as MATERIALS

TOP = 0.92


@pytest.fixture(scope="module")
def kitchen(tmp_path_factory: pytest.TempPathFactory) -> Usd.Stage:
    path = tmp_path_factory.mktemp("kitchen") / "kitchen.usdc"
    write_scene("kitchen", path, teapot_level=4, texture_size=32)
    return Usd.Stage.Open(str(path))


def box(stage: Usd.Stage, name: str) -> tuple[np.ndarray, np.ndarray]:
    cache = UsdGeom.BBoxCache(Usd.TimeCode.Default(), [UsdGeom.Tokens.default_])
    found = cache.ComputeWorldBound(stage.GetPrimAtPath(f"/World/Objects/{name}"))
    found = found.ComputeAlignedRange()
    return np.array(found.GetMin()), np.array(found.GetMax())


@pytest.mark.parametrize(
    "name", ["Toaster", "Plates", "Bottle", "Knives", "Bowl", "Tumbler0", "Saucer1", "JarCoffee"]
)
def test_things_stand_on_the_worktop(kitchen: Usd.Stage, name: str) -> None:
    assert box(kitchen, name)[0][1] == pytest.approx(TOP, abs=2e-4)


def test_nothing_leaves_the_room(kitchen: Usd.Stage) -> None:
    for prim in kitchen.GetPrimAtPath("/World/Objects").GetChildren():
        low, high = box(kitchen, prim.GetName())
        assert (low > (-0.13, -0.02, -0.13)).all() and (high < (3.93, 2.73, 3.53)).all(), prim


def test_things_on_the_worktop_do_not_meet(kitchen: Usd.Stage) -> None:
    names = [
        "Toaster", "Plates", "Bottle", "Knives", "Bowl", "Kettle", "PotSmall", "PotLarge", "Board",
        *(f"Jar{content}" for content in ("Flour", "Lentils", "Paprika", "Coffee")),
        *(f"Tumbler{k}" for k in range(4)), "Saucer0", "Saucer1",
    ]  # fmt: skip
    boxes = {name: box(kitchen, name) for name in names}
    for i, a in enumerate(names):
        for b in names[i + 1 :]:
            apart = (boxes[a][0] > boxes[b][1]) | (boxes[b][0] > boxes[a][1])
            assert apart[[0, 2]].any(), (a, b)


def test_bulbs_hang_within_their_shades(kitchen: Usd.Stage) -> None:
    for k in range(3):
        low, high = box(kitchen, f"Pendant{k}")
        bulb = kitchen.GetPrimAtPath(f"/World/Lights/Bulb{k}")
        place = np.array(UsdGeom.Xformable(bulb).ComputeLocalToWorldTransform(0.0))[3, :3]
        assert place[[0, 2]] == pytest.approx(0.5 * (low + high)[[0, 2]], abs=1e-3)
        assert low[1] < place[1] < high[1]


def test_most_materials_are_glossy_and_all_are_worn(kitchen: Usd.Stage) -> None:
    worn = {
        UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0].GetPrim().GetName()
        for prim in kitchen.Traverse(Usd.TraverseInstanceProxies())
        if prim.IsA(UsdGeom.Mesh)
    }
    unworn = set(MATERIALS) - worn
    assert not unworn
    glossy = [
        name for name in worn
        if "roughness" in MATERIALS[name].textures
        or float(MATERIALS[name].inputs["roughness"]) <= 0.46
    ]  # fmt: skip
    assert len(glossy) >= 25


@pytest.mark.slow
def test_it_is_the_same_each_time(tmp_path: Path) -> None:
    for name in "ab":
        write_scene("kitchen", tmp_path / f"{name}.usda", teapot_level=3, texture_size=32)
    a, b = ((tmp_path / f"{name}.usda").read_text() for name in "ab")
    assert a.replace("a_textures", "b_textures") == b
