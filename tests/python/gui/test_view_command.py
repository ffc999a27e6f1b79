# SPDX-License-Identifier: Apache-2.0
"""Tests `wavecomb view` in a shell: one line per missing part, and the stage on Xvfb."""

import os
import signal
import subprocess
import sys
import time

import pytest
from parts import needs

COMMAND = [sys.executable, "-m", "wavecomb", "view"]


def run(arguments, **environment):
    env = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    env.pop("QT_QPA_PLATFORM", None)
    return subprocess.run(
        [*COMMAND, *arguments], env=env | environment, capture_output=True, text=True, timeout=60
    )


def told(done):
    assert done.returncode == 2 and not done.stdout, done
    lines = done.stderr.strip().splitlines()
    assert len(lines) == 1 and lines[0].startswith("error: "), done.stderr
    return lines[0]


@pytest.mark.slow
def test_without_a_display():
    assert "no display to open a window on: set DISPLAY" in told(run([]))


@pytest.mark.slow
def test_with_a_display_that_does_not_answer():
    assert "no window can be opened" in told(run([], DISPLAY=":987"))


def test_without_the_extra(tmp_path):
    (tmp_path / "PySide6").mkdir()
    (tmp_path / "PySide6" / "__init__.py").write_text("raise ImportError('not here')\n")
    line = told(run([], PYTHONPATH=str(tmp_path)))
    assert "pip install 'PySide6-Essentials" in line


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--size", "0", "10"], "each edge must be from 1"),
        (["--spp", "0"], "samples per pixel"),
        (["--variant", "red"], "--variant red: must be"),
    ],
)
def test_bad_options(arguments, words):
    assert words in told(run(arguments, QT_QPA_PLATFORM="offscreen"))


@pytest.mark.slow
def test_a_signal_closes_it(cornell, tmp_path):
    env = os.environ | {"QT_QPA_PLATFORM": "offscreen", "XDG_CONFIG_HOME": str(tmp_path)}
    window = subprocess.Popen(
        [*COMMAND, str(cornell), "--size", "64", "64"], env=env, stderr=subprocess.PIPE, text=True
    )
    kept, until = tmp_path / "Wavecomb" / "Wavecomb.conf", time.monotonic() + 60
    while not (kept.exists() and "cornell.usda" in kept.read_text()):
        assert window.poll() is None and time.monotonic() < until
        time.sleep(0.1)
    window.send_signal(signal.SIGINT)
    assert window.wait(30) == 0
    assert window.stderr.read() == ""


SCRIPT = """
import sys
from pathlib import Path
from PySide6.QtCore import QPointF, QSettings, Qt
from PySide6.QtTest import QTest
from wavecomb.gui import theme
from wavecomb.gui.app import make_application
from wavecomb.gui.main_window import MainWindow
from wavecomb.gui.setup import Setup

application = make_application()
assert application.platformName() == "xcb", application.platformName()
theme.apply("dark")
settings = QSettings(sys.argv[2], QSettings.Format.IniFormat)
window = MainWindow(Setup(width=96, height=96, spp=4), settings)
window.show()

def wait_for(met):
    for _ in range(2000):
        if met():
            return True
        QTest.qWait(10)
    return False

assert QTest.qWaitForWindowExposed(window, 5000)
window.open(sys.argv[1])
session, viewport = window.session, window.viewport

def settled():
    frame = session.last_frame
    return frame is not None and frame.final and frame.version == session.version

assert wait_for(settled)
assert wait_for(lambda: viewport.frame_shown is session.last_frame)
ratio = viewport.devicePixelRatioF()
assert ratio == float(sys.argv[3]), ratio
viewport.set_zoom(1.0)
assert viewport.picture_rect().width() * ratio == 96, "a pixel of the picture is one of the screen"
viewport.setFocus()
before = session.pose
middle = viewport.rect().center()
QTest.mousePress(viewport, Qt.MouseButton.MiddleButton, Qt.KeyboardModifier.NoModifier, middle)
for k in range(8):
    QTest.mouseMove(viewport, middle + QPointF(5 * k, 0).toPoint())
    QTest.qWait(10)
QTest.mouseRelease(viewport, Qt.MouseButton.MiddleButton)
assert session.pose is not before and session.pose.path is None, "a drag orbits"
window.activateWindow()
assert wait_for(window.isActiveWindow), "no focus"
viewport.setFocus()
QTest.keyClick(viewport, Qt.Key.Key_0)
assert session.pose.path == "/World/Camera"
assert wait_for(settled)
place = viewport.mapTo(window, viewport.from_picture(QPointF(48.5, 80.5)).toPoint())

def lit():
    # The server shows a window some time after it was painted.
    picture = window.screen().grabWindow(window.winId()).toImage()
    colour = picture.pixelColor(round(place.x() * ratio), round(place.y() * ratio))
    return max(colour.getRgb()[:3]) > 20

assert wait_for(lit), "the floor is lit on the screen"
window.close()
print("seen")
"""


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1, 2])
@needs("bin:Xvfb")
def test_under_xvfb(cornell, tmp_path, scale):
    read, write = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), "-screen", "0", "1920x1400x24", "-nolisten", "tcp"],
        pass_fds=[write], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    os.close(write)
    try:
        with os.fdopen(read) as pipe:
            number = pipe.readline().strip()
        assert number, "Xvfb did not start"
        env = os.environ | {"DISPLAY": f":{number}", "QT_QPA_PLATFORM": "xcb"}
        env["QT_SCALE_FACTOR"] = str(scale)
        arguments = [str(cornell), str(tmp_path / "x.ini"), str(scale)]
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT, *arguments],
            env=env, capture_output=True, text=True, timeout=90,
        )  # fmt: skip
        assert done.stdout.strip() == "seen", done.stderr
    finally:
        server.terminate()
        server.wait(10)
