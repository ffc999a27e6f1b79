# SPDX-License-Identifier: Apache-2.0
"""Operates the window as a user would, by mouse and keyboard on an X server.

`make test-long` runs ten very different stages. WAVECOMB_SCREENSHOTS names a folder for
screenshots.
"""

import contextlib
import os
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from mtlx_stage import write_referring, write_stage
from parts import ASSETS, asset, needs
from person import Person, screen
from pxr import Sdf
from test_gizmo import BALL, STAGE

import wavecomb.usd
from wavecomb.usd.stage.report import LoadReport, capture_diagnostics

pytestmark = needs("bin:Xvfb", "bin:xdotool", "bin:openbox")

BROKEN = '#usda 1.0\ndef Xform "World"\n{\n    float x = \n'
DAMAGED = "a stage that is damaged"
# Its light is inside a closed sphere. Framing the sphere shows its dark outside.
DARK_OUTSIDE = "usdlux/iesTest.usda"
TEN = {
    "StandardShaderBall/standard_shader_ball_scene.usda": "MaterialX with textures",
    "wg_test_assets/MaterialXTest/basicTextured.usda": ".mtlx files",
    "cornell-box/mtlx-ref/cornell-box.usda": "a look in a .mtlx file",
    "openusd/testUsdImagingGLInstancing/nestedInstance.usda": "instances in instances",
    "openusd/testUsdImagingGLPointInstancer/pi_ni_material.usda": "point instancers",
    "openusd/testUsdImagingGLUsdSkel/twoBends.usda": "skeletons",
    "kaolin/avocado.usda": "no light, no camera",
    "usdlux/iesTest.usda": "lights with profiles",
    "Teapot/Teapot.usd": "payloads, variants",
    DAMAGED: "half of a crate file",
}


@pytest.fixture(scope="module")
def display():
    with screen() as made:
        yield made


@pytest.fixture
def person(display, tmp_path):
    with contextlib.ExitStack() as stack:

        def make(*arguments, **options):
            made = Person(display, tmp_path, *arguments, **options)
            stack.callback(made.close)
            return made

        yield make


def shot(tmp_path, name):
    """Returns the path of a screenshot."""
    folder = Path(os.environ.get("WAVECOMB_SCREENSHOTS") or tmp_path)
    folder.mkdir(parents=True, exist_ok=True)
    return folder / f"{name}.png"


def open_stage(person, path):
    person.key("ctrl+o")
    person.answer("QFileDialog", str(path))
    person.wait(lambda: person.ask("state")["open"] == str(path), f"{path} to open")
    state = person.settled()
    assert state["message"] == "" and state["selection"] is None
    return state


def orbit(person, tmp_path, name):
    before = person.ask("state")
    x, y, wide, high = person.ask("picture")
    seen = person.picture(shot(tmp_path, f"{name}-open"))
    assert seen.max() > 0.1 and seen.std() > 0.005, "something is to be seen"
    person.drag((x + wide // 2, y + high // 2), (wide // 6, high // 10))
    after = person.settled()
    assert after["pose"] != before["pose"] and after["camera"] is None
    assert (person.picture(shot(tmp_path, f"{name}-turned")) != seen).any()


def select(person):
    """Clicks on several points of the image until a prim is selected."""
    x, y, wide, high = person.ask("picture")
    for u, v in ((3, 3), (2, 4), (4, 4), (3, 2), (3, 4), (2, 2), (4, 2), (1, 3), (5, 3)):
        person.click([x + u * wide // 6, y + v * high // 6, 0, 0])
        with contextlib.suppress(AssertionError):
            person.wait(lambda: person.ask("state")["selection"], "a selection", seconds=1)
            break
    chosen = person.ask("state")["selection"]
    assert chosen, "nothing was selected"
    person.key("f")
    person.settled()
    return chosen


def edit(person, tmp_path, name):
    """Edits the first material with a numeric field, undoes the edit, and repeats it."""
    person.click(person.ask("tab", "Materials"))
    for path in person.ask("materials"):
        if path and person.ask("material", path):
            person.click(person.ask("material", path))
            person.wait(lambda: person.ask("numbers") is not None, "fields")
            if person.ask("numbers"):
                break
    else:
        return None
    before = person.settled()
    numbers = person.ask("numbers")
    slot, rect, text = numbers[0]
    wanted = "0.375" if float(text) != 0.375 else "0.625"
    person.click(rect)
    person.key("ctrl+a")
    person.type(wanted)
    person.wait(lambda: len(person.ask("state")["edits"]) == 1, f"{slot} to be edited")
    after = person.settled()
    assert after["version"] > before["version"]
    person.key("ctrl+z")
    person.wait(lambda: person.ask("state")["edits"] == [], f"{slot} to be as before")
    person.settled()
    (again,) = [now for one, _, now in person.ask("numbers") if one == slot]
    assert float(again) == float(text), "the field shows what the stage says"
    person.key("ctrl+a")
    person.type(wanted)
    person.key("Return")
    person.wait(lambda: len(person.ask("state")["edits"]) == 1, f"{slot} to be edited again")
    person.settled()
    person.look(shot(tmp_path, f"{name}-edited"))
    return slot, float(wanted)


def save(person, tmp_path, name, slot, value):
    """Saves the edits as a layer and the image as a file."""
    layer, picture = tmp_path / "my_edits.usda", tmp_path / "my picture.exr"
    for path in (layer, picture):
        path.unlink(missing_ok=True)
    if slot is not None:
        person.menu("File", "Save edits as layer")
        person.answer("QFileDialog", str(layer))
        person.wait(layer.exists, "the edits to be written")
        values = []
        Sdf.Layer.FindOrOpen(str(layer)).Traverse(
            "/", lambda at: values.append(at) if at.IsPropertyPath() else None
        )
        (where,) = values
        with capture_diagnostics(LoadReport()):
            stage = wavecomb.usd.open_stage(layer)
        assert np.allclose(stage.GetAttributeAtPath(where).Get(), value)
    person.key("ctrl+shift+s")
    person.answer("QFileDialog", str(picture))
    person.wait(lambda: picture.name in person.ask("state")["status"], "the picture to be written")
    pixels = oiio.ImageBuf(str(picture)).get_pixels(oiio.FLOAT)
    assert pixels.shape[:2] == (120, 160)
    assert (pixels[..., :3].max() > 0.05) == (name != Path(DARK_OUTSIDE).stem)


def compare(person, tmp_path, name):
    person.key("ctrl+shift+a")
    person.click(person.ask("tab", "Stage"))
    person.key("ctrl+shift+b")
    person.key("ctrl+d")
    person.wait(lambda: person.ask("state")["compare"], "the window to compare")
    person.wait(lambda: not person.ask("state")["busy"], "the comparison")
    person.look(shot(tmp_path, f"{name}-compared"))
    person.click(person.ask("cross", "compare"))
    person.wait(lambda: not person.ask("state")["compare"], "the comparison to close")
    person.wait(lambda: person.ask("state")["active"] == "window", "the window to come back")


def use(person, tmp_path, name):
    """Performs the actions of a typical session on the open stage."""
    orbit(person, tmp_path, name)
    select(person)
    done = edit(person, tmp_path, name)
    save(person, tmp_path, name, *(done or (None, None)))
    compare(person, tmp_path, name)
    state = person.settled()
    assert state["message"] == "", state["message"]


@pytest.mark.slow
def test_small_stages(person, tmp_path):
    """Stages with MaterialX, .mtlx files, instances, missing layers or errors, or without light."""
    looks, referring = write_stage(tmp_path), write_referring(tmp_path)
    broken = tmp_path / "broken.usda"
    broken.write_text(BROKEN)
    me = person(looks)
    me.settled()
    (x, y, wide, high), screen = me.ask("window_on_screen")
    assert x >= 0 and y >= 0 and x + wide <= screen[2] and y + high <= screen[3]
    use(me, tmp_path, "looks")
    me.key("ctrl+o")
    me.answer("QFileDialog", str(broken))
    me.wait(lambda: "broken.usda" in me.ask("state")["message"], "a line about the fault")
    state = me.ask("state")
    assert "internal" not in state["message"] and state["open"] == str(looks)
    state = open_stage(me, referring)
    assert "warning: cannot open layer: gone.usda" in state["notes"]
    use(me, tmp_path, "referring")
    me.key("ctrl+r")
    me.wait(lambda: me.ask("state")["edits"] == [], "the stage to be read again")
    assert me.settled()["message"] == ""
    me.leave()


@pytest.mark.slow
def test_handles_timeline_keys_and_a_small_window(person, tmp_path):
    """Moves a light and an object by handles, saves by keys, plays, and shrinks the window."""
    path = tmp_path / "moved.usda"
    path.write_text(STAGE)
    me = person(path, size=(320, 240))
    me.settled()
    x, y, wide, high = me.ask("picture")
    me.click([x + wide * 4 // 5, y + high // 2, 0, 0])
    me.wait(lambda: me.ask("state")["selection"] == BALL, "the ball to be selected")
    me.key("w")
    me.wait(lambda: me.ask("handles"), "handles")
    me.look(shot(tmp_path, "handles"))
    start = [round(at) for at in me.ask("handles")["y"]]
    me.drag(start, (0, -50), button=1)
    me.wait(lambda: len(me.ask("state")["edits"]) == 2, "an edited transform")
    me.settled()
    me.look(shot(tmp_path, "moved"))
    layer, picture = tmp_path / "edits.usda", tmp_path / "picture.exr"
    me.key("ctrl+s")
    me.answer("QFileDialog", str(layer))
    me.wait(layer.exists, "the edits to be written")
    assert "xformOp:transform:edit" in layer.read_text()
    me.key("ctrl+shift+s")
    me.answer("QFileDialog", str(picture))
    me.wait(picture.exists, "the picture to be written")
    me.click(me.ask("widget", "timeline.play"))
    me.wait(lambda: me.ask("frame")[1] == 3.0, "the third frame")
    me.look(shot(tmp_path, "playing"))
    me.click(me.ask("widget", "timeline.play"))
    me.settled()
    now, loaded = me.ask("frame")
    assert now == loaded
    me.do("getactivewindow", "windowsize", 900, 600)
    me.wait(lambda: me.ask("widths")[0] <= 900, "the window to shrink")
    me.wait(lambda: me.ask("widths")[1] >= me.ask("widths")[0] // 2, "half of the width")
    me.look(shot(tmp_path, "small"))
    me.leave()


@pytest.mark.long
@pytest.mark.parametrize("stage", TEN, ids=list(TEN.values()))
def test_ten_stages(person, tmp_path, stage):
    if stage == DAMAGED:
        whole = asset("usd/meshes/spot.usdc").read_bytes()
        path = tmp_path / "half.usdc"
        path.write_bytes(whole[: len(whole) // 2])
        me = person(path)
        me.wait(lambda: "half.usdc" in me.ask("state")["message"], "a line about the fault")
        assert "internal" not in me.ask("state")["message"]
        me.look(shot(tmp_path, "half"))
        open_stage(me, asset("usd/openusd/convertingLayerFormats/Sphere.usda"))
        use(me, tmp_path, "after-half")
    else:
        path = asset(f"usd/{stage}")
        assert ASSETS in path.parents
        me = person(path)
        me.wait(lambda: me.ask("state")["open"] == str(path), "the stage to open", seconds=300)
        assert me.settled()["message"] == ""
        use(me, tmp_path, Path(stage).stem)
    me.leave()
