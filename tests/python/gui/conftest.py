# SPDX-License-Identifier: Apache-2.0
"""Fixtures for tests of the window without a screen. The environment variable QT_QPA_PLATFORM
overrides the platform "offscreen".
"""

import gc
import os

import pytest

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
os.environ.setdefault("QT_LOGGING_RULES", "qt.qpa.*=false")

pytest.importorskip("PySide6.QtWidgets", reason="the window needs the extra gui")
pytest.importorskip("pytestqt", reason="tests of the window need pytest-qt")


@pytest.fixture(scope="session")
def _modules():
    """Exempts imported modules from garbage collection, which runs after every test."""
    import wavecomb.gui.main_window  # noqa: F401

    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def _collected(qapp, _modules):
    """Destroys the garbage of each test after the test, on the window's thread.

    Tests create Qt objects without a window. Automatic collection would destroy reference cycles
    with such objects in a later test, on any thread that allocates, and may deadlock
    (docs/decisions/window-threads.md). test_threads.py checks, in separate processes in which all
    threads collect, that the window itself leaves no such cycles.
    """
    from PySide6.QtCore import QCoreApplication, QEvent

    if os.environ.get("WAVECOMB_ALONE"):
        yield
        return
    gc.disable()
    yield
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    gc.collect()
    gc.enable()


@pytest.fixture(autouse=True)
def _own_autosave(tmp_path, monkeypatch):
    """Keeps windows from finding unsaved edits of other tests."""
    monkeypatch.setattr("wavecomb.gui.main_window.log_folder", lambda: tmp_path / "state")


@pytest.fixture(scope="session")
def cornell(tmp_path_factory):
    """The Cornell box as a file."""
    from wavecomb.scenes import write_scene

    path = tmp_path_factory.mktemp("gui") / "cornell.usda"
    write_scene("cornell", path)
    return path


@pytest.fixture
def new_session(qtbot):
    """A function that makes sessions, which end with the test: new_session(width=96, ...)."""
    from wavecomb.gui.setup import Setup
    from wavecomb.gui.viewport.session import Session

    made = []

    def make(**values):
        session = Session(Setup(**values))
        made.append(session)
        return session

    yield make
    for session in made:
        session.shutdown()


@pytest.fixture
def window(qtbot, qapp, tmp_path):
    """An empty window with separate settings, for images of 96 x 96 pixels and 4 samples."""
    from PySide6.QtCore import QCoreApplication, QEvent, QSettings

    from wavecomb.gui import theme
    from wavecomb.gui.main_window import MainWindow
    from wavecomb.gui.setup import Setup

    theme.apply("dark")
    settings = QSettings(str(tmp_path / "window.ini"), QSettings.Format.IniFormat)
    made = MainWindow(Setup(width=96, height=96, spp=4), settings)
    made.resize(900, 600)
    made.show()
    qtbot.waitExposed(made)
    yield made
    made.close()
    made.deleteLater()
    # Delete old windows, which would otherwise process every change of the theme.
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)


@pytest.fixture
def cornell_window(window, qtbot, cornell):
    """A window with the Cornell box, rendered and displayed."""
    with qtbot.waitSignal(window.session.opened, timeout=10000):
        window.open(cornell)
    wait_final(qtbot, window.session)
    qtbot.waitUntil(lambda: window.viewport.frame_shown is window.session.last_frame)
    return window


@pytest.fixture
def session(new_session, qtbot, cornell):
    """A session with the Cornell box at 96 x 96 with 4 samples, rendered."""
    made = new_session(width=96, height=96, spp=4)
    with qtbot.waitSignal(made.opened, timeout=10000):
        made.open(cornell)
    wait_final(qtbot, made)
    return made


def wait_final(qtbot, session, timeout=20000):
    """Waits for the last frame of the session's current version and returns it."""

    def is_final():
        frame = session.last_frame
        return frame is not None and frame.final and frame.version == session.version

    qtbot.waitUntil(is_final, timeout=timeout)
    return session.last_frame


@pytest.fixture
def final(qtbot):
    """Returns ``wait_final`` as a function that needs only a session and no ``qtbot``."""
    return lambda session, timeout=20000: wait_final(qtbot, session, timeout)
