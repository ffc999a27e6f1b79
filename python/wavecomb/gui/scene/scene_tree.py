# SPDX-License-Identifier: Apache-2.0
"""Tree view of a stage's prims with their visibility and variants."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

from pxr import Sdf, UsdGeom
from PySide6.QtCore import (
    QModelIndex,
    QPersistentModelIndex,
    QPoint,
    QRectF,
    QSize,
    Qt,
    QTimer,
    Signal,
)
from PySide6.QtGui import (
    QAction,
    QGuiApplication,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPainterPath,
    QPen,
)
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QLabel,
    QMenu,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTreeView,
    QVBoxLayout,
    QWidget,
)

from wavecomb.gui import theme
from wavecomb.gui.list_view import RowDelegate
from wavecomb.gui.scene.scene_model import (
    HEADERS,
    NAME,
    TYPE,
    VARIANTS,
    VISIBILITY,
    PathRole,
    SceneModel,
    StateRole,
    search,
)
from wavecomb.gui.scene.visibility import HIDDEN, NOT_DRAWN, VISIBLE
from wavecomb.gui.widgets import named, search_field

if TYPE_CHECKING:
    from wavecomb.gui.scene.scene_edits import SceneEdits


class EyeDelegate(QStyledItemDelegate):
    """Delegate that paints an eye icon.

    The icon is crossed out if the prim is hidden, and faint if an ancestor is hidden.
    """

    def sizeHint(
        self, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex
    ) -> QSize:
        """Returns a cell size that is large enough for clicking."""
        return QSize(theme.em(2), theme.em(1.5))

    def paint(
        self,
        painter: QPainter,
        option: QStyleOptionViewItem,
        index: QModelIndex | QPersistentModelIndex,
    ) -> None:
        """Paints the cell and the eye."""
        super().paint(painter, option, index)
        seen = index.data(StateRole)
        if seen == NOT_DRAWN or seen is None:
            return
        size = min(option.rect.height() * 0.8, option.rect.width())
        box = QRectF(0, 0, size, size * 0.6)
        box.moveCenter(QRectF(option.rect).center())
        painter.save()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        colour = theme.text() if seen in (VISIBLE, HIDDEN) else theme.dim()
        painter.setPen(QPen(colour, size / 12))
        left, right = box.center().x() - box.width() / 2, box.center().x() + box.width() / 2
        middle = box.center().y()
        lid = QPainterPath()
        lid.moveTo(left, middle)
        lid.quadTo(box.center().x(), box.top() - box.height() * 0.4, right, middle)
        lid.quadTo(box.center().x(), box.bottom() + box.height() * 0.4, left, middle)
        painter.drawPath(lid)
        if seen == VISIBLE:
            painter.setBrush(colour)
        pupil = size * 0.14
        painter.drawEllipse(box.center(), pupil, pupil)
        if seen != VISIBLE:
            painter.drawLine(box.bottomLeft(), box.topRight())
        painter.restore()


MAX_FOUND = 2000
"""Largest number of prims that a search shows."""

MAX_EXPANDED = 300
"""If a search has more matches, only the ancestors of the first match are expanded."""


class _View(QTreeView):
    """Tree view of the prims of a stage.

    The space bar and a click on the eye icon toggle visibility.

    Signals:
        frame_wanted(): The user pressed F, so that the camera should frame the selected prims.
    """

    frame_wanted = Signal()

    def __init__(self, edits: SceneEdits, model: SceneModel) -> None:
        super().__init__()
        self._edits = edits
        self._model = model
        self.setModel(model)

    def chosen(self) -> list[str]:
        """Returns the prim paths of the selected rows."""
        return [index.data(PathRole) for index in self.selectionModel().selectedRows(NAME)]

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Handles Space, which toggles visibility, and F, which frames prims.

        Passes other keys to Qt.
        """
        if event.modifiers() or event.key() not in (Qt.Key.Key_Space, Qt.Key.Key_F):
            super().keyPressEvent(event)
            return
        if event.key() == Qt.Key.Key_F:
            self.frame_wanted.emit()
        else:
            self._edits.toggle_visible(self.chosen())
        event.accept()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Toggles visibility by a click on an eye icon.

        A click on a selected prim toggles all selected prims.
        """
        index = self.indexAt(event.position().toPoint())
        if event.button() == Qt.MouseButton.LeftButton and index.isValid():
            path = index.data(PathRole)
            if index.column() == VISIBILITY:
                chosen = self.chosen()
                self._edits.toggle_visible(chosen if path in chosen else [path])
                event.accept()
                return
        super().mousePressEvent(event)
        if event.button() == Qt.MouseButton.LeftButton and index.column() == VARIANTS:
            self._variant_menu(index, event.globalPosition().toPoint())

    def _variant_menu(self, index: QModelIndex, at: QPoint) -> None:
        path = index.data(PathRole)
        if not path or self._edits.edits is None:
            return
        sets = self._edits.edits.variant_sets(Sdf.Path(path))
        if not sets:
            return
        menu = QMenu(self)
        menu.setObjectName("variant-menu")
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        for one in sets:
            menu.addSection(one.name)
            for choice in one.choices:
                action = QAction(choice, menu)
                menu.addAction(action)
                action.setCheckable(True)
                action.setChecked(choice == one.choice)
                select = partial(self._edits.select_variant, path, one.name, choice)
                action.triggered.connect(lambda checked=False, select=select: select())
        menu.popup(at)


class SceneTree(QWidget):
    """Scene tree with a search field above and a line with the number of matches below."""

    def __init__(self, edits: SceneEdits, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._edits = edits
        self._session = edits.session
        self.model = SceneModel(edits, self)
        self.view = _View(edits, self.model)
        self.field = search_field(
            "scene-search", "Search prims",
            "Shows the prims whose name or type contains this text; a text with / is "
            "searched in paths", "Search names, types or paths",
        )  # fmt: skip
        self.found = QLabel()
        self._search: Iterator[list[Sdf.Path]] | None = None
        self._matches: list[Sdf.Path] = []
        self._choosing = False
        self._make()
        self._typed = QTimer(self, singleShot=True, interval=200)
        self._typed.timeout.connect(self._begin_search)
        self._slice = QTimer(self, interval=0)
        self._slice.timeout.connect(self._go_on)
        self.field.textChanged.connect(lambda text: self._typed.start())
        edits.reset.connect(self._on_reset)
        edits.structure_changed.connect(self._on_structure)
        edits.changed.connect(self.model.refresh)
        self._session.opened.connect(lambda stage: self.model.refresh())
        self._session.selected.connect(self.choose)
        theme.on_change(self.view.viewport().update)
        self._on_reset()

    def _make(self) -> None:
        self.found.setObjectName("scene-found")
        self.found.hide()
        view = self.view
        tip = "Space or a click on the eye shows and hides; F frames the selected prims"
        named(view, "scene-tree", "Prims of the stage", tip)
        view.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        view.setUniformRowHeights(True)
        view.setAlternatingRowColors(True)
        view.setItemDelegate(RowDelegate(view))
        view.setItemDelegateForColumn(VISIBILITY, EyeDelegate(view))
        view.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        view.setExpandsOnDoubleClick(False)
        header = view.header()
        header.setStretchLastSection(True)
        header.setMinimumSectionSize(theme.em(2))
        for column, wide in ((NAME, 11), (TYPE, 8), (VISIBILITY, 3.6)):
            header.resizeSection(column, theme.em(wide))
        # The eye icon is next to the name, so that it is visible in a narrow panel.
        header.moveSection(VISIBILITY, 1)
        header.setSectionResizeMode(VISIBILITY, QHeaderView.ResizeMode.Fixed)
        assert view.model().columnCount() == len(HEADERS)
        view.customContextMenuRequested.connect(self._menu)
        view.doubleClicked.connect(self._on_double_click)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.field)
        layout.addWidget(view, 1)
        layout.addWidget(self.found)

    # ---- what is selected ----------------------------------------------------------------------

    def choose(self, path: str | None) -> None:
        """Selects a prim and scrolls to it, given its path or the name from ``Renderer.pick``."""
        plain = (path or "").partition("[")[0].rstrip("/")
        index = QModelIndex()
        if plain and Sdf.Path.IsValidPathString(plain):
            index = self.model.index_of(Sdf.Path(plain))
        self._choosing = True
        try:
            if not index.isValid():
                self.view.clearSelection()
            elif plain not in self.view.chosen():
                self.view.setCurrentIndex(index)
                self.view.scrollTo(index)
        finally:
            self._choosing = False

    def _on_current(self, index: QModelIndex) -> None:
        if not self._choosing and index.isValid():
            self._session.select(index.data(PathRole))

    def _on_double_click(self, index: QModelIndex) -> None:
        if index.column() in (VISIBILITY, VARIANTS):
            return
        prim = self.model.prim(index)
        if prim and prim.IsA(UsdGeom.Camera):
            self._session.use_camera(str(prim.GetPath()))
        else:
            first = index.siblingAtColumn(NAME)
            self.view.setExpanded(first, not self.view.isExpanded(first))

    def _menu(self, at: QPoint) -> None:
        paths = self.view.chosen()
        if not paths:
            return
        menu = QMenu(self)
        menu.setObjectName("scene-menu")
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.addAction("Show", lambda: self._edits.set_visible(paths, True))
        menu.addAction("Hide", lambda: self._edits.set_visible(paths, False))
        menu.addSeparator()
        menu.addAction("Copy path", lambda: QGuiApplication.clipboard().setText("\n".join(paths)))
        prim = self._edits.prim(paths[0])
        if prim and prim.IsA(UsdGeom.Camera):
            menu.addAction("Look through", lambda: self._session.use_camera(paths[0]))
        menu.popup(self.view.viewport().mapToGlobal(at))

    # ---- what the stage does -------------------------------------------------------------------

    def _on_reset(self) -> None:
        self._stop_search()
        self.field.clear()
        self._fill(None)
        for row in range(min(self.model.rowCount(), 3)):
            self.view.expand(self.model.index(row, 0))

    def _on_structure(self) -> None:
        """Reads the rows again and expands those that were expanded before."""
        opened: list[Sdf.Path] = []
        stack = [self.model.index(row, 0) for row in range(self.model.rowCount())]
        while stack:
            index = stack.pop()
            if self.view.isExpanded(index):
                opened.append(Sdf.Path(index.data(PathRole) or "/"))
                stack += [self.model.index(r, 0, index) for r in range(self.model.rowCount(index))]
        current, top = self._session.selection, self.view.verticalScrollBar().value()
        self._fill(self._matches if self._filtered() else None)
        for path in opened:
            index = self.model.index_of(path)
            if index.isValid():
                self.view.expand(index)
        self.choose(current)
        self.view.verticalScrollBar().setValue(top)
        if self._search is not None or self._typed.isActive():
            self._begin_search()

    def _fill(self, matches: list[Sdf.Path] | None) -> None:
        self.model.reset(matches)
        # The view creates a new selection model whenever the model is reset.
        self.view.selectionModel().currentRowChanged.connect(
            self._on_current, Qt.ConnectionType.UniqueConnection
        )

    # ---- search --------------------------------------------------------------------------------

    def _filtered(self) -> bool:
        return bool(self.field.text().strip())

    def _begin_search(self) -> None:
        self._stop_search()
        usd, text = self._edits.usd, self.field.text().strip()
        if usd is None or not text:
            self._fill(None)
            self.choose(self._session.selection)
            self.found.hide()
            return
        self._matches = []
        self._search = search(usd, text)
        self._slice.start()

    def _go_on(self) -> None:
        slice_ = next(self._search, None) if self._search is not None else None
        if slice_ is not None:
            self._matches += slice_
            if len(self._matches) < MAX_FOUND:
                return
        self._stop_search()
        count = len(self._matches)
        self._matches = self._matches[:MAX_FOUND]
        self._fill(self._matches)
        if count <= MAX_EXPANDED:
            self.view.expandAll()
        if self._matches:
            self.view.scrollTo(self.model.index_of(self._matches[0]))
        more = "the first " if count >= MAX_FOUND else ""
        self.found.setText(f"{more}{len(self._matches)} found" if count else "nothing found")
        self.found.show()

    def _stop_search(self) -> None:
        self._slice.stop()
        self._search = None
