# SPDX-License-Identifier: Apache-2.0
"""Findings of the loader as rows that can be filtered. The models are independent of widgets."""

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
    """A finding of the loader. ``place`` is a prim path, a file, or "" for the whole stage."""

    kind: str
    what: str
    place: str

    def line(self) -> str:
        """Returns the finding as a line of text."""
        return f"{self.kind}: {self.what}" + (f": {self.place}" if self.place else "")


def rows_of(stage: LoadedStage) -> list[Row]:
    """Returns a row for each listed prim or file of a finding.

    One more row counts the prims or files that are not listed.
    """
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
    """Table model of the findings."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(HEADERS, parent)

    def data(self, index: Any, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        """Returns the data of a cell for a role, which may be ``ToneRole``."""
        row = self.rows[index.row()]
        if role == Qt.ItemDataRole.DisplayRole:
            return (row.kind, row.what, row.place)[index.column()]
        if role == Qt.ItemDataRole.ToolTipRole:
            return row.line()
        if role == ToneRole and index.column() == KIND:
            return {UNSUPPORTED: "error", WARNING: "warning"}.get(row.kind, "dim")
        return None


class NotesFilter(QSortFilterProxyModel):
    """Filter for the loader's findings, by kind and by a text that a column must contain."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.kind = ""
        self.text = ""

    def set(self, kind: str, text: str) -> None:
        """Sets the filter; an empty kind means all kinds."""
        self.kind, self.text = kind, text.casefold()
        self.invalidate()

    def filterAcceptsRow(self, number: int, parent: Any) -> bool:
        """Returns whether a row passes the filter."""
        model = self.sourceModel()
        assert isinstance(model, NotesModel)
        row = model.rows[number]
        return (not self.kind or row.kind == self.kind) and self.text in row.line().casefold()
