# SPDX-License-Identifier: Apache-2.0
"""Tests that a window offers edits that an earlier window did not save."""

import signal
import subprocess
import sys

import pytest
from pxr import Sdf
from PySide6.QtCore import QSettings
from PySide6.QtWidgets import QMessageBox, QPushButton

from wavecomb.gui.scene import autosave

STAGE = """#usda 1.0
def SphereLight "Key" {
    float inputs:intensity = 4
    double3 xformOp:translate = (0, 4, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Sphere "Ball" {
}
"""


@pytest.fixture
def path(tmp_path, monkeypatch):
    monkeypatch.setattr(autosave, "DELAY_MS", 20)
    (tmp_path / "s.usda").write_text(STAGE)
    return tmp_path / "s.usda"


@pytest.fixture
def new_window(qtbot, tmp_path):
    """A function that makes windows with an open stage."""
    from wavecomb.gui.main_window import MainWindow
    from wavecomb.gui.setup import Setup

    made = []

    def make(path):
        settings = QSettings(str(tmp_path / "w.ini"), QSettings.Format.IniFormat)
        window = MainWindow(Setup(width=32, height=32, spp=1), settings)
        made.append(window)
        qtbot.addWidget(window)
        with qtbot.waitSignal(window.session.opened, timeout=20000):
            window.open(path)
        return window

    return make


def saved(window):
    file = window.autosave.file
    return Sdf.Layer.OpenAsAnonymous(str(file)) if file is not None and file.exists() else None


def intensity(layer):
    return layer.GetAttributeAtPath("/Key.inputs:intensity").default


def offer(window):
    return window.findChild(QMessageBox, "autosave")


def click(box, text):
    box.findChild(QPushButton, f"autosave.{text.lower()}").click()


@pytest.mark.slow
def test_edits_are_copied_until_they_are_saved_or_undone(new_window, qtbot, path, tmp_path):
    window = new_window(path)
    edits = window.scene.edits
    assert offer(window) is None and saved(window) is None
    edits.set_light("/Key", "intensity", 9.0)
    qtbot.waitUntil(lambda: saved(window) is not None)
    assert intensity(saved(window)) == 9.0
    edits.undo()
    qtbot.waitUntil(lambda: saved(window) is None)
    edits.set_light("/Key", "intensity", 7.0)
    qtbot.waitUntil(lambda: saved(window) is not None)
    assert edits.save(str(tmp_path / "over.usda"))
    qtbot.waitUntil(lambda: saved(window) is None)


@pytest.mark.slow
def test_unsaved_edits_are_restored_by_the_next_window(new_window, qtbot, path):
    first = new_window(path)
    first.scene.edits.set_light("/Key", "intensity", 9.0)
    first.close()
    second = new_window(path)
    click(offer(second), "Restore")
    key = second.scene.edits.usd.GetPrimAtPath("/Key")
    assert key.GetAttribute("inputs:intensity").Get() == 9.0
    assert not second.scene.edits.history.stack.isClean()
    assert second.scene.edits.lines()


@pytest.mark.slow
def test_discarded_edits_are_gone(new_window, path):
    first = new_window(path)
    first.scene.edits.set_light("/Key", "intensity", 9.0)
    first.close()
    second = new_window(path)
    click(offer(second), "Discard")
    assert saved(second) is None
    second.close()
    assert offer(new_window(path)) is None


@pytest.mark.slow
def test_a_second_window_of_a_stage_leaves_the_copy_alone(new_window, qtbot, path):
    first, second = new_window(path), new_window(path)
    assert first.autosave.file is not None and second.autosave.file is None
    first.scene.edits.set_light("/Key", "intensity", 9.0)
    second.scene.edits.set_light("/Key", "intensity", 2.0)
    qtbot.waitUntil(lambda: saved(first) is not None)
    second.autosave.write()
    assert intensity(saved(first)) == 9.0


CRASH = """
import os, sys
from pathlib import Path
from PySide6.QtCore import QSettings, QTimer
from PySide6.QtWidgets import QApplication
from wavecomb.gui.scene import autosave
import wavecomb.gui.main_window as module
from wavecomb.gui.setup import Setup

autosave.DELAY_MS = 20
module.log_folder = lambda: Path(sys.argv[2])
app = QApplication([])
settings = QSettings(sys.argv[2] + "/w.ini", QSettings.Format.IniFormat)
window = module.MainWindow(Setup(width=32, height=32, spp=1), settings)
def edit(stage):
    window.scene.edits.set_light("/Key", "intensity", 9.0)
    timer.start(20)
def crash():
    if window.autosave.file.exists():
        os.kill(os.getpid(), 11)
timer = QTimer()
timer.timeout.connect(crash)
window.session.opened.connect(edit)
window.open(sys.argv[1])
app.exec()
"""


@pytest.mark.slow
def test_a_crash_loses_nothing(new_window, path, tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", CRASH, str(path), str(tmp_path / "state")],
        capture_output=True, text=True, timeout=90, check=False,
    )  # fmt: skip
    assert done.returncode == -signal.SIGSEGV, done.stderr
    window = new_window(path)
    click(offer(window), "Restore")
    key = window.scene.edits.usd.GetPrimAtPath("/Key")
    assert key.GetAttribute("inputs:intensity").Get() == 9.0
