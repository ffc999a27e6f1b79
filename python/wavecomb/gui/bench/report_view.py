# SPDX-License-Identifier: Apache-2.0
"""The report's own parts: a list of its sections, and the one that is chosen."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Qt, QUrl
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import (
    QLabel,
    QListWidget,
    QPushButton,
    QSplitter,
    QVBoxLayout,
    QWidget,
)

from wavecomb.bench.report_parts import Report
from wavecomb.gui import theme
from wavecomb.gui.bench.page import plain_html, section_html
from wavecomb.gui.bench.pages import TextView

NONE_YET = 'No report yet: "Make the report" writes one.'


class ReportView(QWidget):
    """Title and lead above, sections on the left."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("report")
        self._report: Report | None = None
        self._folder: Path | None = None
        self.lead = QLabel(self)
        self.lead.setObjectName("reportLead")
        self.lead.setWordWrap(True)
        self.lead.setTextFormat(Qt.TextFormat.RichText)
        self.outside = QPushButton("Open in the browser", self)
        self.outside.setObjectName("reportOutside")
        self.outside.setToolTip("The whole page, with pictures that can be flipped")
        self.outside.clicked.connect(self._open_outside)
        self.list = QListWidget(self)
        self.list.setObjectName("reportSections")
        self.list.setAccessibleName("Sections of the report")
        self.list.setToolTip("Sections of the report")
        self.list.currentRowChanged.connect(self._show)
        self.text = TextView(self)
        self.text.setObjectName("reportText")
        self.text.setAccessibleName("Text of the section")
        self.text.setOpenLinks(False)
        self.text.anchorClicked.connect(self._follow)
        left = QWidget(self)
        side = QVBoxLayout(left)
        side.setContentsMargins(0, 0, 0, 0)
        side.addWidget(self.list, 1)
        side.addWidget(self.outside)
        split = QSplitter(Qt.Orientation.Horizontal, self)
        split.addWidget(left)
        split.addWidget(self.text)
        split.setStretchFactor(1, 1)
        split.setSizes([theme.em(14), theme.em(46)])
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.lead)
        column.addWidget(split, 1)
        self.set_report(None, None)

    def set_report(self, report: Report | None, folder: Path | None) -> None:
        """Lists its sections and shows the first; None: there is none yet."""
        self._report, self._folder = report, folder
        self.list.clear()
        page = folder / "report.html" if folder is not None else None
        self.outside.setEnabled(page is not None and page.is_file())
        if report is None or folder is None:
            self.lead.setText("")
            self.text.setPlainText(NONE_YET)
            return
        self.lead.setText(plain_html(report.lead, folder / "figures"))
        self.text.document().setBaseUrl(QUrl.fromLocalFile(f"{folder}/"))
        self.list.addItems([section.title for section in report.sections])
        self.list.setCurrentRow(0)

    def _show(self, row: int) -> None:
        if self._report is not None and self._folder is not None and row >= 0:
            self.text.setHtml(section_html(self._report.sections[row], self._folder))

    def _follow(self, url: QUrl) -> None:
        """To another section, or out."""
        keys = [section.key for section in self._report.sections] if self._report else []
        if url.isRelative() and not url.path():
            if url.fragment() in keys:
                self.list.setCurrentRow(keys.index(url.fragment()))
            else:
                self.text.scrollToAnchor(url.fragment())
        else:
            QDesktopServices.openUrl(self.text.document().baseUrl().resolved(url))

    def _open_outside(self) -> None:
        if self._folder is not None:
            QDesktopServices.openUrl(QUrl.fromLocalFile(str(self._folder / "report.html")))
