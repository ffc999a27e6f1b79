# SPDX-License-Identifier: Apache-2.0
"""Tests that three hundred random user actions cause no errors or leaks."""

import gc
import random
import sys
import threading

import pytest
from conftest import wait_final
from PySide6.QtCore import QtMsgType, qInstallMessageHandler
from PySide6.QtGui import QAction
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractSpinBox, QCheckBox, QComboBox, QSlider, QWidget
from test_viewport import Alt, Control, Left, Middle, No, Right, Shift, drag, wheel

ACTIONS = 300
SEED = 8
# Random tests leave out actions that open a system dialog or close the window.
LEFT_OUT = {"action.open", "action.save", "action.save_as", "action.quit", "action.full_screen"}


def resident_bytes():
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * 4096


class Monkey:
    def __init__(self, window, cornell, broken):
        self.window, self.cornell, self.broken = window, cornell, broken
        self.dice = random.Random(SEED)
        self.log = []

    def step(self):
        kinds = [self.drag, self.wheel, self.action, self.key, self.control, self.stage, self.edit]
        kind = self.dice.choices(kinds, weights=[4, 2, 5, 3, 6, 1, 3])[0]
        self.log.append(f"{kind.__name__} {kind()}")
        QTest.qWait(self.dice.choice([0, 1, 5, 20]))

    def place(self):
        viewport = self.window.viewport
        return self.dice.randrange(viewport.width()), self.dice.randrange(viewport.height())

    def drag(self):
        button, modifiers = self.dice.choice(
            [(Middle, No), (Middle, Shift), (Middle, Control), (Left, Alt), (Left, No), (Right, No)]
        )
        drag(self.window.viewport, button, self.place(), self.place(), modifiers)
        return button, modifiers

    def wheel(self):
        notches, modifiers = self.dice.choice([-2, -1, 1, 2]), self.dice.choice([No, Control])
        wheel(self.window.viewport, self.place(), notches, modifiers)
        return notches, modifiers

    def action(self):
        actions = [
            a
            for a in self.window.findChildren(QAction)
            if a.objectName().startswith(("action.", "theme.")) and a.objectName() not in LEFT_OUT
        ]
        action = self.dice.choice(actions)
        action.trigger()
        return action.objectName()

    def key(self):
        key = self.dice.choice("f1379.,[]b\\ ")
        QTest.keyClicks(self.window.viewport, key)
        return key

    def control(self):
        kinds = (QAbstractSpinBox, QComboBox, QCheckBox, QSlider)
        controls: list[QWidget] = [
            c for kind in kinds for c in self.window.findChildren(kind)
            if c.isVisible() and c.isEnabled() and not c.objectName().startswith("qt_")
        ]  # fmt: skip
        control = self.dice.choice(controls)
        name = control.objectName()
        if isinstance(control, QCheckBox):
            control.click()
        elif isinstance(control, QComboBox):
            if control.count():
                index = self.dice.randrange(control.count())
                control.setCurrentIndex(index)
                control.activated.emit(index)
                control.textActivated.emit(control.currentText())
        elif isinstance(control, QSlider):
            control.setValue(self.dice.randint(control.minimum(), control.maximum()))
        elif name in ("render.width", "render.height", "render.spp"):
            control.setValue(self.dice.randint(1, 120))
        else:
            control.stepBy(self.dice.choice([-3, -1, 1, 2]))
        return name

    def stage(self):
        path = self.dice.choice([self.cornell, self.broken, None])
        if path is None:
            self.window.reload()
        else:
            self.window.open(path)
        return path

    def edit(self):
        session = self.window.session
        if session.scene is None or not session.scene.materials:
            return None
        material = self.dice.randrange(len(session.scene.materials))
        value = self.dice.uniform(-0.1, 0.9)
        session.edit_material(material, base_color=(value, 0.5, 0.2))
        return material, value


def play(monkey, count):
    for _ in range(count):
        monkey.step()


@pytest.mark.slow
def test_random_actions(cornell_window, qtbot, cornell, tmp_path, monkeypatch):
    window = cornell_window
    broken = tmp_path / "broken.usda"
    broken.write_text("#usda 1.0\ndef {")
    faults = []
    monkeypatch.setattr(sys, "excepthook", lambda *fault: faults.append(fault))
    monkeypatch.setattr(threading, "excepthook", lambda fault: faults.append(fault.exc_value))
    bad = (QtMsgType.QtWarningMsg, QtMsgType.QtCriticalMsg, QtMsgType.QtFatalMsg)

    def heard(kind, context, text):
        # Ignore messages of Qt's offscreen platform about sizes and raising of windows.
        if kind in bad and not text.startswith("This plugin does not support"):
            faults.append(text)

    before = qInstallMessageHandler(heard)
    monkey = Monkey(window, cornell, broken)
    try:
        play(monkey, 2 * ACTIONS // 3)  # a first run makes all allocations that happen only once
        gc.collect()
        threads, objects, resident = (
            threading.active_count(),
            len(gc.get_objects()),
            resident_bytes(),
        )
        play(monkey, ACTIONS - 2 * ACTIONS // 3)
        window.session.change(width=64, height=64, spp=2, time_limit=0.0, noise=0.0, adaptive=0.0)
        window.session.settle()
        if window._dialog is not None:
            window._dialog.close()
        qtbot.waitUntil(lambda: not window.session._jobs, timeout=20000)
        window.session.restart()
        wait_final(qtbot, window.session, 30000)
        # A thread of a single job may still be running.
        qtbot.waitUntil(lambda: threading.active_count() <= threads + 1, timeout=20000)
        QTest.qWait(50)
        gc.collect()
    finally:
        qInstallMessageHandler(before)
    story = "\n".join(monkey.log[-12:])
    assert not faults, f"{faults}\n{story}"
    assert not window.message.text().startswith("Error: internal:"), window.message.text() + story
    assert threading.active_count() <= threads + 1, threading.enumerate()
    assert len(gc.get_objects()) < 1.15 * objects
    assert resident_bytes() < resident + 150e6
