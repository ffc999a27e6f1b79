# SPDX-License-Identifier: Apache-2.0
"""Figures of a results folder: a list, and the chosen one as large as there is room."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QRectF, QSize, Qt, QUrl
from PySide6.QtGui import QDesktopServices, QImage, QMouseEvent, QPainter, QPaintEvent
from PySide6.QtSvg import QSvgRenderer
from PySide6.QtWidgets import QLabel, QListWidget, QListWidgetItem, QSplitter, QVBoxLayout, QWidget

from wavecomb.bench.report_parts import Figure, Report
from wavecomb.gui import theme
from wavecomb.gui.viewport.qimages import to_qimage
from wavecomb.gui.worker import Worker
from wavecomb.picture.image import read_codes


class FigureView(QWidget):
    """A PNG or SVG, scaled to what room there is; a double click opens the file."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("figure")
        self.setAccessibleName("Figure")
        self.setToolTip("Double click opens the file")
        self.image: QImage | None = None
        self._svg: QSvgRenderer | None = None
        self._path: Path | None = None
        self._words = ""
        self._reader = Worker("figure", self)
        self._reader.done.connect(lambda key, image: self._take(image))
        self._reader.failed.connect(lambda key, line: self.show_words(line))

    def show_file(self, path: Path) -> None:
        """Reads it off the UI thread; what is there stays until then."""
        self._path = path
        self._reader.submit(partial(_read, path), path)

    def shutdown(self) -> None:
        """Ends what is read."""
        self._reader.close()

    def show_words(self, words: str) -> None:
        """In place of a figure."""
        self._reader.cancel()
        self.image = self._svg = None
        self._words = words
        self.update()

    def _take(self, found: NDArray[np.uint8] | bytes) -> None:
        self.image = self._svg = None
        self._words = ""
        if not isinstance(found, bytes):
            self.image = to_qimage(found)
        else:
            self._svg = QSvgRenderer(found, self)
            if not self._svg.isValid():
                self.show_words(f"{self._path}: is no drawing that can be shown")
        self.update()

    def sizeHint(self) -> QSize:
        """The size of a readable figure."""
        return QSize(theme.em(40), theme.em(26))

    def target(self) -> QRectF:
        """Where the figure lies: in the middle, its shape kept, no larger than twice its size."""
        if self.image is not None:
            size = self.image.size()
        elif self._svg is not None:
            size = self._svg.defaultSize()
        else:
            return QRectF()
        room = QRectF(self.rect())
        scale = min(room.width() / size.width(), room.height() / size.height(), 2.0)
        width, height = size.width() * scale, size.height() * scale
        left = room.center().x() - width / 2
        return QRectF(left, room.center().y() - height / 2, width, height)

    def paintEvent(self, event: QPaintEvent) -> None:
        """On white, as figures are drawn for paper."""
        painter = QPainter(self)
        painter.fillRect(self.rect(), theme.surface())
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        target = self.target()
        if self.image is not None:
            painter.fillRect(target, Qt.GlobalColor.white)
            painter.drawImage(target, self._scaled(target))
        elif self._svg is not None:
            painter.fillRect(target, Qt.GlobalColor.white)
            self._svg.render(painter, target)
        else:
            painter.setPen(theme.dim())
            flags = Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextWordWrap
            painter.drawText(self.rect(), int(flags), self._words)

    def _scaled(self, target: QRectF) -> QImage:
        """Smooth where it is much smaller: painting alone would skip pixels."""
        assert self.image is not None
        ratio = self.devicePixelRatioF()
        size = QSize(round(target.width() * ratio), round(target.height() * ratio))
        if size.width() >= self.image.width() or size.isEmpty():
            return self.image
        return self.image.scaled(
            size,
            Qt.AspectRatioMode.IgnoreAspectRatio,
            Qt.TransformationMode.SmoothTransformation,
        )

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        """Opens the file with what the desktop has for it."""
        if self._path is not None:
            QDesktopServices.openUrl(QUrl.fromLocalFile(str(self._path)))


def _read(path: Path) -> NDArray[np.uint8] | bytes:
    """A drawing as its file is; a picture as codes on white, (height, width, 3)."""
    if path.suffix.lower() == ".svg":
        return path.read_bytes()
    return read_codes(path)


class Figures(QSplitter):
    """The figures of a report: a list, the chosen one and its caption."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(Qt.Orientation.Horizontal, parent)
        self.setObjectName("figures")
        self._folder: Path | None = None
        self.list = QListWidget(self)
        self.list.setObjectName("figureList")
        self.list.setAccessibleName("Figures")
        self.list.setToolTip("Figures of the report")
        self.view = FigureView(self)
        self.caption = QLabel(self)
        self.caption.setObjectName("figureCaption")
        self.caption.setWordWrap(True)
        self.caption.setTextFormat(Qt.TextFormat.PlainText)
        self.caption.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        right = QWidget(self)
        column = QVBoxLayout(right)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.view, 1)
        column.addWidget(self.caption)
        self.addWidget(self.list)
        self.addWidget(right)
        self.setStretchFactor(1, 1)
        self.setSizes([theme.em(14), theme.em(46)])
        self.list.currentItemChanged.connect(self._show)
        self.set_report(None, None)

    def set_report(self, report: Report | None, folder: Path | None) -> None:
        """Lists the figures of a report, by section; ``folder`` holds their files."""
        self._folder = folder
        self.list.clear()
        self.caption.setText("")
        self.view.show_words('No figures yet: "Make the report" draws them.')
        first = None
        for section in report.sections if report is not None else ():
            figures = [part for part in section.parts if isinstance(part, Figure)]
            if figures:
                self._add_heading(section.title)
            for figure in figures:
                item = QListWidgetItem(figure.title, self.list)
                item.setData(Qt.ItemDataRole.UserRole, figure)
                first = first or item
        if first is not None:
            self.list.setCurrentItem(first)

    def _add_heading(self, title: str) -> None:
        item = QListWidgetItem(title, self.list)
        item.setFlags(Qt.ItemFlag.NoItemFlags)
        font = item.font()
        font.setBold(True)
        item.setFont(font)

    def _show(self, item: QListWidgetItem | None, before: QListWidgetItem | None) -> None:
        figure = item.data(Qt.ItemDataRole.UserRole) if item is not None else None
        if not isinstance(figure, Figure) or self._folder is None:
            return
        self.caption.setText(figure.caption)
        self.view.setAccessibleName(f"Figure {figure.title}")
        # Qt's SVG has no clip paths and style sheets, which these drawings use.
        for suffix in (".png", ".svg"):
            path = self._folder / f"{figure.name}{suffix}"
            if path.is_file():
                self.view.show_file(path)
                return
        self.view.show_words(f"{self._folder / figure.name}.png: is not there; make the report")
