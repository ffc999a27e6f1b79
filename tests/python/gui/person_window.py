# SPDX-License-Identifier: Apache-2.0
"""Runs `wavecomb view` and reports the positions and texts of its widgets.

Run as `person_window.py FD view ...`. Reads questions as JSON lines from stdin and writes answers
to the file descriptor FD. The program never controls the window: all input comes from the X server.
"""

import json
import os
import sys

from PySide6.QtCore import QPoint, QRect, QSocketNotifier
from PySide6.QtWidgets import QApplication, QMenu, QWidget


def on_screen(widget, rect=None):
    """Returns x, y, width and height in screen coordinates."""
    rect = widget.rect() if rect is None else rect
    corner = widget.mapToGlobal(rect.topLeft())
    return [corner.x(), corner.y(), rect.width(), rect.height()]


class Look:
    """Answers questions about the window."""

    def __init__(self, window):
        self.window = window
        self.scene = window.scene

    def state(self):
        window, session, edits = self.window, self.window.session, self.scene.edits
        frame = session.last_frame
        usd_message = window.message.text()
        active = QApplication.activeWindow()
        return {
            "open": str(session.path) if session.stage is not None else None,
            "busy": [what for _, what in session._jobs],
            "state": session.state,
            "version": session.version,
            "final": frame is not None and frame.final and frame.version == session.version,
            "shown": frame is not None and window.viewport.frame_shown is frame,
            "message": usd_message,
            "camera": None if session.pose is None else session.pose.path,
            "pose": None if session.pose is None else session.pose.to_world.tolist(),
            "selection": session.selection,
            "edits": edits.lines(),
            "undo": edits.can_undo(),
            "active": None if active is None else active.objectName() or type(active).__name__,
            "notes": [row.line() for row in self.scene.notes.model.rows],
            "compare": window.docks["compare"].isVisible(),
            "status": window.status.currentMessage(),
            "popup": QApplication.activePopupWidget() is not None,
        }

    def widget(self, name):
        found = [w for w in self.window.findChildren(QWidget, name) if w.isVisible()]
        return on_screen(found[0]) if found else None

    def cross(self, dock):
        """Returns the position of a panel's close button."""
        buttons = self.window.docks[dock].findChildren(QWidget, "qt_dockwidget_closebutton")
        return on_screen(buttons[0]) if buttons and buttons[0].isVisible() else None

    def window_on_screen(self):
        """Returns the window with its frame, and the screen."""
        frame, whole = self.window.frameGeometry(), self.window.screen().geometry()
        return [[r.x(), r.y(), r.width(), r.height()] for r in (frame, whole)]

    def tab(self, name):
        bar = self.scene.tabs.tabBar()
        for i in range(bar.count()):
            if bar.tabText(i).startswith(name):
                return on_screen(bar, bar.tabRect(i))
        return None

    def materials(self):
        """Returns the paths of the materials."""
        return [row.path for row in self.scene.materials.model.rows]

    def material(self, path):
        panel = self.scene.materials
        for number, row in enumerate(panel.model.rows):
            if row.path == path:
                index = panel.model.index(number, 0)
                rect = panel.view.visualRect(index)
                if panel.view.viewport().rect().contains(rect.center()):
                    return on_screen(panel.view.viewport(), rect)
        return None

    def numbers(self):
        """Returns name, position and text of the visible numeric fields of the chosen material."""
        panel = self.scene.materials
        port = panel.form.viewport()
        out = []
        for name, field in panel.fields.items():
            spin = getattr(field, "spin", None)
            if spin is not None and spin.isVisible() and spin.isEnabled():
                edit = spin.lineEdit()
                rect = QRect(edit.mapTo(port, QPoint(0, 0)), edit.size())
                if port.rect().contains(rect):
                    out.append([name, on_screen(edit), spin.text()])
        return out

    def menu(self, *names):
        """Returns the position of a menu title, or of an entry in the open menu."""
        bar = self.window.menuBar()
        wanted = names[-1]
        where = QApplication.activePopupWidget() if len(names) > 1 else bar
        if where is None or (len(names) > 1 and not isinstance(where, QMenu)):
            return None
        for action in where.actions():
            if action.text().replace("&", "").rstrip("\u2026") == wanted:
                return on_screen(where, where.actionGeometry(action))
        return None

    def focus(self):
        widget = QApplication.focusWidget()
        return None if widget is None else [type(widget).__name__, widget.objectName()]

    def field(self):
        """Returns the text of the field that has the focus."""
        widget = QApplication.focusWidget()
        return widget.text() if hasattr(widget, "text") else None

    def handles(self):
        """Returns the ends of the handles of the selection on the screen, by name."""
        view = self.window.viewport
        corner = view.mapToGlobal(QPoint(0, 0))
        found = view.gizmo.handles().items()
        return {name: [corner.x() + line[-1][0], corner.y() + line[-1][1]] for name, line in found}

    def frame(self):
        """Returns the frame that the timeline shows and the frame of the loaded scene."""
        return [self.window.timeline.frame.value(), self.window.session.stage.frame]

    def widths(self):
        """Returns the widths of the window and of the area of the image."""
        return [self.window.width(), self.window.viewport.width()]

    def picture(self):
        """Returns the position of the image on the screen."""
        port = self.window.viewport
        rect = port.picture_rect().toAlignedRect().intersected(port.rect())
        return on_screen(port, rect)

    def grab(self, path):
        """Saves a screenshot as a PNG."""
        return QApplication.primaryScreen().grabWindow(0).save(path)


def answer(window, fd):
    """Answers questions from stdin."""
    look = Look(window)
    rest = [""]

    def read():
        text = os.read(0, 65536).decode()
        *lines, rest[0] = (rest[0] + text).split("\n")
        if not text:
            notifier.setEnabled(False)
        for line in lines:
            name, *arguments = json.loads(line)
            said = json.dumps(getattr(look, name)(*arguments))
            os.write(fd, (said + "\n").encode())

    notifier = QSocketNotifier(0, QSocketNotifier.Type.Read, window)
    notifier.activated.connect(read)


def main():
    from wavecomb.gui import main_window

    fd = int(sys.argv.pop(1))
    init = main_window.MainWindow.__init__

    def watched(self, *arguments, **more):
        init(self, *arguments, **more)
        answer(self, fd)

    main_window.MainWindow.__init__ = watched
    from wavecomb.cli import main as wavecomb

    sys.argv[0] = "wavecomb"
    wavecomb()


if __name__ == "__main__":
    main()
