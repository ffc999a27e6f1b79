# SPDX-License-Identifier: Apache-2.0
"""The benchmark suite in the window: results that are there, and new ones."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QSize, Signal
from PySide6.QtWidgets import QTabWidget, QVBoxLayout, QWidget

from wavecomb.gui import theme
from wavecomb.gui.bench.browser import BenchBrowser
from wavecomb.gui.bench.runner import BenchRunner

if TYPE_CHECKING:
    from wavecomb.gui.viewport.session import Session


class BenchPanel(QWidget):
    """Two tabs: results, and a run.

    Signals:
        compare(a, b): Picture files to compare; a is None where there is only a converged one.
        failed(str): One line that says what to do; also shown here.
    """

    compare = Signal(object, object)
    failed = Signal(str)

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("benchPanel")
        self.setWindowTitle("Benchmarks")
        self.browser = BenchBrowser(self)
        self.runner = BenchRunner(session, self)
        self.tabs = QTabWidget(self)
        self.tabs.setObjectName("benchPanelTabs")
        for widget, title, tip in (
            (self.browser, "Results", "A folder that `wavecomb bench run` has written"),
            (self.runner, "Run", "Start a suite, watch and stop it"),
        ):
            self.tabs.setTabToolTip(self.tabs.addTab(widget, title), tip)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.tabs)
        self.browser.compare.connect(self.compare)
        self.browser.failed.connect(self.failed)
        self.runner.failed.connect(self.failed)
        self.runner.done.connect(self._open_new)

    def open(self, folder: Path) -> None:
        """Shows a results folder."""
        self.tabs.setCurrentWidget(self.browser)
        self.browser.open(folder)

    def shutdown(self) -> None:
        """Ends what runs; a benchmark can be resumed."""
        self.browser.shutdown()
        self.runner.shutdown()

    def sizeHint(self) -> QSize:
        """Room for a figure and a table."""
        return QSize(theme.em(64), theme.em(44))

    def _open_new(self, folder: Path) -> None:
        self.open(folder)
