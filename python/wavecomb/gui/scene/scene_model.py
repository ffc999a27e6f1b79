# SPDX-License-Identifier: Apache-2.0
"""Tree model of the prims of a stage, which reads prims only when a view requests them."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import TYPE_CHECKING, Any

from pxr import Sdf, Usd, UsdGeom
from PySide6.QtCore import QAbstractItemModel, QModelIndex, QObject, Qt
from PySide6.QtGui import QFont

from wavecomb.gui.scene.visibility import HIDDEN_ABOVE, NOT_DRAWN, VISIBLE, state, uneditable
from wavecomb.gui.table_model import ToneRole

if TYPE_CHECKING:
    from wavecomb.gui.scene.scene_edits import SceneEdits

NAME, TYPE, VISIBILITY, VARIANTS = range(4)
HEADERS = ("Name", "Type", "Visible", "Variants")
PathRole = Qt.ItemDataRole.UserRole
StateRole = Qt.ItemDataRole.UserRole + 1
"""Item data role of a prim's visibility state, which the eye icon shows."""

PREDICATE = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)
ROOT = QModelIndex()

CHUNK = 500
"""Number of children of a prim that the model passes to a view at once. The view requests more
children when it scrolls to the end."""


class _Node:
    """A node of the tree, for one prim.

    The list of child names is None until a view requests it. Child nodes are created on demand.
    """

    __slots__ = ("made", "names", "parent", "path", "row", "shown")

    def __init__(self, path: Sdf.Path, parent: _Node | None, row: int) -> None:
        self.path = path
        self.parent = parent
        self.row = row
        self.names: list[str] | None = None
        self.shown = 0
        self.made: dict[int, _Node] = {}


class SceneModel(QAbstractItemModel):
    """Tree model of a stage's prims, with columns for name, type, visibility and variants.

    The tree includes the prims inside instances.
    """

    def __init__(self, edits: SceneEdits, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._edits = edits
        self._filter: Collection[Sdf.Path] | None = None
        self._matches: Collection[Sdf.Path] = ()
        self._root = _Node(Sdf.Path.absoluteRootPath, None, 0)

    def reset(self, matches: Collection[Sdf.Path] | None = None) -> None:
        """Reads all prims again.

        If ``matches`` is given, shows only those prims and their ancestors.
        """
        self.beginResetModel()
        self._matches = matches or ()
        self._filter = None
        if matches is not None:
            self._filter = {prefix for path in matches for prefix in path.GetPrefixes()}
        self._root = _Node(Sdf.Path.absoluteRootPath, None, 0)
        self.endResetModel()

    def prim(self, index: QModelIndex) -> Usd.Prim:
        """Returns the prim of a row."""
        usd = self._edits.usd
        return usd.GetPrimAtPath(self._node(index).path) if usd is not None else Usd.Prim()

    def index_of(self, path: Sdf.Path) -> QModelIndex:
        """Returns the row of a prim, or an invalid index."""
        node = self._root
        for prefix in path.GetPrefixes():
            try:
                row = self._names(node).index(prefix.name)
            except ValueError:
                return QModelIndex()
            if row >= node.shown:
                self._show_more(node, row + 1)
            node = self._child(node, row)
        return QModelIndex() if node is self._root else self.createIndex(node.row, NAME, node)

    def refresh(self) -> None:
        """Updates the cells of all rows, after edits of visibility or variants."""
        top = self.rowCount()
        if top:
            self.dataChanged.emit(self.index(0, 0), self.index(top - 1, len(HEADERS) - 1))

    # ---- QAbstractItemModel --------------------------------------------------------------------

    def _node(self, index: QModelIndex) -> _Node:
        node = index.internalPointer() if index.isValid() else self._root
        assert isinstance(node, _Node)
        return node

    def _names(self, node: _Node) -> list[str]:
        if node.names is None:
            usd = self._edits.usd
            prim = usd.GetPrimAtPath(node.path) if usd is not None else None
            names = [str(name) for name in prim.GetFilteredChildrenNames(PREDICATE)] if prim else []
            if self._filter is not None:
                names = [name for name in names if node.path.AppendChild(name) in self._filter]
            node.names = names
            node.shown = min(len(names), CHUNK)
        return node.names

    def _show_more(self, node: _Node, count: int) -> None:
        """Makes ``count`` children visible to the view."""
        at = QModelIndex() if node is self._root else self.createIndex(node.row, NAME, node)
        self.beginInsertRows(at, node.shown, count - 1)
        node.shown = count
        self.endInsertRows()

    def canFetchMore(self, parent: QModelIndex = ROOT) -> bool:
        """Returns whether a row has children that the view has not requested yet."""
        node = self._node(parent)
        return node.shown < len(self._names(node))

    def fetchMore(self, parent: QModelIndex = ROOT) -> None:
        """Passes the next children of a row to the view."""
        node = self._node(parent)
        count = min(len(self._names(node)), node.shown + CHUNK)
        if count > node.shown:
            self._show_more(node, count)

    def _child(self, node: _Node, row: int) -> _Node:
        made = node.made.get(row)
        if made is None:
            path = node.path.AppendChild(self._names(node)[row])
            made = node.made[row] = _Node(path, node, row)
        return made

    def index(self, row: int, column: int, parent: QModelIndex = ROOT) -> QModelIndex:
        """Returns the index of a cell."""
        node = self._node(parent)
        if not (0 <= row < len(self._names(node)) and 0 <= column < len(HEADERS)):
            return QModelIndex()
        return self.createIndex(row, column, self._child(node, row))

    def parent(self, index: QModelIndex = ROOT) -> Any:
        """Returns the index of a row's parent."""
        above = self._node(index).parent if index.isValid() else None
        if above is None or above is self._root:
            return QModelIndex()
        return self.createIndex(above.row, NAME, above)

    def hasChildren(self, parent: QModelIndex = ROOT) -> bool:
        """Returns whether a row has children."""
        return parent.column() <= 0 and bool(self._names(self._node(parent)))

    def rowCount(self, parent: QModelIndex = ROOT) -> int:
        """Returns the number of child rows that were passed to the view."""
        if parent.column() > 0:
            return 0
        node = self._node(parent)
        self._names(node)
        return node.shown

    def columnCount(self, parent: QModelIndex = ROOT) -> int:
        """Returns the number of columns."""
        return len(HEADERS)

    def headerData(
        self,
        section: int,
        orientation: Qt.Orientation,
        role: int = Qt.ItemDataRole.DisplayRole,
    ) -> Any:
        """Returns the title of a column."""
        if role == Qt.ItemDataRole.DisplayRole and orientation == Qt.Orientation.Horizontal:
            return HEADERS[section]
        return None

    def data(self, index: QModelIndex, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        """Returns the data of a cell for a role.

        The role may be ``PathRole``, ``StateRole`` or ``ToneRole``.
        """
        prim = self.prim(index)
        if not prim:
            return None
        column = index.column()
        if role == PathRole:
            return str(prim.GetPath())
        if role == StateRole:
            return state(prim, self._edits.time)[0]
        if role == Qt.ItemDataRole.DisplayRole:
            return self._text(prim, column)
        if role == Qt.ItemDataRole.ToolTipRole:
            return self._tip(prim, column)
        if role == Qt.ItemDataRole.AccessibleTextRole:
            if column == VISIBILITY:
                return state(prim, self._edits.time)[0] or "not drawn"
            return self._text(prim, column)
        if role == Qt.ItemDataRole.FontRole and column == NAME:
            font = QFont()
            font.setItalic(prim.IsInstanceProxy())
            font.setBold(prim.GetPath() in self._matches)
            return font
        if role == ToneRole and column != VISIBILITY:
            drawn = state(prim, self._edits.time)[0]
            return None if drawn in (VISIBLE, NOT_DRAWN) else "dim"
        return None

    def _text(self, prim: Usd.Prim, column: int) -> str:
        if column == NAME:
            return str(prim.GetName())
        if column == TYPE:
            name = str(prim.GetTypeName())
            if prim.IsInstance():
                return f"{name} (instance)".strip()
            if prim.IsA(UsdGeom.PointInstancer):
                instancer = UsdGeom.PointInstancer(prim)
                count = len(instancer.GetProtoIndicesAttr().Get(self._edits.time) or ())
                return f"{name} ({count})"
            return name
        if column == VARIANTS and self._edits.edits is not None:
            sets = self._edits.edits.variant_sets(prim.GetPath())
            return ", ".join(f"{one.name}: {one.choice or '-'}" for one in sets)
        return ""

    def _tip(self, prim: Usd.Prim, column: int) -> str:
        lines = [str(prim.GetPath())]
        if prim.IsInstance():
            count = len(prim.GetPrototype().GetInstances())
            lines.append(f"one of {count} instances that share their contents")
        if prim.IsInstanceProxy():
            lines.append("inside an instance: cannot be edited here")
        if column == VISIBILITY:
            seen, by = state(prim, self._edits.time)
            if reason := uneditable(prim):
                lines.append(reason)
            elif seen == HIDDEN_ABOVE:
                lines.append(f"hidden by {by}; click to show only this prim in it")
            else:
                lines.append("click to hide" if seen == VISIBLE else "click to show")
        if column == VARIANTS and self._text(prim, VARIANTS):
            lines.append("click to choose a variant")
        return "\n".join(lines)


def search(usd: Usd.Stage, text: str, step: int = 500) -> Iterator[list[Sdf.Path]]:
    """Finds the prims whose name or type contains a text.

    If the text has a "/", searches the paths.

    Args:
        usd: The stage.
        text: The text to find; case is ignored.
        step: Number of prims to search before a list is yielded. The caller can do other work
            between lists.
    """
    wanted = text.casefold()
    by_path = "/" in wanted
    found: list[Sdf.Path] = []
    types: dict[str, bool] = {}
    for count, prim in enumerate(Usd.PrimRange.Stage(usd, PREDICATE), 1):
        kind = prim.GetTypeName()
        known = types.get(kind)
        if known is None:
            known = types[kind] = not by_path and wanted in str(kind).casefold()
        name = str(prim.GetPath()) if by_path else prim.GetName()
        if known or wanted in name.casefold():
            found.append(prim.GetPath())
        if count % step == 0:
            yield found
            found = []
    yield found
