# SPDX-License-Identifier: Apache-2.0
"""A results folder of `wavecomb bench`: figures, runs, pages, pictures, machine; two folders."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QDragEnterEvent, QDropEvent
from PySide6.QtWidgets import (
    QFileDialog,
    QHBoxLayout,
    QLabel,
    QListWidget,
    QListWidgetItem,
    QMenu,
    QPushButton,
    QTabWidget,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from wavecomb.gui import theme
from wavecomb.gui.bench.figures import Figures
from wavecomb.gui.bench.folder import BenchFolder, Shot, read_folder
from wavecomb.gui.bench.page import plain_html
from wavecomb.gui.bench.pages import Pages, TextView
from wavecomb.gui.bench.recent_folders import recent_folders, remember_folder
from wavecomb.gui.bench.report_view import ReportView
from wavecomb.gui.bench.tables import RunsTable
from wavecomb.gui.bench.two import TwoFolders
from wavecomb.gui.command import Command
from wavecomb.gui.widgets import set_text_colour
from wavecomb.gui.worker import Worker


class BenchBrowser(QWidget):
    """Opens folders; all reading and drawing is off the UI thread.

    Signals:
        opened(BenchFolder): It is shown.
        failed(str): One line that says what to do.
        compare(a, b): Two picture files to compare; a may be None.
    """

    opened = Signal(object)
    failed = Signal(str)
    compare = Signal(object, object)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("benchBrowser")
        self.setAcceptDrops(True)
        self.folder: BenchFolder | None = None
        self._reader = Worker("folder", self)
        self._reader.done.connect(lambda key, folder: self._show(folder))
        self._reader.failed.connect(lambda key, line: self._fail(line))
        self._report = Command(self)
        self._report.finished.connect(self._reported)
        self._reported_folder: Path | None = None
        self.report_view = ReportView(self)
        self.figures = Figures(self)
        self.runs = RunsTable("runs", self)
        self.pages = Pages(self)
        self.shots = QListWidget(self)
        self.shots.setObjectName("shots")
        self.shots.setAccessibleName("Pictures")
        self.shots.setToolTip("Double click compares a picture with its converged one")
        self.shots.itemActivated.connect(self._compare)
        self.machine = TextView(self)
        self.machine.setObjectName("machine")
        self.machine.setAccessibleName("Machine")
        self.two = TwoFolders(self)
        self.tabs = QTabWidget(self)
        self.tabs.setObjectName("benchTabs")
        self._lay_out()

    def _lay_out(self) -> None:
        for widget, title, tip in (
            (self.report_view, "Report", "What `wavecomb bench report` says"),
            (self.figures, "Figures", "Figures of the report"),
            (self.runs, "Runs", "All runs, as in runs.csv"),
            (self.pages, "Pages", "The suite and other texts"),
            (self.shots, "Pictures", "Pictures of runs, and converged ones"),
            (self.machine, "Machine", "What the figures were made on and with"),
            (self.two, "Two folders", "What changed from another folder to this one"),
        ):
            self.tabs.setTabToolTip(self.tabs.addTab(widget, title), tip)
        self._title = self._label("benchTitle")
        self._warnings = self._label("benchWarnings")
        self._error = self._label("benchError")
        row = QHBoxLayout()
        open_button = self._button("benchOpen", "Open ...", "A folder of results, or drop it here")
        open_button.clicked.connect(self.ask)
        self._recent = QToolButton(self)
        self._recent.setObjectName("benchRecent")
        self._recent.setText("Recent")
        self._recent.setToolTip("Folders that were opened before")
        self._recent.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        menu = QMenu(self._recent)
        menu.aboutToShow.connect(self._list_recent)
        self._recent.setMenu(menu)
        self._reload = self._button("benchReload", "Read again", "From the disk")
        self._reload.clicked.connect(self.reload)
        self.report_button = self._button(
            "benchReport", "Make the report", "`wavecomb bench report`: figures and a page"
        )
        self.report_button.clicked.connect(self.report)
        row.addWidget(self._title, 1)
        for widget in (open_button, self._recent, self._reload, self.report_button):
            row.addWidget(widget, 0, Qt.AlignmentFlag.AlignTop)
        column = QVBoxLayout(self)
        column.addLayout(row)
        column.addWidget(self._error)
        column.addWidget(self._warnings)
        column.addWidget(self.tabs, 1)
        self._title.setText("Open or drop a folder that `wavecomb bench run` has written.")
        self._enable(False)

    def _label(self, name: str) -> QLabel:
        label = QLabel(self)
        label.setObjectName(name)
        label.setTextFormat(Qt.TextFormat.PlainText)
        label.setWordWrap(True)
        label.setVisible(name == "benchTitle")
        return label

    def _button(self, name: str, text: str, tip: str) -> QPushButton:
        button = QPushButton(text, self)
        button.setObjectName(name)
        button.setToolTip(tip)
        return button

    def _enable(self, there: bool) -> None:
        for widget in (self._reload, self.report_button, self.tabs):
            widget.setEnabled(there)

    # ---- what others call ----------------------------------------------------------------------

    def ask(self) -> None:
        """A dialog for a folder; it blocks nothing else."""
        dialog = QFileDialog(self, "Results of a benchmark")
        dialog.setFileMode(QFileDialog.FileMode.Directory)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.fileSelected.connect(lambda path: self.open(Path(path)))
        dialog.open()

    def open(self, path: Path) -> None:
        """Reads a folder; what is shown stays until then."""
        self._error.hide()
        self._reader.submit(partial(read_folder, path), path)

    def reload(self) -> None:
        """Reads the folder again."""
        if self.folder is not None:
            self.open(self.folder.path)

    def report(self) -> None:
        """Makes the report, and shows it."""
        if self.folder is not None and not self._report.running:
            self._error.hide()
            self._reported_folder = self.folder.path
            self.report_button.setEnabled(False)
            self.report_button.setText("Making the report ...")
            self._report.start(["bench", "report", str(self.folder.path)])

    @property
    def busy(self) -> bool:
        """Whether something is read or made."""
        return self._reader.busy or self._report.running or self.two.busy

    def shutdown(self) -> None:
        """Ends what runs."""
        self._reader.close()
        self.figures.view.shutdown()
        self.pages.shutdown()
        self._report.shutdown()
        self.two.shutdown()

    # ---- inside --------------------------------------------------------------------------------

    def _show(self, folder: BenchFolder) -> None:
        self.folder = folder
        remember_folder(folder.path)
        figures = folder.report.figures() if folder.report is not None else []
        counts = f"{len(folder.runs)} runs, {len(figures)} figures"
        title = f" - {folder.title}" if folder.title else ""
        self._title.setText(f"{folder.name}{title}\n{folder.path}: {counts}")
        self._warnings.setText("\n".join(folder.warnings))
        self._warnings.setVisible(bool(folder.warnings))
        set_text_colour(self._warnings, theme.warning())
        self.report_view.set_report(folder.report, folder.path)
        self.figures.set_report(folder.report, folder.path / "figures")
        self.runs.set_rows(folder.columns, folder.runs)
        self.pages.set_pages(folder.pages)
        self.machine.setHtml(plain_html(folder.machine, folder.path / "figures"))
        self.shots.clear()
        for shot in folder.shots:
            item = QListWidgetItem(shot.name, self.shots)
            item.setData(Qt.ItemDataRole.UserRole, shot)
            beside = f"\nwith {shot.golden.name}" if shot.golden is not None else ""
            item.setToolTip(f"{shot.path}{beside}")
        self.two.set_after(folder.path)
        self._enable(True)
        self.opened.emit(folder)

    def _compare(self, item: QListWidgetItem) -> None:
        shot = item.data(Qt.ItemDataRole.UserRole)
        if isinstance(shot, Shot):
            pair = (None, shot.path) if shot.golden is None else (shot.path, shot.golden)
            self.compare.emit(*pair)

    def _reported(self, code: int, text: str, error: str) -> None:
        self.report_button.setEnabled(True)
        self.report_button.setText("Make the report")
        if error:
            self._fail(error)
        elif self.folder is not None and self.folder.path == self._reported_folder:
            self.reload()

    def _list_recent(self) -> None:
        menu = self._recent.menu()
        menu.clear()
        for path in recent_folders():
            menu.addAction(str(path), lambda path=path: self.open(path))
        if menu.isEmpty():
            menu.addAction("None yet").setEnabled(False)

    def _fail(self, message: str) -> None:
        set_text_colour(self._error, theme.error())
        self._error.setText(message)
        self._error.show()
        self.failed.emit(message)

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        """Folders are welcome."""
        if event.mimeData().hasUrls():
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        """One: opened. Two: the first is compared with the second."""
        paths = [Path(url.toLocalFile()) for url in event.mimeData().urls() if url.isLocalFile()]
        if paths:
            event.acceptProposedAction()
            self.open(paths[-1])
        if len(paths) == 2:
            self.two.set_before(paths[0])
            self.tabs.setCurrentWidget(self.two)
