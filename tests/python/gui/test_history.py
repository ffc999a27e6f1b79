# SPDX-License-Identifier: Apache-2.0
"""Tests undo steps: merging, menu texts, saved state and camera history."""

import weakref

import numpy as np
import pytest
from conftest import wait_final
from pxr import Sdf, Usd
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from scene_stage import write_stage

from wavecomb.gui.scene.history import History
from wavecomb.gui.scene.stage_edits import Opinion, StageEdits
from wavecomb.gui.viewport.view_history import ViewHistory

KEY = "/World/Lights/Key"
Control, Shift, Alt = (
    Qt.KeyboardModifier.ControlModifier,
    Qt.KeyboardModifier.ShiftModifier,
    Qt.KeyboardModifier.AltModifier,
)


@pytest.fixture(scope="module")
def stage_path(tmp_path_factory):
    return write_stage(tmp_path_factory.mktemp("history"))


class Steps:
    """Edits of a number on an in-memory stage, with an undo history and a manual clock."""

    def __init__(self):
        stage = Usd.Stage.CreateInMemory()
        stage.DefinePrim("/A")
        self.edits = StageEdits(stage, Usd.TimeCode.Default())
        self.clock = 0.0
        self.history = History(now=lambda: self.clock)
        self.history.step.connect(self.edits.apply)

    def set(self, value, name="x", after=0.1):
        self.clock += after
        opinion = None if value is None else Opinion(value, Sdf.ValueTypeNames.Float)
        self.history.push(self.edits.plan(f"{name} of /A", {(Sdf.Path("/A"), f".{name}"): opinion}))

    def get(self, name="x"):
        opinion = self.edits.opinion((Sdf.Path("/A"), f".{name}"))
        return None if opinion is None else opinion.value

    def count(self):
        return self.history.stack.count()


@pytest.fixture
def steps(qapp):
    return Steps()


def test_a_drag_is_one_step(steps):
    for value in (1.0, 2.0, 3.0):
        steps.set(value)
    assert steps.count() == 1 and steps.get() == 3.0
    steps.set(4.0, after=5.0)
    steps.set(1.0, "y")
    steps.set(5.0)
    assert steps.count() == 4, "slow ones, and those of other things, are steps of their own"
    values = []
    while steps.history.stack.canUndo():
        steps.history.undo()
        values.append((steps.get(), steps.get("y")))
    assert values == [(4.0, 1.0), (4.0, None), (3.0, None), (None, None)]
    for _ in range(4):
        steps.history.redo()
    assert (steps.get(), steps.get("y")) == (5.0, 1.0)


def test_what_is_taken_back_is_a_step(steps):
    steps.set(1.0)
    steps.set(None)
    steps.set(2.0)
    assert steps.count() == 3
    steps.history.undo()
    steps.set(3.0)
    assert steps.count() == 3 and not steps.history.stack.canRedo()


def test_a_change_after_an_undo_does_not_join_the_step_before(steps):
    steps.set(1.0)
    steps.set(2.0, after=5.0)
    steps.history.undo()
    steps.clock -= 5.0
    steps.set(3.0)
    steps.history.undo()
    assert steps.get() == 1.0


def test_typing_joins_what_is_slow_and_nothing_else(steps):
    for run in ((1.0, 2.0), (3.0, 4.0)):
        steps.history.set_typing(True)
        for value in run:
            steps.set(value, after=5.0)
        steps.history.set_typing(False)
    steps.set(5.0)
    assert steps.count() == 3


def test_a_step_does_not_join_what_was_saved(steps):
    steps.set(1.0)
    steps.history.stack.setClean()
    steps.set(2.0)
    assert steps.count() == 2 and not steps.history.stack.isClean()
    steps.history.undo()
    assert steps.history.stack.isClean() and steps.get() == 1.0


def test_commands_keep_nothing_alive(qapp):
    stage = Usd.Stage.CreateInMemory()
    stage.DefinePrim("/A")
    edits, history = StageEdits(stage, Usd.TimeCode.Default()), History()
    history.step.connect(edits.apply)
    opinion = Opinion(1.0, Sdf.ValueTypeNames.Float)
    history.push(edits.plan("x of /A", {(Sdf.Path("/A"), ".x"): opinion}))
    history.undo()
    gone = weakref.ref(history)
    del history
    assert gone() is None


@pytest.fixture
def scene_window(window, qtbot, stage_path):
    with qtbot.waitSignal(window.session.opened, timeout=20000):
        window.open(stage_path)
    wait_final(qtbot, window.session)
    return window


def test_the_menu_says_what_it_would_undo(scene_window):
    window, edits = scene_window, scene_window.scene.edits
    undo, redo = (window.actions_by_name[name] for name in ("undo", "redo"))
    assert (undo.text(), undo.isEnabled(), redo.isEnabled()) == ("&Undo", False, False)
    edits.set_light(KEY, "intensity", 2.0)
    edits.set_parameter("/World/Looks/Red", "roughness", 0.1)
    assert undo.text() == "&Undo roughness of /World/Looks/Red" and undo.isEnabled()
    assert window.scene.undo_action.toolTip() == "Undo roughness of /World/Looks/Red"
    QTest.keyClick(window, Qt.Key.Key_Z, Control)
    assert undo.text() == f"&Undo intensity of {KEY}"
    assert redo.text() == "&Redo roughness of /World/Looks/Red" and redo.isEnabled()
    QTest.keyClick(window, Qt.Key.Key_Z, Control)
    assert edits.lines() == [] and not undo.isEnabled() and undo.text() == "&Undo"
    QTest.keyClick(window, Qt.Key.Key_Z, Control | Shift)
    assert edits.lines() == [f"{KEY}.inputs:intensity = 2"]


@pytest.mark.slow
def test_the_title_marks_what_is_not_saved(scene_window, qtbot, tmp_path):
    window, edits = scene_window, scene_window.scene.edits
    assert "[*]" in window.windowTitle() and not window.isWindowModified()
    window.viewport.orbit(0.1, 0.0)
    assert not window.isWindowModified(), "looking about is no edit"
    edits.set_light(KEY, "intensity", 2.0)
    assert window.isWindowModified()
    assert edits.save(str(tmp_path / "edits.usda"))
    assert not window.isWindowModified()
    edits.undo()
    assert window.isWindowModified(), "the file says otherwise"
    edits.redo()
    assert not window.isWindowModified()
    edits.set_light(KEY, "intensity", 3.0)
    assert edits.history.stack.count() == 2, "it does not join what was saved"
    with qtbot.waitSignal(window.session.opened, timeout=20000):
        window.reload()
    assert not window.isWindowModified() and not edits.history.stack.canUndo()


@pytest.mark.slow
def test_solo_is_undone_as_a_whole(scene_window):
    edits, lights = scene_window.scene.edits, scene_window.scene.lights.model.rows
    first, second = lights[:2]
    edits.set_visible([lights[2]], False)

    def seen():
        return [not edits.is_hidden(path) for path in lights]

    assert seen() == [True, True, False]
    edits.solo_light(first, lights)
    edits.solo_light(second, lights)
    assert edits.solo == second and seen() == [False, True, False]
    edits.undo()
    assert edits.solo == first and seen() == [True, False, False]
    edits.undo()
    assert edits.solo is None and seen() == [True, True, False]
    edits.redo()
    edits.solo_light(None, lights)
    assert edits.solo is None and seen() == [True, True, False]
    edits.undo()
    assert edits.solo == first and seen() == [True, False, False]


@pytest.mark.slow
def test_the_camera_goes_back_and_forth(scene_window, qtbot):
    window, session = scene_window, scene_window.session
    clock = [0.0]
    window.views.now = lambda: clock[0]
    back, forth = (window.actions_by_name[name] for name in ("view_back", "view_forth"))
    start = session.pose
    assert start.path == "/World/Cam" and not back.isEnabled()
    for _ in range(5):  # one drag
        window.viewport.orbit(0.05, 0.0, moving=True)
        clock[0] += 0.1
    session.settle()
    turned = session.pose
    clock[0] += 5.0
    session.use_camera("/World/Side")
    assert back.isEnabled() and back.text() == "&Back from camera /World/Side"
    window.scene.edits.set_light(KEY, "intensity", 2.0)
    QTest.keyClick(window, Qt.Key.Key_Z, Control | Alt)
    assert session.pose is turned, "edits stay"
    back.trigger()
    assert session.pose is start and not back.isEnabled() and forth.isEnabled()
    frame = wait_final(qtbot, session)
    assert np.isfinite(frame.beauty).all()
    forth.trigger()
    assert session.pose is turned
    window.viewport.orbit(0.1, 0.0)
    assert not forth.isEnabled() and window.views.stack.count() == 2
    assert window.scene.edits.lines() == [f"{KEY}.inputs:intensity = 2"]
    with qtbot.waitSignal(session.opened, timeout=20000):
        window.scene.edits.set_visible(["/World/Sign"], False)
    assert window.views.stack.canUndo(), "it is the same stage"


def test_another_stage_has_another_way(session, qtbot, stage_path):
    views = ViewHistory(session)
    pose = session.pose
    session.use_camera(None)
    assert views.stack.count() == 1
    views.stack.undo()
    assert session.pose is pose
    with qtbot.waitSignal(session.opened, timeout=20000):
        session.open(stage_path)
    assert views.stack.count() == 0
