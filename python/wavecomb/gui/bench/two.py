# SPDX-License-Identifier: Apache-2.0
"""Two results folders: what `wavecomb bench compare` says of them."""

from __future__ import annotations

import json
from pathlib import Path

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QComboBox,
    QFileDialog,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from wavecomb.bench.columns import Column
from wavecomb.bench.folders import METRICS, FolderComparison, from_dict, pictures_line
from wavecomb.gui import theme
from wavecomb.gui.bench.tables import RunsTable
from wavecomb.gui.command import Command

_COLUMNS = (
    Column("config", "text", "", "A configuration that both folders have."),
    Column("ratio", "number", "", "After over before, of geometric means."),
    Column("interval", "text", "", "95 % (Welch); rounds are not shared, so it is wide."),
    Column("verdict", "text", "", "In a word; p-values are corrected for their number."),
    Column("before", "number", "", "Mean before."),
    Column("after", "number", "", "Mean after."),
    Column("runs", "text", "", "Runs before and after."),
    Column("p", "number", "", "p-value of no change, corrected."),
)


class TwoFolders(QWidget):
    """Before, after and their ratios.

    Signals:
        failed(str): One line.
    """

    failed = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("twoFolders")
        self._before: Path | None = None
        self._after: Path | None = None
        self.found: FolderComparison | None = None
        self._again = False
        self._command = Command(self)
        self._command.finished.connect(self._take)
        self.before = QPushButton("Before: choose a folder ...", self)
        self.before.setObjectName("twoBefore")
        self.before.setToolTip("The folder that this one is compared with")
        self.before.clicked.connect(self.ask)
        self.choice = QComboBox(self)
        self.choice.setObjectName("twoMetric")
        self.choice.setAccessibleName("What is compared")
        self.choice.setToolTip("The column of runs.csv that is compared")
        self.choice.addItems(METRICS)
        self.choice.currentIndexChanged.connect(self._run)
        self.words = QLabel(self)
        self.words.setObjectName("twoWords")
        self.words.setWordWrap(True)
        self.words.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.table = RunsTable("two", self)
        row = QHBoxLayout()
        row.addWidget(self.before, 1)
        row.addWidget(self.choice)
        column = QVBoxLayout(self)
        column.addLayout(row)
        column.addWidget(self.words)
        column.addWidget(self.table, 1)
        self._say("Choose the folder of an earlier sitting: ratios are this folder over it.")

    @property
    def busy(self) -> bool:
        """Whether a comparison is made."""
        return self._command.running

    def ask(self) -> None:
        """A dialog for the folder before."""
        dialog = QFileDialog(self, "Results before")
        dialog.setFileMode(QFileDialog.FileMode.Directory)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.fileSelected.connect(lambda path: self.set_before(Path(path)))
        dialog.open()

    def set_before(self, path: Path) -> None:
        """The earlier folder."""
        self._before = path
        self.before.setText(f"Before: {path}")
        self._run()

    def set_after(self, path: Path) -> None:
        """The folder that is open."""
        self._after = path
        self._run()

    def shutdown(self) -> None:
        """Ends what runs."""
        self._command.shutdown()

    def _run(self) -> None:
        if self._before is None or self._after is None:
            return
        if self._command.running:
            self._again = True
            self._command.stop()
            return
        self._say("Comparing ...")
        words = ["bench", "compare", str(self._before), str(self._after)]
        self._command.start([*words, "--metric", self.choice.currentText(), "--json"])

    def _take(self, code: int, text: str, error: str) -> None:
        if self._again:
            self._again = False
            self._run()
            return
        if error or code != 0:
            self.found = None
            self.table.set_rows(_COLUMNS, ())
            self._say(error)
            self.failed.emit(error)
            return
        found = self.found = from_dict(json.loads(text))
        rows = []
        for change in found.changes:
            known = change.low is not None and change.high is not None
            rows.append(
                {
                    "config": change.config,
                    "ratio": change.ratio,
                    "interval": f"{change.low:.3f} to {change.high:.3f}" if known else "one run",
                    "verdict": change.verdict,
                    "before": change.before,
                    "after": change.after,
                    "runs": f"{change.runs[0]}, {change.runs[1]}",
                    "p": change.p,
                }
            )
        self.table.set_rows(_COLUMNS, rows)
        lines = [
            f"{found.metric}, after over before: {found.mean_ratio:.3f} in the geometric mean of "
            f"{len(found.changes)} configurations; {pictures_line(found)}.",
            *(f"Take care: {line}." for line in found.warnings),
        ]
        for name, configs in (("before", found.only_before), ("after", found.only_after)):
            if configs:
                lines.append(f"Only {name}: {len(configs)} configurations.")
        self._say("\n".join(lines))

    def _say(self, text: str) -> None:
        self.words.setText(text)
        self.words.setMinimumHeight(theme.em(1.5))
