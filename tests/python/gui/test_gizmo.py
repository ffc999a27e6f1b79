# SPDX-License-Identifier: Apache-2.0
"""Tests the outline, the handles that move, rotate and scale prims, and the timeline."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import wait_final
from pxr import Gf, Sdf, Usd, UsdGeom
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest

from wavecomb.errors import WavecombError
from wavecomb.gui.scene.transforms import Placements, changed_transforms
from wavecomb.gui.viewport.navigate import project
from wavecomb.gui.viewport.outline import edges

STAGE = """#usda 1.0
(
    startTimeCode = 1
    endTimeCode = 4
    framesPerSecond = 100
)
def Xform "World"
{
    double3 xformOp:translate = (1, 0, 0)
    float xformOp:rotateY = 30
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY"]
    def Sphere "Ball"
    {
        double radius = 0.5
        double3 xformOp:translate.timeSamples = { 1: (0, 0, 0), 4: (0, 1, 0) }
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def RectLight "Key"
    {
        float inputs:intensity = 5
        double3 xformOp:translate = (-1.5, 1, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
def Camera "Cam"
{
    double3 xformOp:translate = (0, 0, 8)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
BALL, KEY = "/World/Ball", "/World/Key"


@pytest.fixture
def moved(window, qtbot, tmp_path):
    """The window with the stage, and a function that drags a handle with real mouse events."""
    path = tmp_path / "moved.usda"
    path.write_text(STAGE)
    window.session.change(width=192, height=144, spp=2)
    with qtbot.waitSignal(window.session.opened, timeout=10000):
        window.open(path)
    wait_final(qtbot, window.session)
    view = window.viewport
    window.activateWindow()

    def drag(path, key, handle, by, end=-1):
        window.session.select(path)
        view.setFocus()
        QTest.keyClick(view, key)
        points = view.gizmo.handles()[handle]
        at = QPoint(*map(round, points[end]))
        if by is None:  # along the ring
            by = [round(to - start) for start, to in zip(points[end], points[end + 3], strict=True)]
        QTest.mousePress(view, Qt.MouseButton.LeftButton, pos=at)
        for step in range(1, 5):
            QTest.mouseMove(view, at + QPoint(by[0] * step // 4, by[1] * step // 4))
            qtbot.wait(20)
        QTest.mouseRelease(view, Qt.MouseButton.LeftButton, pos=at + QPoint(*by))
        qtbot.waitUntil(lambda: not window.session._jobs, timeout=20000)
        return wait_final(qtbot, window.session)

    window.drag = drag
    return window


def press(window, path, key, handle):
    """Selects a prim and presses the mouse on one of its handles; returns the mouse position."""
    view = window.viewport
    window.session.select(path)
    view.setFocus()
    QTest.keyClick(view, key)
    at = QPoint(*np.round(view.gizmo.handles()[handle][-1]).astype(int))
    QTest.mousePress(view, Qt.MouseButton.LeftButton, pos=at)
    return at


def world(window, path):
    cache = UsdGeom.XformCache(window.scene.edits.time)
    return np.array(cache.GetLocalToWorldTransform(window.session.usd.GetPrimAtPath(path)))


@pytest.mark.slow
def test_a_light_follows_its_handle_at_once_and_undoes_in_one_step(moved):
    before = world(moved, KEY)
    moved.drag(KEY, Qt.Key.Key_W, "y", (0, -40))
    after = world(moved, KEY)
    assert after[3, 1] > before[3, 1] + 0.2, "upwards on the screen"
    assert np.allclose(after[:3], before[:3]) and np.allclose(after[3, [0, 2]], before[3, [0, 2]])
    live = np.array(moved.session.scene.light(0)["transform"])
    assert np.allclose(live, after, atol=1e-5)
    assert moved.scene.edits.history.stack.count() == 1
    moved.scene.edits.undo()
    assert np.allclose(world(moved, KEY), before) and moved.scene.edits.lines() == []


@pytest.mark.slow
def test_an_object_moves_when_the_drag_ends(moved, qtbot):
    before = moved.session.scene.bounds_of(BALL)
    moved.drag(BALL, Qt.Key.Key_W, "all", (40, 0))
    after = moved.session.scene.bounds_of(BALL)
    assert after[0][0] > before[0][0] + 0.2
    assert np.allclose(
        np.subtract(after[1], after[0]), np.subtract(before[1], before[0]), atol=1e-4
    )
    assert np.allclose(after[0][1:], before[0][1:], atol=1e-4), "in the plane of the view"
    moved.scene.edits.undo()
    qtbot.waitUntil(
        lambda: np.allclose(moved.session.scene.bounds_of(BALL), before, atol=1e-4), timeout=20000
    )
    assert moved.scene.edits.lines() == []


@pytest.mark.slow
def test_an_object_follows_the_drag_without_loading(moved, qtbot):
    session, opened = moved.session, []
    session.opened.connect(opened.append)
    before = session.scene.bounds_of(BALL)
    view, at = moved.viewport, press(moved, BALL, Qt.Key.Key_W, "all")
    QTest.mouseMove(view, at + QPoint(20, 0))
    QTest.mouseMove(view, at + QPoint(40, 0))
    qtbot.waitUntil(lambda: session.scene.bounds_of(BALL)[0][0] > before[0][0] + 0.2, timeout=20000)
    assert moved.scene.edits.history.stack.count() == 1, "the drag has not ended"
    version = session.version
    QTest.mouseMove(view, at + QPoint(30, 0))
    QTest.mouseMove(view, at + QPoint(40, 0))
    assert session.version <= version + 1, "waits until an image was shown"
    handle = view.gizmo.handles()["all"][0]
    assert np.allclose(handle, (at.x() + 40, at.y()), atol=2.0), "handles follow the cursor"
    QTest.mouseRelease(view, Qt.MouseButton.LeftButton, pos=at + QPoint(40, 0))
    frame = wait_final(qtbot, session)
    after = session.scene.bounds_of(BALL)
    assert np.allclose(view.gizmo.handles()["all"][0], handle, atol=2.0)
    assert not opened and moved.scene.edits.history.stack.count() == 1
    for change, expected in ((moved.scene.edits.undo, before), (moved.scene.edits.redo, after)):
        change()
        again = wait_final(qtbot, session)
        assert np.allclose(session.scene.bounds_of(BALL), expected, atol=1e-4) and not opened
    assert np.array_equal(again.beauty, frame.beauty)
    session.rebuild("the edit on the stage")
    qtbot.waitUntil(lambda: bool(opened), timeout=20000)
    loaded = wait_final(qtbot, session)
    assert np.allclose(session.scene.bounds_of(BALL), after, atol=1e-4)
    assert np.abs(loaded.beauty - frame.beauty).mean() < 1e-3 * loaded.beauty.mean()


@pytest.mark.slow
def test_moves_of_a_group_and_of_its_parts_add_up(moved, qtbot):
    session, edits, opened = moved.session, moved.scene.edits, []
    session.opened.connect(opened.append)

    def shift(path, x, y):
        matrix = Gf.Matrix4d().SetTranslate(Gf.Vec3d(x, y, 0))
        turn = Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(0, 0, 1), 20.0 * y))
        edits.move(edits.placement(path), turn * matrix)

    for path, x, y in ((BALL, 1, 0.5), ("/World", -0.5, 1), (KEY, 0, 1), (BALL, 0.25, 0)):
        shift(path, x, y)
    wait_final(qtbot, session)
    live = session.scene.bounds_of(BALL), session.scene.light(0)["transform"]
    assert np.allclose(live[1], world(moved, KEY), atol=1e-5) and not opened
    session.rebuild("the edits on the stage")
    qtbot.waitUntil(lambda: bool(opened), timeout=20000)
    wait_final(qtbot, session)
    # The bounds of a turned instance are those of its turned box.
    assert np.allclose(np.mean(session.scene.bounds_of(BALL), 0), np.mean(live[0], 0), atol=1e-3)
    assert np.allclose(session.scene.light(0)["transform"], live[1], atol=1e-5)


def test_the_stage_is_loaded_again_where_a_move_is_refused(moved, qtbot, monkeypatch):
    session, edits, opened = moved.session, moved.scene.edits, []
    session.opened.connect(opened.append)
    before = session.scene.bounds_of(BALL)

    class Refusing:
        """Wrapper of the session's renderer that refuses to move objects."""

        def __init__(self, core):
            self._core = core

        def edit(self, *, moves=None, **others):
            if moves:
                raise WavecombError("object '/World/Ball' is a part of an instance")
            self._core.edit(**others)

        def __getattr__(self, name):
            return getattr(self._core, name)

    session._engine._renderer = Refusing(session._engine._renderer)
    edits.move(edits.placement(BALL), Gf.Matrix4d().SetTranslate(Gf.Vec3d(1, 0, 0)))
    assert edits.can_follow(Sdf.Path(BALL))
    qtbot.waitUntil(lambda: bool(opened), timeout=20000)
    wait_final(qtbot, session)
    assert session.scene.bounds_of(BALL)[0][0] == pytest.approx(before[0][0] + 1.0, abs=1e-3)
    assert not edits.can_follow(Sdf.Path(BALL)), "remembered after loading"


OTHERS = """#usda 1.0
def Xform "World"
{
    def Xform "Free" { def Sphere "A" { } }
    def Xform "Filmed" { def Sphere "A" { } def Camera "C" { } }
    def Xform "Fixed" {
        def Sphere "A" { uniform token[] xformOpOrder = ["!resetXformStack!"] }
    }
    def Xform "Turning" {
        double xformOp:rotateY.timeSamples = { 1: 0, 4: 90 }
        uniform token[] xformOpOrder = ["xformOp:rotateY"]
        def Sphere "A" { }
    }
    def Xform "Copy" ( prepend references = </World/Free> ) { }
    def Xform "Empty" { }
    def PointInstancer "Many" {
        rel prototypes = </World/Kinds/K>
        int[] protoIndices = [0]
        point3f[] positions = [(0, 3, 0)]
    }
    def Scope "Kinds" { def Xform "K" { def Sphere "A" { } } }
}
"""


def test_prims_that_the_render_can_follow(tmp_path):
    path = tmp_path / "others.usda"
    path.write_text(OTHERS.replace("{ ", "{\n").replace(" }", "\n}").replace("} ", "}\n"))
    stage = Usd.Stage.Open(str(path))
    placements = Placements(stage, Usd.TimeCode(1.0))

    def follows(name):
        at = f"/World/{name}"
        return placements.can_follow(Sdf.Path(at), lambda one: one != "/World/Empty")

    assert follows("Free") and follows("Turning") and follows("Many")
    for name in ("Filmed", "Fixed", "Turning/A", "Empty", "Kinds/K", "Kinds", "Missing"):
        assert not follows(name), name
    sphere = UsdGeom.Xformable(stage.GetPrimAtPath("/World/Free/A"))
    changed = changed_transforms(stage, lambda: sphere.AddTranslateOp().Set((1, 0, 0)))
    assert changed == {Sdf.Path("/World/Free/A"), Sdf.Path("/World/Copy/A")}


@pytest.mark.slow
def test_rotation_follows_the_cursor_and_scale_the_axes_of_the_prim(moved):
    moved.session.change(spp=1)
    before = world(moved, KEY)
    ring = 12
    moved.drag(KEY, Qt.Key.Key_E, "z", None, ring)
    turned = world(moved, KEY)
    assert np.allclose(turned[3], before[3], atol=1e-6), "about its origin"
    assert np.allclose(np.linalg.norm(turned[:3, :3], axis=1), 1.0)
    assert abs((turned[0, :3] @ before[0, :3]) - 1.0) > 1e-3
    moved.drag(KEY, Qt.Key.Key_R, "x", (20, 0))
    sizes = np.linalg.norm(world(moved, KEY)[:3, :3], axis=1)
    assert sizes[0] != pytest.approx(1.0, abs=0.02) and np.allclose(sizes[1:], 1.0, atol=1e-6)


@pytest.mark.slow
def test_edited_transforms_are_saved_and_read_again(moved, tmp_path):
    moved.drag(KEY, Qt.Key.Key_W, "y", (0, -40))
    wanted = world(moved, KEY)
    assert moved.scene.edits.save(str(tmp_path / "edits.usda"))
    stage = Usd.Stage.Open(str(tmp_path / "edits.usda"))
    found = UsdGeom.XformCache(1.0).GetLocalToWorldTransform(stage.GetPrimAtPath(KEY))
    assert np.allclose(np.array(found), wanted)


def test_the_outline_surrounds_the_selection(moved, qtbot):
    view, session = moved.viewport, moved.session
    session.select(BALL)
    qtbot.waitUntil(lambda: view.marked.image is not None, timeout=10000)
    image = view.marked.image
    drawn = [
        (x, y) for x in range(image.width()) for y in range(image.height())
        if image.pixelColor(x, y).alpha()
    ]  # fmt: skip
    setup = session.setup
    centre = project(session.pose, np.mean([session.scene.bounds_of(BALL)], axis=1),
                     (setup.width, setup.height))[0]  # fmt: skip
    x, y = np.mean(drawn, axis=0) * setup.width / image.width()
    assert abs(x - centre[0]) < 3 and abs(y - centre[1]) < 3
    session.select("/World")
    session.select(None)
    qtbot.waitUntil(lambda: view.marked.image is None, timeout=10000)


def test_edges_are_outside_of_the_mask():
    mask = np.zeros((5, 5), bool)
    mask[0, 0] = mask[2, 2] = True
    found = edges(mask)
    assert {tuple(at) for at in np.argwhere(found)} == {
        (0, 1), (1, 0), (1, 2), (2, 1), (2, 3), (3, 2)
    }  # fmt: skip


@pytest.mark.slow
def test_the_timeline_plays_and_stops_at_full_size(moved, qtbot):
    line, session = moved.timeline, moved.session
    assert line.isVisible() and (line.slider.minimum(), line.slider.maximum()) == (1, 4)
    low = session.scene.bounds_of(BALL)[0][1]
    shown = []
    session.opened.connect(lambda stage: shown.append(stage.frame))
    QTest.mouseClick(line.play, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: len(shown) >= 5, timeout=30000)
    assert shown[:4] == [2.0, 3.0, 4.0, 1.0], "repeats"
    QTest.mouseClick(line.play, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: not session._jobs, timeout=20000)
    line.frame.setValue(4)
    qtbot.waitUntil(lambda: not session._jobs and session.stage.frame == 4.0, timeout=20000)
    assert wait_final(qtbot, session).scale == 1
    assert session.scene.bounds_of(BALL)[0][1] == pytest.approx(low + 1.0, abs=1e-3)


def test_a_still_stage_has_no_timeline(cornell_window):
    assert not cornell_window.timeline.isVisible()
    cornell_window.timeline.toggle()
    assert not cornell_window.timeline.is_playing
