# SPDX-License-Identifier: Apache-2.0
"""Plots and a table of shading costs: time per queued hit (record) and hits of each material."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QSortFilterProxyModel, Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import (
    QComboBox,
    QHBoxLayout,
    QHeaderView,
    QLabel,
    QSpinBox,
    QSplitter,
    QTableView,
    QVBoxLayout,
    QWidget,
)

from wavecomb.gui import theme
from wavecomb.gui.list_view import compact
from wavecomb.gui.scheduling.plots import Bar, Bars, Legend
from wavecomb.gui.scheduling.run_log import Series
from wavecomb.gui.table_model import Cell, Table
from wavecomb.gui.widgets import named, search_field
from wavecomb.run.progress import count_text

ORDERS = {
    "time": "By shading time: records x nanoseconds.",
    "ns per record": "By cost per record.",
    "records": "By number of records.",
}


@dataclass(frozen=True)
class MaterialCost:
    """Shading costs of one material in a render."""

    name: str
    short: str
    program: str
    records: int
    measured_ns: float
    """Measured ns per shading record over the timed batches; 0 if no batch was timed."""
    predicted_ns: float
    """Predicted ns per shading record, used to schedule the next pass."""
    calibrated_ns: float
    """Calibrated ns per shading record, measured before the first pass of the render."""
    share: float
    """Fraction of the shading time of all materials, 0 to 1."""

    @property
    def ns(self) -> float:
        """Measured ns per shading record, or the predicted value if nothing was measured."""
        return self.measured_ns or self.predicted_ns


def material_costs(stats: Mapping[str, Any], order: str = "time") -> list[MaterialCost]:
    """Returns the materials that were shaded, sorted in descending order.

    ``order`` is the name of the sort order, one of ``ORDERS``.
    """
    used = [one for one in stats.get("materials", ()) if one.get("records")]
    times = [one["records"] * (one["ns_per_record"] or one["predicted_ns"]) for one in used]
    total = sum(times)
    rows = [
        MaterialCost(
            one["name"],
            short,
            one["program"],
            int(one["records"]),
            float(one["ns_per_record"]),
            float(one["predicted_ns"]),
            float(one.get("calibrated_ns", 0.0)),
            time / total if total > 0.0 else 0.0,
        )
        for one, short, time in zip(
            used, short_names([one["name"] for one in used]), times, strict=True
        )
    ]
    keys = {
        "time": lambda row: row.share,
        "ns per record": lambda row: row.ns,
        "records": lambda row: row.records,
    }
    return sorted(rows, key=keys[order], reverse=True)


def short_names(paths: Sequence[str]) -> list[str]:
    """Returns short unique names of prims: as many trailing parts of each path as necessary.

    >>> short_names(["/A/Looks/Gold", "/A/Looks/Wood", "/B/Looks/Gold", ""])
    ['A/Looks/Gold', 'Wood', 'B/Looks/Gold', '(no name)']
    """
    parts = [path.strip("/").split("/") for path in paths]
    depth = max((len(one) for one in parts), default=0)
    names = ["/".join(one[-1:]) for one in parts]
    for count in range(2, depth + 1):
        often = Counter(names)
        if max(often.values()) == 1:
            break
        names = [
            "/".join(one[-count:]) if often[name] > 1 else name
            for one, name in zip(parts, names, strict=True)
        ]
    return [name or "(no name)" for name in names]


_HEADER = {
    "material": "",
    "program": "The shading program of the material.",
    "records": "Number of shaded hits.",
    "time": "Share of the shading time of all materials.",
    "measured": "Nanoseconds per record over timed batches; empty if none was timed.",
    "predicted": "Nanoseconds per record, used to schedule the next pass.",
    "calibrated": "Nanoseconds per record, measured on synthetic hits before the first pass.",
}


def measured_colour() -> QColor:
    """Returns the colour of measured values in plots."""
    return theme.series(1)


def predicted_colour() -> QColor:
    """Returns the colour of predicted values in plots."""
    return theme.series(0)


class MaterialsTab(QWidget):
    """Tab with a bar chart of the most expensive materials and a table of all materials."""

    def __init__(self) -> None:
        super().__init__()
        self.of = named(
            QComboBox(),
            "materials_of",
            "Series whose materials are shown",
            "Series of which the longest run is shown.",
        )
        self.of.setSizeAdjustPolicy(
            QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon
        )
        self.of.setMinimumContentsLength(14)
        self.order = named(
            QComboBox(), "materials_order", "Order of materials", "\n".join(ORDERS.values())
        )
        self.order.addItems(list(ORDERS))
        self.top = named(
            QSpinBox(),
            "materials_top",
            "Number of materials with bars",
            "Number of materials with bars; the table has all.",
        )
        self.top.setRange(1, 40)
        self.top.setValue(10)
        self.search = search_field(
            "materials_search", "Search materials",
            "Shows the materials whose name or program contains this text", "Search materials",
        )  # fmt: skip
        self.costs = Bars("material_costs", "Cost: ns per record")
        self.records = Bars("material_records", "Records", names=False)
        self.legend = Legend("material_legend")
        self.legend.show_entries(
            lambda: [("predicted", predicted_colour()), ("measured", measured_colour())]
        )
        self.note = QLabel()
        self.note.setObjectName("materials_note")
        self.note.setWordWrap(True)
        self._rows: list[MaterialCost] = []
        self._shown: Series | None = None
        self._table()
        self._lay_out()
        self.top.valueChanged.connect(lambda count: self._draw())
        self.search.textChanged.connect(self.proxy.setFilterFixedString)

    def _table(self) -> None:
        self.model = Table(_HEADER, (0, 1), self)
        self.proxy = QSortFilterProxyModel(self)
        self.proxy.setSourceModel(self.model)
        self.proxy.setFilterCaseSensitivity(Qt.CaseSensitivity.CaseInsensitive)
        self.proxy.setFilterKeyColumn(-1)
        self.proxy.setFilterRole(Qt.ItemDataRole.DisplayRole)
        self.proxy.setSortRole(Qt.ItemDataRole.UserRole)
        self.view = QTableView()
        self.view.setModel(self.proxy)
        self.view.setSortingEnabled(True)
        self.view.sortByColumn(3, Qt.SortOrder.DescendingOrder)
        compact(self.view, "materials_table", "All materials", "")
        header = self.view.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        self.view.setMinimumHeight(theme.em(6))

    def _lay_out(self) -> None:
        controls = QHBoxLayout()
        for text, widget in (("Of", self.of), ("Sort by", self.order), ("Bars", self.top)):
            label = QLabel(text)
            label.setBuddy(widget)
            controls.addWidget(label)
            controls.addWidget(widget, 1 if widget is self.of else 0)
        bars = QWidget()
        grid = QVBoxLayout(bars)
        grid.setContentsMargins(0, 0, 0, 0)
        pair = QHBoxLayout()
        pair.addWidget(self.costs, 3)
        pair.addWidget(self.records, 2)
        grid.addLayout(pair, 1)
        grid.addWidget(self.legend)
        below = QWidget()
        column = QVBoxLayout(below)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.search)
        column.addWidget(self.view, 1)
        splitter = QSplitter(Qt.Orientation.Vertical)
        splitter.addWidget(bars)
        splitter.addWidget(below)
        splitter.setStretchFactor(0, 3)
        splitter.setStretchFactor(1, 2)
        splitter.setChildrenCollapsible(False)
        layout = QVBoxLayout(self)
        layout.addLayout(controls)
        layout.addWidget(splitter, 1)
        layout.addWidget(self.note)

    def show_series(
        self, series: Sequence[Series], labels: Sequence[str], current: Series | None
    ) -> None:
        """Draws the costs of the chosen run series, or of the current series if none was chosen."""
        chosen = self.of.currentData()
        follow = self.of.currentIndex() <= 0 or chosen not in series
        blocked = self.of.blockSignals(True)
        self.of.clear()
        self.of.addItem("the current run", None)
        for one, label in zip(series, labels, strict=True):
            self.of.addItem(label, one)
        self.of.setCurrentIndex(0 if follow else 1 + list(series).index(chosen))
        self.of.blockSignals(blocked)
        shown = current if follow else chosen
        stats = {} if shown is None else (shown.run if follow else shown.best).stats
        self._rows = material_costs(stats, self.order.currentText())
        self._draw()
        self._fill()
        prediction = stats.get("cost_prediction", {})
        text = f"{len(self._rows)} materials were shaded."
        if prediction.get("materials"):
            r2 = prediction["r2"]
            worth = f"{r2:.2f}" if r2 >= 0.0 else "below 0, worse than a common mean"
            text += (
                f" Prediction of the last pass: r² {worth}, mean error "
                f"{100 * prediction['mean_error']:.0f} %, over {prediction['materials']} materials."
            )
        self.note.setText(text)

    def _draw(self) -> None:
        rows = self._rows[: self.top.value()]
        costs, records = [], []
        for i, row in enumerate(rows):
            tip = (
                f"{row.name} ({row.program})\nmeasured {row.measured_ns:.0f} ns, predicted "
                f"{row.predicted_ns:.0f} ns, calibrated {row.calibrated_ns:.0f} ns\n"
                f"{count_text(row.records)} records, {100 * row.share:.1f} % of shading"
            )
            costs.append(Bar(i - 0.19, 0.36, 0.0, row.predicted_ns, predicted_colour(), tip))
            costs.append(Bar(i + 0.19, 0.36, 0.0, row.measured_ns, measured_colour(), tip))
            records.append(Bar(i, 0.7, 0.0, float(row.records), theme.series(2), tip))
        names = [row.short for row in rows]
        self.costs.show_bars(names, costs)
        self.records.show_bars(names, records)

    def _fill(self) -> None:
        def ns(value: float) -> Cell:
            return f"{value:.0f}" if value else "", value

        self.model.replace(
            [
                (
                    (row.short, row.name),
                    (row.program, row.program),
                    (count_text(row.records), row.records),
                    (f"{100 * row.share:.1f} %", row.share),
                    ns(row.measured_ns),
                    ns(row.predicted_ns),
                    ns(row.calibrated_ns),
                )
                for row in self._rows
            ]
        )
