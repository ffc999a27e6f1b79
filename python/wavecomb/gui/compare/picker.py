# SPDX-License-Identifier: Apache-2.0
"""Bar that shows and selects the image source of one side of a comparison."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QPointF, Qt, Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import (
    QHBoxLayout,
    QLabel,
    QMenu,
    QSizePolicy,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from wavecomb.gui import theme
from wavecomb.gui.compare.live_pair import LiveSettings
from wavecomb.gui.compare.picture_sides import SUFFIXES
from wavecomb.gui.compare.source import LIVE, SideSource
from wavecomb.gui.widgets import TakesFiles, ask_file, set_text_colour, tool

if TYPE_CHECKING:
    from wavecomb.gui.viewport.session import Session


class SidePicker(TakesFiles, QWidget):
    """Bar with the name of side A or B and a menu of sources.

    Signals:
        dropped(list): Emitted when files are dropped on the bar, with their paths.
    """

    dropped = Signal(list)

    def __init__(self, source: SideSource, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.source = source
        self._session = session
        name = source.name
        self.setObjectName(f"side{name}")
        self.setAcceptDrops(True)
        self._button = tool(
            f"choose{name}", f"{name}  ", f"Choose the source of picture {name}", self
        )
        self._button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self._button.setMenu(self._menu())
        self._title = QLabel(self)
        self._title.setObjectName(f"title{name}")
        self._title.setTextFormat(Qt.TextFormat.PlainText)
        self._title.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self._note = QLabel(self)
        self._note.setObjectName(f"note{name}")
        self._note.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self._live = LiveSettings(source, self)
        words = QVBoxLayout()
        words.setSpacing(0)
        words.addWidget(self._title)
        words.addWidget(self._note)
        row = QHBoxLayout()
        row.addWidget(self._button, 0, Qt.AlignmentFlag.AlignTop)
        row.addLayout(words, 1)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addLayout(row)
        column.addWidget(self._live)
        column.addStretch(1)
        source.changed.connect(self._show)
        theme.on_change(self._show)
        self._show()

    def _menu(self) -> QMenu:
        menu = QMenu(self)
        menu.setToolTipsVisible(True)
        name = self.source.name
        for key, text, tip, call in (
            (
                "open",
                "Open a &file ...",
                "EXR with any layers, PNG, .npy of a results folder",
                self.ask,
            ),
            ("keep", "&Keep the viewport's picture", "Without later changes", self.source.keep),
            ("follow", "Follow the &viewport", "With all later changes", self.source.follow),
            (
                "render",
                "&Render with other settings",
                "Start a second live render of the same stage",
                self.render_other,
            ),
        ):
            action = QAction(text, self)
            action.setObjectName(f"{key}{name}")
            action.setToolTip(tip)
            action.triggered.connect(lambda checked=False, call=call: call())
            menu.addAction(action)
        return menu

    def ask(self) -> None:
        """Opens a file dialog that does not block the window."""
        patterns = " ".join(f"*{suffix}" for suffix in SUFFIXES)
        ask_file(
            self, f"Picture {self.source.name}", f"Pictures ({patterns})",
            lambda path: self.source.open(Path(path)),
        )  # fmt: skip

    def render_other(self) -> None:
        """Starts a separate render, whose initial settings are those of the viewport."""
        self.source.render(self._session.setup)

    def _show(self) -> None:
        side, source = self.source.side, self.source
        waiting = {"viewport": "viewport", LIVE: "live: rendering"}
        title = side.name if side is not None else waiting.get(source.kind, "nothing yet")
        note = side.note if side is not None else "open or drop a picture, or take the viewport's"
        self._title.setText(title)
        self._title.setToolTip(str(side.path) if side is not None and side.path else title)
        self._note.setText(note)
        self._note.setToolTip(note)
        set_text_colour(self._note, theme.dim())
        self._live.setVisible(source.live is not None)
        self._live.show_setup()

    def take_files(self, paths: list[str], at: QPointF) -> None:
        """Emits ``dropped`` for files that were dropped on the bar."""
        self.dropped.emit(paths)
