# SPDX-License-Identifier: Apache-2.0
"""The main window, which contains the viewport, tool bars and panels."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from PySide6.QtCore import QByteArray, QPointF, QSettings, QSize, Qt, QTimer
from PySide6.QtGui import QCloseEvent, QResizeEvent
from PySide6.QtWidgets import (
    QDockWidget,
    QFileDialog,
    QMainWindow,
    QVBoxLayout,
    QWidget,
)

from wavecomb.gui import theme
from wavecomb.gui.actions import HistoryActions, UnsavedMark
from wavecomb.gui.menus import CHECKED, make_menus
from wavecomb.gui.messages import MessageBar, log_folder
from wavecomb.gui.panels import keep_half, make_panels
from wavecomb.gui.scene.autosave import Autosave, make_question
from wavecomb.gui.scene.notes_model import WARNING
from wavecomb.gui.scene.scene_panel import ScenePanel
from wavecomb.gui.shortcuts import ShortcutsDialog, make_about
from wavecomb.gui.status import StatusLine
from wavecomb.gui.viewport.gizmo import Gizmo
from wavecomb.gui.viewport.panels.display_bar import DisplayBar
from wavecomb.gui.viewport.panels.inspector import Inspector
from wavecomb.gui.viewport.panels.learned_panel import LearnedPanel
from wavecomb.gui.viewport.panels.render_bar import RenderBar
from wavecomb.gui.viewport.panels.timeline import Timeline
from wavecomb.gui.viewport.session import Session, Setup
from wavecomb.gui.viewport.view_history import ViewHistory
from wavecomb.gui.viewport.viewport import Viewport
from wavecomb.gui.widgets import TakesFiles, ask_file

ENDINGS = (".usd", ".usda", ".usdc", ".usdz")
_STATE_VERSION = 1


class MainWindow(TakesFiles, QMainWindow):
    """The window of `wavecomb view`.

    Args:
        setup: Initial render settings.
        settings: Storage for the window's state; None means the user's Qt settings.
    """

    def __init__(self, setup: Setup | None = None, settings: QSettings | None = None) -> None:
        super().__init__()
        self.setObjectName("window")
        self.settings = settings or QSettings("Wavecomb", "Wavecomb", self)
        self.session = Session(setup, self)
        self.viewport = Viewport(self.session)
        self.message = MessageBar()
        self.findings = MessageBar("findings")
        self.display = DisplayBar(self.session, self.viewport)
        self.timeline = Timeline(self.session)
        self.render_bar = RenderBar(self.session, self)
        self.inspector = Inspector(self.session)
        self.status = StatusLine(self.session, self)
        self.views = ViewHistory(self.session, self)
        self.docks: dict[str, QDockWidget] = {}
        self._bottom_sized = False
        self._dialog: QWidget | None = None
        self._lay_out()
        self.viewport.gizmo = Gizmo(self.viewport, self.session, self.scene.edits)
        self.actions_by_name, self._recent = make_menus(self)
        for name in ("pause", "stop", "restart", "region", "clear_region"):
            self.render_bar.addAction(self.actions_by_name[name])
        self._connect()
        self._restore()
        self._retitle()

    # ---- parts -----------------------------------------------------------------------------------

    def _lay_out(self) -> None:
        centre = QWidget()
        column = QVBoxLayout(centre)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        over = QVBoxLayout(self.viewport)
        over.setContentsMargins(0, 0, 0, 0)
        over.addWidget(self.message)
        over.addWidget(self.findings)
        over.addStretch(1)
        column.addWidget(self.viewport, 1)
        column.addWidget(self.timeline)
        column.addWidget(self.display)
        self.setCentralWidget(centre)
        self.addToolBar(Qt.ToolBarArea.TopToolBarArea, self.render_bar)
        self.setStatusBar(self.status)
        self.setDockNestingEnabled(True)
        self.setAcceptDrops(True)
        self.resize(self._room(theme.em(100), theme.em(60)))
        areas = Qt.DockWidgetArea
        self.setCorner(Qt.Corner.BottomLeftCorner, areas.LeftDockWidgetArea)
        self.setCorner(Qt.Corner.BottomRightCorner, areas.RightDockWidgetArea)
        right = Qt.DockWidgetArea.RightDockWidgetArea
        self._add_dock("inspector", "Pixel", self.inspector, right)
        for panel in make_panels(self.session):
            dock = self._add_dock(
                panel.name, panel.title, panel.widget, panel.area, hidden=panel.hidden
            )
            if panel.area == Qt.DockWidgetArea.BottomDockWidgetArea:
                dock.visibilityChanged.connect(self._size_bottom)
        self.docks["render"].raise_()
        sides = [self.docks["scene"], self.docks["render"]]
        self.resizeDocks(sides, [theme.em(22), theme.em(20)], Qt.Orientation.Horizontal)
        self._sizing = QTimer(self, singleShot=True, interval=0)
        self._sizing.timeout.connect(self._share_width)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Divides the window's width so that the image gets half of it."""
        super().resizeEvent(event)
        self._sizing.start()

    def _share_width(self) -> None:
        keep_half(self, self.viewport, self.docks.values())

    def _room(self, wide: int, high: int) -> QSize:
        """Limits a size to the screen, minus some space for the window frame."""
        there = self.screen().availableGeometry().size()
        return QSize(
            min(wide, there.width() - theme.em(0.5)), min(high, there.height() - theme.em(2.5))
        )

    def _add_dock(
        self,
        name: str,
        title: str,
        widget: QWidget,
        area: Qt.DockWidgetArea,
        *,
        hidden: bool = False,
    ) -> QDockWidget:
        dock = QDockWidget(title, self)
        dock.setObjectName(f"dock.{name}")
        dock.setWidget(widget)
        dock.setHidden(hidden)
        others = [d for d in self.docks.values() if self.dockWidgetArea(d) == area]
        self.addDockWidget(area, dock)
        if others:
            self.tabifyDockWidget(others[0], dock)
            if not others[0].isHidden():
                others[0].raise_()
        self.docks[name] = dock
        return dock

    def _size_bottom(self, visible: bool) -> None:
        """Limits the height of a panel below the image when the panel first becomes visible."""
        if visible and not self._bottom_sized:
            self._bottom_sized = True
            shown = [dock for dock in self.docks.values() if dock is self.sender()]
            high = round(0.42 * self.height())
            QTimer.singleShot(
                0, self, lambda: self.resizeDocks(shown, [high], Qt.Orientation.Vertical)
            )

    @property
    def scene(self) -> ScenePanel:
        """The scene panel."""
        panel = self.docks["scene"].widget()
        assert isinstance(panel, ScenePanel)
        return panel

    def _connect(self) -> None:
        session, viewport = self.session, self.viewport
        self.scene.frame_wanted.connect(viewport.frame_selected)
        for told in (session.failed, viewport.failed):
            told.connect(self.message.show_error)
        session.warned.connect(self.message.show_warning)
        for told in (session.opened, session.noted):
            told.connect(lambda stage: self._tell_findings())
        self.findings.details.connect(self.scene.show_notes)
        session.opened.connect(lambda stage: self._opened())
        session.busy.connect(self._busy)
        session.state_changed.connect(self._state_changed)
        session.setup_changed.connect(self._setup_changed)
        session.saved.connect(lambda path: self.status.showMessage(f"wrote {path}", 5000))
        learned = self.docks["learned"].widget()
        assert isinstance(learned, LearnedPanel)
        for panel in (self.inspector, learned):
            viewport.hovered.connect(panel.hover)
            viewport.picked.connect(panel.pick)
        viewport.region_mode_changed.connect(self.actions_by_name["region"].setChecked)
        actions, edits = self.actions_by_name, self.scene.edits.history.stack
        HistoryActions(edits, actions["undo"], actions["redo"], self)
        HistoryActions(self.views.stack, actions["view_back"], actions["view_forth"], self)
        UnsavedMark(edits, self)
        self.autosave = Autosave(self.scene.edits, log_folder() / "autosave", self)
        self.autosave.found.connect(lambda: self._show(make_question(self.autosave, self)))
        self._state_changed(session.state)
        self._setup_changed(session.setup)

    # ---- stages ----------------------------------------------------------------------------------

    def open(
        self,
        path: str | os.PathLike[str],
        camera: str | None = None,
        time: float | None = None,
        variants: Mapping[str, str] | None = None,
        purposes: tuple[str, ...] | None = None,
    ) -> None:
        """Opens a stage."""
        self.message.hide()
        self.session.open(path, camera, time, variants, purposes)

    def ask_open(self) -> None:
        """Opens a dialog to choose a stage."""
        folder = str(self.session.path.parent) if self.session.path is not None else ""
        kinds = " ".join(f"*{ending}" for ending in ENDINGS)
        ask_file(self, "Open a stage", f"USD ({kinds})", self.open, start=folder)

    def reload(self) -> None:
        """Reloads the stage from disk."""
        self.message.hide()
        self.session.reload()

    def recent(self) -> list[str]:
        """Returns the recently opened files, the latest first."""
        return self._recent.names()

    def _opened(self) -> None:
        path = self.session.path
        if path is not None:
            self._recent.add(path)
        self._retitle()

    def _tell_findings(self) -> None:
        rows = self.scene.notes.model.rows
        self.findings.show_findings([f"{r.what}: {r.place}" for r in rows if r.kind == WARNING])

    def _retitle(self) -> None:
        path = self.session.path
        self.setWindowTitle("Wavecomb" if path is None else f"{path.name}[*] \u2014 Wavecomb")

    def _busy(self, what: str) -> None:
        if self.session.stage is None:
            self.viewport.set_message(f"{what} \u2026" if what else "")
            if not what:
                self.viewport.set_message()

    def takes(self, path: str) -> bool:
        """Returns whether a file is a USD stage, by its extension."""
        return path.lower().endswith(ENDINGS)

    def take_files(self, paths: list[str], at: QPointF) -> None:
        """Opens the first stage among the dropped files."""
        self.open(paths[0])

    # ---- the picture -----------------------------------------------------------------------------

    def save_as(self) -> None:
        """Opens a dialog to choose an image file for saving the render."""
        path = self.session.path
        start = str(path.with_suffix(".exr")) if path is not None else "picture.exr"
        name, chosen = QFileDialog.getSaveFileName(
            self, "Save the picture", start, "OpenEXR, all layers (*.exr);;PNG, as shown (*.png)"
        )
        if name:
            if not Path(name).suffix:
                name += ".png" if "png" in chosen else ".exr"
            self.save_to(name)

    def save_to(self, path: str) -> None:
        """The dialog saves .exr files (all layers) or .png files (the displayed image)."""
        self.session.save(path, self.viewport.look)

    def toggle_pause(self) -> None:
        """Pauses, resumes or restarts the render."""
        if self.session.state == "rendering":
            self.session.pause()
        else:
            self.session.resume()

    def fit_size(self) -> None:
        """Sets the render size to the viewport's size in screen pixels."""
        ratio = self.viewport.devicePixelRatioF()
        wide, high = self.viewport.width() * ratio, self.viewport.height() * ratio
        self.session.change(width=round(wide), height=round(high))
        self.viewport.set_zoom(None)

    def look_through_camera(self) -> None:
        """Views the stage through its default camera."""
        stage = self.session.stage
        if stage is not None and (stage.camera_path or stage.cameras):
            self.session.use_camera(stage.camera_path or stage.cameras[0])

    def _state_changed(self, state: str) -> None:
        pause = self.actions_by_name["pause"]
        pause.setText({"paused": "&Continue", "stopped": "&Continue"}.get(state, "&Pause"))
        pause.setEnabled(state in ("rendering", "paused", "stopped"))
        self.actions_by_name["stop"].setEnabled(state in ("rendering", "paused"))
        self.actions_by_name["restart"].setEnabled(self.session.stage is not None)

    def _setup_changed(self, setup: Setup) -> None:
        self.actions_by_name["clear_region"].setEnabled(setup.region is not None)

    # ---- help, colours, state --------------------------------------------------------------------

    def set_theme(self, choice: str) -> None:
        """Sets a dark theme, a light theme, or the theme of the system."""
        theme.apply(choice)
        self.settings.setValue("theme", choice)

    def show_shortcuts(self) -> None:
        """Shows the list of keyboard shortcuts."""
        self._open_dialog(ShortcutsDialog(self))

    def show_about(self) -> None:
        """Shows the versions of Wavecomb and its libraries."""
        self._open_dialog(make_about(self))

    def send_to_farm(self) -> None:
        """Opens the dialog for render farm jobs."""
        from wavecomb.gui.farm_dialog import FarmDialog

        path = self.session.path
        if path is None:
            self.message.show_error("there is no stage: open one first")
            return
        self._open_dialog(FarmDialog(self._farm_job, str(path.with_suffix(".exr")), self))

    def _farm_job(self, output: str) -> dict[str, Any]:
        """Describes a farm job for the displayed stage. Saves the stage's edits beside the image.

        Raises:
            WavecombError: No stage is open, or the edits of the stage cannot be saved.
        """
        from wavecomb.gui.farm_job import describe

        return describe(self.session, self.scene.edits.edits, output)

    def _open_dialog(self, dialog: QWidget) -> None:
        if self._dialog is not None:
            self._dialog.close()
        self._dialog = dialog
        dialog.destroyed.connect(self._dialog_gone)
        self._show(dialog)

    def _show(self, dialog: QWidget) -> None:
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.show()

    def _dialog_gone(self) -> None:
        self._dialog = None

    def show_compare(self) -> None:
        """Shows the window that compares two images."""
        dock = self.docks["compare"]
        if not self._bottom_sized and dock.isHidden():
            dock.setFloating(True)
            dock.resize(round(0.8 * self.width()), round(0.8 * self.height()))
            dock.move(self.frameGeometry().center() - dock.rect().center())
        dock.show()
        dock.raise_()
        dock.activateWindow()

    def toggle_full_screen(self) -> None:
        """Toggles full screen mode."""
        self.setWindowState(self.windowState() ^ Qt.WindowState.WindowFullScreen)

    def reset_layout(self) -> None:
        """Restores the initial layout of all panels."""
        self.restoreState(self._first_state, _STATE_VERSION)

    def _restore(self) -> None:
        self._first_state = self.saveState(_STATE_VERSION)
        geometry, state = self.settings.value("geometry"), self.settings.value("state")
        if isinstance(geometry, QByteArray):
            self.restoreGeometry(geometry)
        if isinstance(state, QByteArray):
            self._bottom_sized = True
            self.restoreState(state, _STATE_VERSION)
        self.display.restore(self.settings)
        for name in CHECKED:
            self.actions_by_name[name].setChecked(False)

    def closeEvent(self, event: QCloseEvent) -> None:
        """Saves the window's state and ends the window's threads when the window closes."""
        self.autosave.close()
        self.settings.setValue("geometry", self.saveGeometry())
        self.settings.setValue("state", self.saveState(_STATE_VERSION))
        self.display.keep(self.settings)
        for dock in self.docks.values():
            close = getattr(dock.widget(), "shutdown", None)
            if close is not None:
                close()
        self.views.stack.clear()
        self.viewport.close_threads()
        self.session.shutdown()
        super().closeEvent(event)
