# SPDX-License-Identifier: Apache-2.0
"""Which suite is run, on which stages, how often, and where results go."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtWidgets import (
    QComboBox,
    QFileDialog,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QListWidget,
    QListWidgetItem,
    QSpinBox,
    QToolButton,
    QWidget,
)

from wavecomb.gui import theme
from wavecomb.gui.bench.suites import Choice, SuiteInfo, suite_info, suite_infos
from wavecomb.gui.worker import Worker
from wavecomb.run.progress import time_text


class SuiteChoice(QWidget):
    """A form.

    Signals:
        changed(): Something else is chosen.
        failed(str): One line that says what to do.
    """

    changed = Signal()
    failed = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("suiteChoice")
        self._infos: dict[str, SuiteInfo] = {}
        self._wanted: str | None = None
        self._reader = Worker("suites", self)
        self._reader.done.connect(self._take)
        self._reader.failed.connect(lambda key, line: self.failed.emit(line))
        self.suite = QComboBox(self)
        self.suite.setObjectName("suite")
        self.suite.setAccessibleName("Suite")
        self.suite.setToolTip("Suites of `wavecomb bench list`, the quickest first")
        self.suite.currentIndexChanged.connect(self._show)
        self.about = QLabel("Reading the suites ...", self)
        self.about.setObjectName("suiteAbout")
        self.about.setWordWrap(True)
        self.stages = QListWidget(self)
        self.stages.setObjectName("suiteStages")
        self.stages.setAccessibleName("Stages")
        self.stages.setToolTip("Stages of the suite that are run")
        self.stages.setFlow(QListWidget.Flow.LeftToRight)
        self.stages.setWrapping(True)
        self.stages.setResizeMode(QListWidget.ResizeMode.Adjust)
        self.stages.setMaximumHeight(theme.em(4.4))
        self.stages.setSpacing(2)
        self.stages.itemChanged.connect(self._on_changed)
        self.repetitions = QSpinBox(self)
        self.repetitions.setObjectName("suiteRepetitions")
        self.repetitions.setAccessibleName("Repetitions")
        self.repetitions.setToolTip("Of each configuration; below 5, intervals are wide")
        self.repetitions.setRange(1, 1000)
        self.repetitions.valueChanged.connect(self._on_changed)
        self.folder = self._line("suiteFolder", "Folder for results", "Made if it is not there")
        self.more = self._line(
            "suiteMoreStages", "Folder of further stages", "USD files that are run besides"
        )
        form = QFormLayout(self)
        form.setContentsMargins(0, 0, 0, 0)
        form.addRow("Suite", self._row(self.suite, self._tool("suiteFile", self._ask_suite)))
        form.addRow("", self.about)
        form.addRow("Stages", self.stages)
        form.addRow("More stages", self._row(self.more, self._tool("askMore", self._ask_more)))
        form.addRow("Repetitions", self.repetitions)
        form.addRow("Results", self._row(self.folder, self._tool("askFolder", self._ask_folder)))
        self._reader.submit(suite_infos, "all")

    def _line(self, name: str, accessible: str, tip: str) -> QLineEdit:
        line = QLineEdit(self)
        line.setObjectName(name)
        line.setAccessibleName(accessible)
        line.setToolTip(tip)
        line.setPlaceholderText(accessible)
        line.textChanged.connect(lambda text: self.changed.emit())
        return line

    def _tool(self, name: str, call: object) -> QToolButton:
        button = QToolButton(self)
        button.setObjectName(name)
        button.setText("...")
        tip = {"suiteFile": "A suite of your own: a TOML file"}.get(name, "Choose a folder")
        button.setToolTip(tip)
        button.setAccessibleName(tip)
        button.clicked.connect(call)
        return button

    @staticmethod
    def _row(first: QWidget, second: QWidget) -> QHBoxLayout:
        row = QHBoxLayout()
        row.addWidget(first, 1)
        row.addWidget(second)
        return row

    # ---- what others call ----------------------------------------------------------------------

    def info(self) -> SuiteInfo | None:
        """The suite that is chosen."""
        return self._infos.get(str(self.suite.currentData()))

    def chosen_stages(self) -> list[str]:
        """Names of those with a tick."""
        items = [self.stages.item(k) for k in range(self.stages.count())]
        return [i.text() for i in items if i.checkState() == Qt.CheckState.Checked]

    def choice(self, *, quiet: bool = False) -> Choice | None:
        """What is chosen; None, and ``failed`` unless ``quiet``, where something is missing."""
        info = self.info()
        stages = self.chosen_stages()
        folder, more = self.folder.text().strip(), self.more.text().strip()
        problem = ""
        if info is None:
            problem = "no suite is chosen"
        elif not stages:
            problem = "no stage is chosen: tick one at least"
        elif not folder:
            problem = "choose a folder for the results"
        if problem or info is None:
            if not quiet:
                self.failed.emit(problem)
            return None
        repetitions = self.repetitions.value()
        return Choice(
            suite=info.name,
            folder=Path(folder).expanduser(),
            stages=() if len(stages) == len(info.stages) else tuple(stages),
            more_stages=Path(more).expanduser() if more else None,
            repetitions=repetitions if repetitions != info.repetitions else None,
        )

    def set_choice(self, suite: str, folder: Path) -> None:
        """Chooses a suite, by name or file, and a folder."""
        self.folder.setText(str(folder))
        self._want(suite)

    def shutdown(self) -> None:
        """Ends what is read."""
        self._reader.close()

    # ---- inside --------------------------------------------------------------------------------

    def _want(self, suite: str) -> None:
        if suite in self._infos:
            self.suite.setCurrentIndex(self.suite.findData(suite))
        elif suite.endswith(".toml"):
            self._wanted = suite
            self._reader.submit(partial(_one_suite, suite), suite)
        else:
            self._wanted = suite

    def _take(self, key: object, infos: list[SuiteInfo]) -> None:
        self.suite.blockSignals(True)
        for info in infos:
            if info.name not in self._infos:
                name = Path(info.name).name if info.name.endswith(".toml") else info.name
                self.suite.addItem(f"{name} - {info.title}", info.name)
            self._infos[info.name] = info
        self.suite.blockSignals(False)
        wanted = self._wanted if self._wanted in self._infos else None
        if wanted is not None:
            self._wanted = None
            self.suite.setCurrentIndex(self.suite.findData(wanted))
        elif self._wanted is not None and self._wanted.endswith(".toml"):
            self._want(self._wanted)
        self._show()

    def _show(self) -> None:
        info = self.info()
        if info is None:
            return
        for widget in (self.stages, self.repetitions):
            widget.blockSignals(True)
        self.stages.clear()
        for name in info.stages:
            item = QListWidgetItem(name, self.stages)
            item.setFlags(item.flags() | Qt.ItemFlag.ItemIsUserCheckable)
            item.setCheckState(Qt.CheckState.Checked)
            item.setSizeHint(
                QSize(theme.em(2.2) + self.fontMetrics().horizontalAdvance(name), theme.em(1.6))
            )
        self.repetitions.setValue(info.repetitions)
        for widget in (self.stages, self.repetitions):
            widget.blockSignals(False)
        if not self.folder.text():
            self.folder.setText(str(Path.cwd() / "results" / Path(info.name).stem))
        self._on_changed()

    def _on_changed(self) -> None:
        info = self.info()
        if info is not None:
            share = len(self.chosen_stages()) / max(len(info.stages), 1)
            runs = info.configurations * self.repetitions.value()
            seconds = info.seconds * self.repetitions.value() * share
            parts = ", ".join(f"{name} {count}" for name, count in info.experiments)
            self.about.setText(
                f"{info.configurations} configurations ({parts}); with {self.repetitions.value()} "
                f"repetitions {runs} runs on all stages. Roughly {time_text(seconds)} for the "
                "stages chosen, and what stages and converged pictures take to make."
            )
        self.changed.emit()

    def _ask(self, mode: QFileDialog.FileMode, title: str, take: object) -> None:
        dialog = QFileDialog(self, title)
        dialog.setFileMode(mode)
        if mode == QFileDialog.FileMode.ExistingFile:
            dialog.setNameFilter("Suites (*.toml)")
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.fileSelected.connect(take)
        dialog.open()

    def _ask_suite(self) -> None:
        self._ask(QFileDialog.FileMode.ExistingFile, "A suite", self._want)

    def _ask_folder(self) -> None:
        self._ask(QFileDialog.FileMode.Directory, "Folder for results", self.folder.setText)

    def _ask_more(self) -> None:
        self._ask(QFileDialog.FileMode.Directory, "Folder of further stages", self.more.setText)


def _one_suite(suite: str) -> list[SuiteInfo]:
    return [suite_info(suite)]
