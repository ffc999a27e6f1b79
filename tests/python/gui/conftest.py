# SPDX-License-Identifier: Apache-2.0
"""Windows without a screen. QT_QPA_PLATFORM chooses another platform than offscreen."""

import gc
import os

import pytest

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
os.environ.setdefault("QT_LOGGING_RULES", "qt.qpa.*=false")

pytest.importorskip("PySide6.QtWidgets", reason="the window needs the extra gui")
pytest.importorskip("pytestqt", reason="tests of the window need pytest-qt")


@pytest.fixture(scope="session")
def _modules():
    """What is imported is no garbage: the collector need not look at it after every test."""
    import wavecomb.gui.main_window  # noqa: F401

    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def _collected(qapp, _modules):
    """What a test leaves behind is destroyed after it, on the window's thread.

    Tests make objects of Qt's with no window round them. Automatic collection would destroy those
    that are in cycles on any thread that makes an object, in a later test, which may never end
    (docs/decisions/window-threads.md). That nothing of the window's own is so is for
    test_threads.py to show, in processes of their own in which all threads collect.
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
    """No window finds the unsaved edits of another test."""
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
    """Makes sessions that are ended with the test: new_session(width=96, ...)."""
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
    """An empty window with settings of its own, 96 x 96 pixels and 4 samples."""
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
    # Not by itself between tests, and each change of colours would go through all old windows.
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)


@pytest.fixture
def cornell_window(window, qtbot, cornell):
    """The window with the Cornell box, rendered and on the screen."""
    with qtbot.waitSignal(window.session.opened, timeout=10000):
        window.open(cornell)
    wait_final(qtbot, window.session)
    qtbot.waitUntil(lambda: window.viewport.frame_shown is window.session.last_frame)
    return window


@pytest.fixture
def session(new_session, qtbot, cornell):
    """Cornell at 96 x 96 with 4 samples, opened and shown to the end."""
    made = new_session(width=96, height=96, spp=4)
    with qtbot.waitSignal(made.opened, timeout=10000):
        made.open(cornell)
    wait_final(qtbot, made)
    return made


def wait_final(qtbot, session, timeout=20000):
    """Waits for the last frame of the session's present version; returns it."""

    def is_final():
        frame = session.last_frame
        return frame is not None and frame.final and frame.version == session.version

    qtbot.waitUntil(is_final, timeout=timeout)
    return session.last_frame


@pytest.fixture
def final(qtbot):
    """wait_final(session) without the bot."""
    return lambda session, timeout=20000: wait_final(qtbot, session, timeout)
