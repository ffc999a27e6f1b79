# SPDX-License-Identifier: Apache-2.0
"""Scene panel: tree of prims, materials, lights, and findings of the loader."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from pxr import Sdf, UsdShade
from PySide6.QtCore import Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import (
    QHBoxLayout,
    QLabel,
    QTabWidget,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from wavecomb.gui.actions import HistoryActions
from wavecomb.gui.scene.list_and_form import LightsPanel, MaterialsPanel
from wavecomb.gui.scene.notes_panel import NotesPanel
from wavecomb.gui.scene.scene_edits import SceneEdits
from wavecomb.gui.scene.scene_tree import SceneTree
from wavecomb.gui.scene.variants import VariantBar
from wavecomb.gui.widgets import ask_file

if TYPE_CHECKING:
    from wavecomb.gui.viewport.session import Session
    from wavecomb.usd import LoadedStage


class ScenePanel(QWidget):
    """Panel with tabs for the stage's contents. The selection is synchronised with the session.

    Signals:
        selected(str): A prim was selected, in any panel or in the image.
        frame_wanted(): The user pressed F in the tree, so that the camera should frame the selected
            prims.
    """

    selected = Signal(str)
    frame_wanted = Signal()

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.session = session
        self.edits = SceneEdits(session, self)
        self.tree = SceneTree(self.edits)
        self.variants = VariantBar(self.edits)
        self.materials = MaterialsPanel(self.edits)
        self.lights = LightsPanel(self.edits)
        self.notes = NotesPanel(session)
        # Stage file and edit file of the last save.
        self._layer: tuple[Path | None, str] | None = None
        self.tabs = QTabWidget()
        self.tabs.setObjectName("scene-tabs")
        self.tabs.setDocumentMode(True)
        stage = QWidget()
        column = QVBoxLayout(stage)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.tree, 1)
        column.addWidget(self.variants)
        for widget, name, tip in (
            (stage, "Stage", "Prims: visibility and variants"),
            (self.materials, "Materials", "Materials in use and their parameters"),
            (self.lights, "Lights", "Lights: on, alone, intensity and colour"),
            (self.notes, "Notes", "What is not supported, and other findings"),
        ):
            number = self.tabs.addTab(widget, name)
            self.tabs.setTabToolTip(number, tip)
        self._make_actions()
        self.state = QLabel()
        self.state.setObjectName("scene-edits")
        bottom = QHBoxLayout()
        for action in (self.undo_action, self.redo_action, self.save_action):
            button = QToolButton()
            button.setDefaultAction(action)
            button.setAutoRaise(True)
            bottom.addWidget(button)
        bottom.addWidget(self.state, 1)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.tabs, 1)
        layout.addLayout(bottom)
        self.tree.view.frame_wanted.connect(self.frame_wanted)
        self.edits.changed.connect(self._on_changed)
        HistoryActions(self.edits.history.stack, self.undo_action, self.redo_action, self)
        session.selected.connect(self._on_selected)
        session.opened.connect(self._on_opened)
        session.noted.connect(lambda stage: self._count_notes())
        self._on_changed()
        self._count_notes()

    def shutdown(self) -> None:
        """Clears the undo history, because Qt destroys the undo stack before Python's objects."""
        self.edits.history.clear()

    def _make_actions(self) -> None:
        # These actions have no shortcuts, because the menus of the window define them.
        self.undo_action = self._action("Undo", self.edits.undo)
        self.redo_action = self._action("Redo", self.edits.redo)
        self.save_action = self._action("Save edits as layer\u2026", self.ask_save)
        self.save_action.setToolTip("Writes the edits as a small .usda file over the stage")

    def _action(self, name: str, call: Callable[[], None]) -> QAction:
        action = QAction(name, self)
        action.setIconText(name.partition(" ")[0])
        action.setObjectName(name.rstrip("\u2026").lower().replace(" ", "-"))
        action.triggered.connect(lambda checked=False: call())
        return action

    # ---- edits ---------------------------------------------------------------------------------

    def save(self) -> None:
        """Saves the edits to the layer of the previous save.

        Asks for a file before the first save.
        """
        if self._layer and self._layer[0] == self.session.path:
            self.edits.save(self._layer[1])
        else:
            self.ask_save()

    def _save_to(self, path: str) -> None:
        if self.edits.save(path):
            self._layer = self.session.path, path

    def ask_save(self) -> None:
        """Asks for a file name and saves the edits to this file."""
        stage = self.session.stage
        start = ""
        if stage is not None:
            start = str(stage.stage_path.with_name(f"{stage.stage_path.stem}_edits.usda"))
        kinds, save = "USD text (*.usda)", self._save_to
        ask_file(self, "Save edits as layer", kinds, save, start=start, ending="usda")

    def _on_changed(self) -> None:
        lines = self.edits.lines()
        self.save_action.setEnabled(bool(lines))
        self.state.setText(f"{len(lines)} edited" if lines else "")
        shown = lines[:30] + ([f"and {len(lines) - 30} more"] if len(lines) > 30 else [])
        self.state.setToolTip("\n".join(shown))

    def select_parent(self) -> None:
        """Selects the parent of the selected prim, unless the parent is the root of the stage."""
        if parent := (self.session.selection or "").rpartition("/")[0]:
            self.session.select(parent)

    def show_notes(self) -> None:
        """Shows the findings of the loader."""
        self.tabs.setCurrentWidget(self.notes)

    # ---- what is selected ----------------------------------------------------------------------

    def _on_selected(self, path: str | None) -> None:
        plain = (path or "").partition("[")[0].rstrip("/")
        self.variants.show_prim(plain or None)
        prim = self.edits.prim(plain)
        if not prim:
            return
        self.lights.choose(plain)
        if prim.IsA(UsdShade.Material):
            self.materials.choose(plain)
        elif prim.IsA(UsdShade.Shader):
            self.materials.choose(str(prim.GetParent().GetPath()))
        else:
            bound = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
            if bound:
                self.materials.choose(str(bound.GetPath()))
        self.selected.emit(plain)

    def _on_opened(self, stage: LoadedStage | None) -> None:
        self._count_notes()
        self.variants.show_prim(self.variants_path())

    def variants_path(self) -> str | None:
        """Returns the prim whose variant sets are shown, or None."""
        path = (self.session.selection or "").partition("[")[0]
        return path if path and Sdf.Path.IsValidPathString(path) else None

    def _count_notes(self) -> None:
        count = sum(row.kind != "note" for row in self.notes.model.rows)
        self.tabs.setTabText(
            self.tabs.indexOf(self.notes), f"Notes ({count})" if count else "Notes"
        )
