# SPDX-License-Identifier: Apache-2.0
"""Tab with the table of recent runs, in which runs can be pinned, repeated, copied and saved."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtGui import QColor, QGuiApplication, QKeySequence, QShortcut
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHBoxLayout,
    QHeaderView,
    QLabel,
    QPushButton,
    QTableView,
    QVBoxLayout,
    QWidget,
)

from wavecomb.gui import theme
from wavecomb.gui.list_view import compact
from wavecomb.gui.scheduling.render_rounds import Rounds
from wavecomb.gui.scheduling.run_log import RunLog, Series
from wavecomb.gui.scheduling.run_rates import MIN_REPEATS, MIN_SECONDS
from wavecomb.gui.scheduling.run_table import COLUMNS, LEFT, TIPS, Row, as_csv, as_text, rows
from wavecomb.gui.table_model import Table
from wavecomb.gui.viewport.session import Session
from wavecomb.gui.widgets import ask_file, named
from wavecomb.image.files.output_file import reason, replacing

NOTE = (
    f"Rates are over the whole time with these settings; those in brackets are over less than "
    f"{MIN_SECONDS:g} s and have no meaning. Speeds are at equal samples of the same picture. A "
    f"difference holds only if {MIN_REPEATS} repeats agree, because the speed of machines "
    "drifts. For results to publish, use wavecomb bench."
)


class RunsTab(QWidget):
    """Tab that shows the log of runs as a table.

    Signals:
        changed(): Another series was pinned, or runs were removed. Plots must be redrawn.
    """

    changed = Signal()

    def __init__(self, session: Session, log: RunLog) -> None:
        super().__init__()
        self._session = session
        self._log = log
        self._rows: list[Row] = []
        self.rounds = Rounds(session, self)
        self.model = Table(TIPS, LEFT, self)
        self.view = QTableView()
        self.view.setModel(self.model)
        self.view.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        compact(self.view, "runs_table", "Runs", "")
        header = self.view.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        self.view.selectionModel().selectionChanged.connect(lambda *_: self._enable())
        note = QLabel(NOTE)
        note.setWordWrap(True)
        layout = QVBoxLayout(self)
        layout.addWidget(self.view, 1)
        layout.addLayout(self._buttons())
        layout.addWidget(note)
        QShortcut(QKeySequence(QKeySequence.StandardKey.Copy), self.view, self.copy)
        self.rounds.moved.connect(self._show_rounds)
        self.rounds.ended.connect(self._end_rounds)
        self._enable()

    def _buttons(self) -> QHBoxLayout:
        row = QHBoxLayout()
        self._made: dict[str, QPushButton] = {}
        for name, text, tip, call in (
            ("pin", "Pin", "Compares all rows with the chosen one; press again for the first.",
             self.pin),
            ("repeat", "Repeat both", "Renders the settings of the base and of the chosen row (or "
             f"the current ones) {MIN_REPEATS} times, then the old settings. Press again to "
             "stop.", self.repeat),
            ("copy", "Copy", "Copies the table as text.", self.copy),
            ("save", "Save CSV…", "Writes all runs shown, with all settings and phases, one line "
             "each.", self._ask_save),
            ("clear", "Clear", "Removes all runs but the current one.", self.clear),
        ):  # fmt: skip
            button = named(QPushButton(text), f"runs_{name}", text, tip)
            button.clicked.connect(call)
            row.addWidget(button)
            self._made[name] = button
        row.addStretch(1)
        return row

    # ---- display
    # -------------------------------------------------------------------------------------

    def refresh(self) -> None:
        """Shows the current contents of the log."""
        self._rows = rows(self._log)
        colours: dict[tuple[int, int], QColor] = {}
        for i, row in enumerate(self._rows):
            holds = row.ratio is not None and row.ratio.holds
            if row.ratio is not None and not holds:
                colours.update({(i, COLUMNS.index(name)): theme.dim() for name in (
                    "speed", "95 %", "verdict")})  # fmt: skip
        self.model.replace(
            [tuple((text, text) for text in row.texts) for row in self._rows],
            bold=[i for i, row in enumerate(self._rows) if row.is_base],
            colours=colours,
        )
        self._enable()

    def chosen(self) -> Series | None:
        """Returns the series of the selected row, or None."""
        lines = self.view.selectionModel().selectedRows()
        if not lines or lines[0].row() >= len(self._rows):
            return None
        return self._rows[lines[0].row()].series

    def _enable(self) -> None:
        chosen = self.chosen()
        pinned = chosen is not None and chosen is self._log.pinned
        self._made["pin"].setText("Unpin" if pinned else "Pin")
        self._made["pin"].setEnabled(chosen is not None)
        self._made["repeat"].setEnabled(self.rounds.running or self._pair() is not None)
        for name in ("copy", "save", "clear"):
            self._made[name].setEnabled(bool(self._rows))

    def _pair(self) -> tuple[Series, Series] | None:
        base, other = self._log.base, self.chosen() or self._log.current
        if base is None or other is None or base is other:
            return None
        return (base, other) if base.picture == other.picture else None

    # ---- actions
    # -------------------------------------------------------------------------------------

    def pin(self) -> None:
        """Pins the series of the selected row, or unpins it."""
        chosen = self.chosen()
        self._log.pin(None if chosen is self._log.pinned else chosen)
        self.changed.emit()

    def repeat(self) -> None:
        """Renders alternately with the settings of the base series and of the selected series.

        A second call stops the sequence of renders.
        """
        if self.rounds.running:
            self.rounds.stop()
            return
        pair = self._pair()
        if pair is not None:
            self.rounds.start([pair[i % 2].recipe for i in range(2 * MIN_REPEATS)])

    def _show_rounds(self, done: int, count: int) -> None:
        self._made["repeat"].setText(f"Run {min(done + 1, count)} of {count}: stop")

    def _end_rounds(self, whole: bool) -> None:
        self._made["repeat"].setText("Repeat both")
        self._enable()

    def copy(self) -> None:
        """Copies the table to the clipboard as text."""
        QGuiApplication.clipboard().setText(as_text(self._rows))

    def _ask_save(self) -> None:
        ask_file(self, "Save runs", "CSV (*.csv)", self.save, start="runs.csv", ending="csv")

    def save(self, path: str) -> None:
        """Saves the runs as a CSV file.

        A failure leaves no partial file. Errors are shown in the message bar.
        """
        text = as_csv(self._rows)

        def work() -> None:
            try:
                with replacing(path) as part:
                    part.write_text(text, encoding="utf-8")
            except OSError as error:
                raise OSError(error.errno, reason(error), path) from error

        self._session.run("saving runs", work)

    def clear(self) -> None:
        """Removes all runs but the current one."""
        self._log.clear()
        self.changed.emit()
