# SPDX-License-Identifier: Apache-2.0
"""Tests that edits of the session layer equal edits by USD, can be undone, and can be exported."""

import pytest
from pxr import Sdf, Usd, UsdGeom

import wavecomb
from wavecomb.errors import WavecombError
from wavecomb.gui.scene.edit_layer import save_edits
from wavecomb.gui.scene.history import History
from wavecomb.gui.scene.stage_edits import Opinion, StageEdits
from wavecomb.gui.scene.visibility import state
from wavecomb.usd import load_stage, open_stage

STAGE = """#usda 1.0
(
    defaultPrim = "World"
    upAxis = "Z"
    metersPerUnit = 0.01
    startTimeCode = 7
)
def Xform "World" (
    variants = { string look = "ball" }
    prepend variantSets = "look"
)
{
    variantSet "look" = {
        "ball" { def Sphere "Thing" { double radius = 1 } }
        "box" { def Cube "Thing" { double size = 2 } }
    }
    def Xform "A"
    {
        token visibility = "invisible"
        def Xform "B" { def Cube "One" { double3 xformOp:translate = (3, 0, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"] } def Cube "Two" { } }
        def Xform "C" { def Sphere "Three" { } }
        def Material "Look" { }
    }
    def Xform "Deep" { token visibility.timeSamples = { 7: "invisible" } def Cube "Four" { } }
}
class Xform "_Part" { def Cube "Cube" { double3 xformOp:translate = (0, 4, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"] } }
def "I1" ( instanceable = true
    prepend inherits = </_Part> ) { }
def "I2" ( instanceable = true
    prepend inherits = </_Part> ) { }
"""
PRIMS = [
    "/World",
    "/World/A",
    "/World/A/B",
    "/World/A/B/One",
    "/World/A/C/Three",
    "/World/Deep/Four",
]


@pytest.fixture
def path(tmp_path):
    file = tmp_path / "stage.usda"
    file.write_text(STAGE.replace("{", "{\n").replace("}", "\n}\n"))
    return file


class Edits:
    """Edits of a stage with undo steps and a manual clock."""

    def __init__(self, stage, time):
        self.of = StageEdits(stage, time)
        self.moment = 0.0
        self.history = History(now=lambda: self.moment)
        self.history.step.connect(self.of.apply)

    def __getattr__(self, name):
        return getattr(self.of, name)

    def do(self, step):
        """Applies a planned step."""
        if step is not None:
            self.history.push(step)
        return step

    def change(self, label, opinions):
        return self.do(self.of.plan(label, opinions))

    def undone(self):
        """Undoes all steps and returns their number."""
        count = 0
        while self.history.stack.canUndo():
            self.history.undo()
            count += 1
        return count


@pytest.fixture
def edits(path, qapp):
    return Edits(open_stage(path), Usd.TimeCode(7))


def visible(stage):
    time = Usd.TimeCode(7)
    return {
        str(prim.GetPath()): UsdGeom.Imageable(prim).ComputeVisibility(time) != "invisible"
        for prim in stage.Traverse()
        if prim.IsA(UsdGeom.Imageable)
    }


@pytest.mark.parametrize("name", PRIMS)
@pytest.mark.parametrize("shown", [True, False])
def test_visibility_is_what_usd_would_make(path, edits, name, shown):
    edits.do(edits.visible([Sdf.Path(name)], shown))
    other = open_stage(path)
    other.SetEditTarget(other.GetSessionLayer())
    prim = UsdGeom.Imageable.Get(other, name)
    # Pass a time to USD, since one attribute is animated; edits of the window author default values
    # instead.
    (prim.MakeVisible if shown else prim.MakeInvisible)(Usd.TimeCode(7))
    assert visible(edits.stage) == visible(other)
    for prim_path, seen in visible(edits.stage).items():
        found = state(edits.stage.GetPrimAtPath(prim_path), edits.time)[0]
        assert (found == "visible") == seen


def test_several_at_once_and_back(edits):
    before = edits.stage.GetSessionLayer().ExportToString()
    start = visible(edits.stage)
    step = edits.do(edits.visible([Sdf.Path("/World/A/B/One"), Sdf.Path("/World/A/C")], True))
    assert step.structural
    now = visible(edits.stage)
    assert now["/World/A/B/One"] and now["/World/A/C/Three"] and not now["/World/A/B/Two"]
    assert edits.history.stack.undoText() == "show 2 prims"
    edits.history.undo()
    assert visible(edits.stage) == start
    assert edits.stage.GetSessionLayer().ExportToString() == before
    edits.history.redo()
    assert visible(edits.stage) == now
    assert edits.undone() == 1 and edits.undone() == 0


def test_variants(edits):
    world = Sdf.Path("/World")
    (look,) = edits.variant_sets(world)
    assert (look.name, look.choices, look.choice) == ("look", ("ball", "box"), "ball")
    assert edits.do(edits.variant(world, "look", "box")).structural
    assert edits.stage.GetPrimAtPath("/World/Thing").GetTypeName() == "Cube"
    assert edits.lines() == ["/World{look} = box"]
    edits.do(edits.variant(world, "look", None))
    assert edits.stage.GetPrimAtPath("/World/Thing").GetTypeName() == "Sphere"
    assert edits.lines() == []
    with pytest.raises(WavecombError, match=r"look=cone.*ball, box"):
        edits.do(edits.variant(world, "look", "cone"))


def test_inside_instances_nothing_can_be_edited(edits):
    inside = Sdf.Path("/I1/Cube")
    assert edits.stage.GetPrimAtPath(inside).IsInstanceProxy()
    with pytest.raises(WavecombError, match=r"/I1/Cube.*inside an instance"):
        edits.do(edits.visible([inside], False))
    with pytest.raises(WavecombError, match="inside an instance"):
        edits.do(edits.variant(inside, "look", "box"))
    assert edits.do(edits.visible([Sdf.Path("/I1")], False))
    assert edits.edited() == [(Sdf.Path("/I1"), ".visibility")]


def test_a_drag_is_one_step(edits):
    key = (Sdf.Path("/World/A/B/One"), ".size")
    for size in (3.0, 4.0, 5.0):
        edits.change("size", {key: Opinion(size, Sdf.ValueTypeNames.Double)})
        edits.moment += 0.1
    edits.moment += 5
    edits.change("size", {key: Opinion(6.0, Sdf.ValueTypeNames.Double)})
    size = edits.stage.GetAttributeAtPath("/World/A/B/One.size")
    assert size.Get() == 6
    edits.history.undo()
    assert size.Get() == 5
    edits.history.undo()
    assert size.Get() == 2 and not edits.edited()
    assert edits.change("nothing", {key: None}) is None


def test_saved_edits_give_the_same_picture(edits, path, tmp_path):
    edits.do(edits.visible([Sdf.Path("/World/A/B/One")], True))
    edits.do(edits.variant(Sdf.Path("/World"), "look", "box"))
    edits.do(edits.visible([Sdf.Path("/I2")], False))
    (tmp_path / "sub").mkdir()
    saved = save_edits(edits.stage, tmp_path / "sub" / "edits.usda")
    text = saved.read_text()
    assert "@../stage.usda@" in text and len(text) < 2000
    size = {"size": (48, 48), "spp": 2}
    shown = wavecomb.render(load_stage(edits.stage), **size).beauty
    again = wavecomb.render(saved, **size).beauty
    assert (shown == again).all()
    assert (shown != wavecomb.render(path, **size).beauty).any()
    stage = Usd.Stage.Open(str(saved))
    assert UsdGeom.GetStageUpAxis(stage) == "Z" and stage.GetDefaultPrim().GetName() == "World"
    # The exported layer can be edited further.
    more = Edits(open_stage(saved), Usd.TimeCode(7))
    more.do(more.visible([Sdf.Path("/World/A/C")], True))
    third = save_edits(more.stage, tmp_path / "sub" / "third.usda")
    assert "@./edits.usda@" in third.read_text()


def test_what_cannot_be_saved_says_so(edits, path, tmp_path):
    with pytest.raises(WavecombError, match="file of the stage"):
        save_edits(edits.stage, path)
    with pytest.raises(WavecombError, match=r"ends in \.usda"):
        save_edits(edits.stage, tmp_path / "edits.json")
    with pytest.raises(WavecombError, match="does not exist"):
        save_edits(edits.stage, tmp_path / "none" / "edits.usda")
    with pytest.raises(WavecombError, match="no file"):
        save_edits(Usd.Stage.CreateInMemory(), tmp_path / "edits.usda")
