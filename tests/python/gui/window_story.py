# SPDX-License-Identifier: Apache-2.0
"""Opens, uses and closes a window without pytest, for tests of threads and garbage.

With the arguments ``STAGE FOLDER TIMES``, one thread collects garbage all the time, and every other
thread collects after every few allocations.
"""

import faulthandler
import gc
import os
import sys
import threading
import time
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
os.environ.setdefault("QT_LOGGING_RULES", "qt.qpa.*=false")

SECONDS = 120


def until(met, what):
    """Processes events until a condition is met."""
    from PySide6.QtTest import QTest

    end = time.monotonic() + SECONDS
    while not met():
        assert time.monotonic() < end, f"waited for {what}"
        QTest.qWait(2)


def settled(window):
    """Waits until nothing is read or written and the last image is displayed."""
    session = window.session

    def met():
        frame = session.last_frame
        whole = frame is not None and frame.final and frame.version == session.version
        return whole and not session._jobs and window.viewport.frame_shown is frame

    until(met, "the last picture")


def new_window(folder, qapp):
    from PySide6.QtCore import QSettings

    from wavecomb.gui import theme
    from wavecomb.gui.main_window import MainWindow
    from wavecomb.gui.setup import Setup

    theme.apply("dark")
    settings = QSettings(str(folder / "story.ini"), QSettings.Format.IniFormat)
    window = MainWindow(Setup(width=32, height=24, spp=2), settings)
    window.resize(900, 600)
    window.show()
    qapp.processEvents()
    return window


def use(window, stage, folder):
    """Loads a stage, navigates, edits, undoes, compares and saves; shows every dock and dialog."""
    from PySide6.QtCore import Qt
    from PySide6.QtTest import QTest

    window.open(stage)
    settled(window)
    for dock in window.docks.values():
        dock.show()
    session, scene = window.session, window.scene
    window.viewport.orbit(0.1, 0.05, moving=True)
    session.settle()
    for row in range(scene.materials.model.rowCount()):
        scene.materials.view.selectRow(row)
    for name in ("roughness", "base_color"):
        if name in scene.materials.fields:
            field = scene.materials.fields[name]
            spin = field.spin if hasattr(field, "spin") else field.spins[0]
            spin.setFocus()
            spin.selectAll()
            QTest.keyClicks(spin, "0.25")
            QTest.keyClick(spin, Qt.Key.Key_Return)
    scene.edits.set_light(scene.lights.model.rows[0], "exposure", 1.0)
    path = scene.lights.model.rows[0]
    scene.edits.set_visible([path], False)
    settled(window)
    scene.edits.undo()
    scene.edits.undo()
    scene.edits.redo()
    settled(window)
    session.select(path)
    QTest.keyClicks(scene.tree.field, "e")
    QTest.qWait(250)
    scene.tree.field.clear()
    assert scene.edits.save(str(folder / "edits.usda"))
    window.save_to(str(folder / "picture.exr"))
    window.save_to(str(folder / "picture.png"))
    settled(window)
    compare = window.docks["compare"].widget()
    compare.keep("A")
    compare.b.render(session.setup.changed(spp=1))
    until(lambda: compare.b.side is not None and not compare.busy, "the comparison")
    compare.a.exchange(compare.b)
    compare.b.follow()
    until(lambda: not compare.busy, "the comparison with the viewport")
    session.change(spp=3, policy="material")
    settled(window)
    window.show_shortcuts()
    window.show_about()
    window.set_theme("light")
    window.message.show_error("something")
    window.reload()
    settled(window)
    window.open(folder / "none.usda")
    until(lambda: "none.usda" in window.message.text(), "the error")


def end(window, qapp):
    """Closes the window and destroys it, as the application does at its end."""
    from wavecomb.gui.app import destroy

    window.close()
    destroy(window)
    qapp.processEvents()


def main():
    stage, folder, times = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
    faulthandler.dump_traceback_later(times * SECONDS, exit=True)
    from wavecomb.gui.app import make_application

    application = make_application()
    gc.set_threshold(300, 4, 4)
    going = True
    count = 0

    def collect():
        nonlocal count
        while going:
            gc.collect()
            count += 1
            time.sleep(0.02)

    thread = threading.Thread(target=collect)
    thread.start()
    for _ in range(times):
        window = new_window(folder, application)
        use(window, stage, folder)
        end(window, application)
        del window
    going = False
    thread.join()
    print(f"collected {count} times on another thread")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
