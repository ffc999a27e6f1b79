# SPDX-License-Identifier: Apache-2.0
"""Pages of a results folder in a text browser."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from PySide6.QtCore import Qt, QUrl
from PySide6.QtGui import QDesktopServices, QImage, QTextDocument
from PySide6.QtWidgets import (
    QComboBox,
    QHBoxLayout,
    QPushButton,
    QTextBrowser,
    QVBoxLayout,
    QWidget,
)

from wavecomb.gui.bench.page import page_html
from wavecomb.gui.worker import Worker


class TextView(QTextBrowser):
    """Pictures of the page's own folder, no wider than the view."""

    def loadResource(self, kind: int, name: Any) -> Any:
        """A picture that fits."""
        found = super().loadResource(kind, name)
        if kind != QTextDocument.ResourceType.ImageResource.value:
            return found
        url = self.document().baseUrl().resolved(name)
        image = QImage(url.toLocalFile()) if url.isLocalFile() else QImage()
        room = self.viewport().width() - 40
        if not image.isNull() and image.width() > room > 0:
            ratio = self.devicePixelRatioF()
            if image.width() > room * ratio:
                mode = Qt.TransformationMode.SmoothTransformation
                image = image.scaledToWidth(round(room * ratio), mode)
            image.setDevicePixelRatio(image.width() / room)
        return image if not image.isNull() else found


class Pages(QWidget):
    """Which page, and the page. Links that lead out of the folder open in the desktop's browser."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("pages")
        self.choice = QComboBox(self)
        self.choice.setObjectName("pageChoice")
        self.choice.setAccessibleName("Page")
        self.choice.setToolTip("Pages of this folder")
        self.outside = QPushButton("Open in the browser", self)
        self.outside.setObjectName("pageOutside")
        self.outside.setToolTip("The whole page with what a text view cannot show")
        self.text = TextView(self)
        self.text.setObjectName("pageText")
        self.text.setAccessibleName("Text of the page")
        self.text.setOpenLinks(False)
        self.text.anchorClicked.connect(self._follow)
        self._reader = Worker("page", self)
        self._reader.done.connect(self._show)
        self._reader.failed.connect(lambda key, line: self.text.setPlainText(line))
        self._paths: Sequence[Path] = ()
        self.choice.currentIndexChanged.connect(self._load)
        self.outside.clicked.connect(self._open_outside)
        row = QHBoxLayout()
        row.addWidget(self.choice, 1)
        row.addWidget(self.outside)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addLayout(row)
        column.addWidget(self.text, 1)

    def shutdown(self) -> None:
        """Ends what is read."""
        self._reader.close()

    def set_pages(self, paths: Sequence[Path]) -> None:
        """Lists them and shows the first."""
        self._paths = paths
        self.choice.blockSignals(True)
        self.choice.clear()
        self.choice.addItems([path.name for path in paths])
        self.choice.blockSignals(False)
        self.outside.setEnabled(bool(paths))
        if paths:
            self._load(0)
        else:
            self.text.setPlainText('No pages yet: "Make the report" writes one.')

    def _load(self, number: int) -> None:
        if 0 <= number < len(self._paths):
            path = self._paths[number]
            self._reader.submit(partial(_text, path), path)

    def _show(self, path: Path, text: tuple[str, str]) -> None:
        kind, content = text
        document = self.text.document()
        document.setBaseUrl(QUrl.fromLocalFile(str(path.parent) + "/"))
        if kind == "html":
            self.text.setHtml(content)
        elif kind == "md":
            self.text.setMarkdown(content)
        else:
            self.text.setPlainText(content)

    def _follow(self, url: QUrl) -> None:
        """Within the page, to another page of the folder, or out."""
        if url.isRelative() and not url.path():
            self.text.scrollToAnchor(url.fragment())
            return
        target = self.text.document().baseUrl().resolved(url)
        path = Path(target.toLocalFile()) if target.isLocalFile() else None
        if path is not None and path in self._paths:
            self.choice.setCurrentIndex(list(self._paths).index(path))
        else:
            QDesktopServices.openUrl(target)

    def _open_outside(self) -> None:
        number = self.choice.currentIndex()
        if 0 <= number < len(self._paths):
            QDesktopServices.openUrl(QUrl.fromLocalFile(str(self._paths[number])))


def _text(path: Path) -> tuple[str, str]:
    suffix = path.suffix.lower()
    if suffix in (".html", ".htm"):
        return "html", page_html(path)
    text = path.read_text(encoding="utf-8", errors="replace")
    return ("md" if suffix == ".md" else "text"), text
