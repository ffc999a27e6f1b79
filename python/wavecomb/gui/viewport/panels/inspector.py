# SPDX-License-Identifier: Apache-2.0
"""Panel with data of one pixel: layer values, visible object and cost."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QApplication,
    QHeaderView,
    QPushButton,
    QTreeWidget,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from wavecomb.gui import theme
from wavecomb.gui.viewport.frames import Frame
from wavecomb.gui.viewport.panels.cursor_panel import CursorPanel
from wavecomb.gui.viewport.session import Session
from wavecomb.gui.widgets import named
from wavecomb.image.rendered import NOWHERE, in_world

_LATER_MS = 30
_SEEN = (
    ("object", "prim"),
    ("material_name", "material"),
    ("light", "light"),
    ("instance", "instance"),
    ("asset", "asset"),
    ("distance", "distance"),
    ("position", "position"),
    ("normal", "normal"),
    ("uv", "uv"),
)


def value_text(value: Any) -> str:
    """Formats a number, several numbers or a name for display.

    >>> value_text(0.25), value_text((1.0, 0.5, 2e-7)), value_text(3)
    ('0.25', '1  0.5  2e-07', '3')
    """
    if isinstance(value, str):
        return value
    numbers = np.asarray(value).reshape(-1)
    if numbers.dtype.kind in "iub":
        return "  ".join(str(int(n)) for n in numbers)
    return "  ".join(f"{float(n):.4g}" for n in numbers)


def pixel_rows(
    frame: Frame, x: int, y: int, origin: Sequence[float] = NOWHERE
) -> list[tuple[str, str]]:
    """Returns the name and value of each layer of a frame at a pixel of the full-size image.

    ``origin`` is the world position of the scene's origin.
    """
    column, row = frame.pixel(x, y)
    rows = []
    for name in frame.names():
        array = frame.layer(name)
        if array is not None:
            value = array[row, column]
            value = in_world({name: value}, origin)[name]
            rows.append((name, value_text(value)))
    return rows


def seen_rows(hit: dict[str, Any] | None, origin: Sequence[float]) -> list[tuple[str, str]]:
    """Returns the names and values that ``Session.pick`` has found, in world space."""
    if hit is None:
        return [("prim", "nothing")]
    if hit.get("position") is not None:
        hit = {**hit, "position": np.add(hit["position"], origin)}
    return [(label, value_text(hit[key])) for key, label in _SEEN if hit.get(key) is not None]


class Inspector(CursorPanel):
    """Panel that shows the pixel under the cursor, or the pixel that was clicked."""

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(session, "inspector", _LATER_MS, parent)
        self.tree = QTreeWidget()
        self.tree.setObjectName("inspector.values")
        self.tree.setAccessibleName("Pixel values")
        self.tree.setColumnCount(2)
        self.tree.setHeaderHidden(True)
        self.tree.setAlternatingRowColors(True)
        self.tree.setUniformRowHeights(True)
        self.tree.setTextElideMode(Qt.TextElideMode.ElideMiddle)
        header = self.tree.header()
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.ResizeToContents)
        self.follow.setToolTip("Off: keep the values of the last clicked pixel")
        self.follow.setAccessibleName("Follow the cursor")
        self.copy = named(
            QPushButton("Copy"),
            "inspector.copy",
            "Copy the values",
            "Copy these values to the clipboard as text",
        )
        self.copy.clicked.connect(self._copy)
        layout = QVBoxLayout(self)
        margin = theme.em(0.3)
        layout.setContentsMargins(margin, margin, margin, margin)
        layout.addWidget(self.tree, 1)
        layout.addWidget(self.follow)
        layout.addWidget(self.copy)

    def rows(self) -> list[tuple[str, str]]:
        """Returns all shown names and values, group by group."""
        return [
            (item.text(0), item.text(1))
            for i in range(self.tree.topLevelItemCount())
            if (group := self.tree.topLevelItem(i)) is not None
            for item in [group.child(k) for k in range(group.childCount())]
        ]

    def _fill(self) -> None:
        frame = self._session.last_frame
        if frame is None or self._pixel is None:
            return
        setup = frame.setup
        x, y = min(self._pixel[0], setup.width - 1), min(self._pixel[1], setup.height - 1)
        hit = self._session.pick(x + 0.5, y + 0.5)
        stage = self._session.stage
        origin = NOWHERE if stage is None else stage.origin
        groups = [
            (f"pixel {x}, {y}", pixel_rows(frame, x, y, origin)),
            ("seen there", seen_rows(hit, origin)),
        ]
        if self.tree.topLevelItemCount() != len(groups):
            self.tree.clear()
            for title, _ in groups:
                top = QTreeWidgetItem([title, ""])
                self.tree.addTopLevelItem(top)
                top.setFirstColumnSpanned(True)
                top.setExpanded(True)
        for i, (title, rows) in enumerate(groups):
            group: Any = self.tree.topLevelItem(i)
            group.setText(0, title)
            while group.childCount() > len(rows):
                group.takeChild(group.childCount() - 1)
            while group.childCount() < len(rows):
                group.addChild(QTreeWidgetItem())
            for k, (name, text) in enumerate(rows):
                item = group.child(k)
                item.setText(0, name)
                item.setText(1, text)
                item.setToolTip(1, text)

    def _copy(self) -> None:
        lines = [f"{name}\t{text}" for name, text in self.rows()]
        QApplication.clipboard().setText("\n".join(lines))
