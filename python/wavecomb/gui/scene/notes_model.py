# SPDX-License-Identifier: Apache-2.0
"""What loading found, as rows that can be filtered. No widgets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject, QSortFilterProxyModel, Qt

from wavecomb.gui.table_model import HeadedModel, ToneRole

if TYPE_CHECKING:
    from wavecomb.usd import Finding, LoadedStage

KIND, WHAT, PLACE = range(3)
HEADERS = ("Kind", "What", "Where")
UNSUPPORTED, WARNING, NOTE = "not supported", "warning", "note"
KINDS = (UNSUPPORTED, WARNING, NOTE)


@dataclass(frozen=True)
class Row:
    """One finding at one place; place: a prim path, a file, or "" for the whole stage."""

    kind: str
    what: str
    place: str

    def line(self) -> str:
        """As text."""
        return f"{self.kind}: {self.what}" + (f": {self.place}" if self.place else "")


def rows_of(stage: LoadedStage) -> list[Row]:
    """A row for each place that the report names, and one for those that it only counts."""
    out: list[Row] = []
    report = stage.report

    def add(kind: str, finding: Finding) -> None:
        places = finding.all_places or [""]
        out.extend(Row(kind, finding.what, place) for place in places)
        more = finding.count - len(places)
        if more > 0 and finding.all_places:
            out.append(Row(kind, finding.what, f"({more} more)"))

    for kind, findings in zip(
        KINDS, (report.unsupported, report.warnings, report.notes), strict=True
    ):
        for finding in findings:
            add(kind, finding)
    out += [Row(WARNING, line, "") for line in stage.scene.warnings]
    return out


class NotesModel(HeadedModel):
    """The rows."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(HEADERS, parent)

    def data(self, index: Any, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        """As Qt has it, and ``ToneRole``."""
        row = self.rows[index.row()]
        if role == Qt.ItemDataRole.DisplayRole:
            return (row.kind, row.what, row.place)[index.column()]
        if role == Qt.ItemDataRole.ToolTipRole:
            return row.line()
        if role == ToneRole and index.column() == KIND:
            return {UNSUPPORTED: "error", WARNING: "warning"}.get(row.kind, "dim")
        return None


class NotesFilter(QSortFilterProxyModel):
    """Rows of one kind that hold a text in any column."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.kind = ""
        self.text = ""

    def set(self, kind: str, text: str) -> None:
        """What to show; kind "": all."""
        self.kind, self.text = kind, text.casefold()
        self.invalidate()

    def filterAcceptsRow(self, number: int, parent: Any) -> bool:
        """As Qt has it."""
        model = self.sourceModel()
        assert isinstance(model, NotesModel)
        row = model.rows[number]
        return (not self.kind or row.kind == self.kind) and self.text in row.line().casefold()
