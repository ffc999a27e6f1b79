# SPDX-License-Identifier: Apache-2.0
"""The form of the benchmark panel: suite, stages, repetitions and results folder."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import Qt, Signal
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
    QWidget,
)

from wavecomb.errors import WavecombError
from wavecomb.gui import theme
from wavecomb.gui.widgets import ask_file, named, set_quietly, tool
from wavecomb.gui.worker import Worker
from wavecomb.run.progress import time_text


@dataclass(frozen=True)
class SuiteInfo:
    """Facts about a suite.

    Attributes:
        name: Suite name from `wavecomb bench list`, or the path of a TOML file.
        title: Title of the suite in one line.
        stages: Names of the stages of the suite.
        repetitions: Default number of repetitions.
        configurations: Number of configurations on this machine.
        seconds: Rough estimate of the seconds for one repetition of all configurations, at 0.4
            million samples per second and thread. It does not include preparing stages and golden
            images.
        experiments: Name and number of configurations of each experiment.
    """

    name: str
    title: str
    stages: tuple[str, ...]
    repetitions: int
    configurations: int
    seconds: float
    experiments: tuple[tuple[str, int], ...]


def suite_infos() -> list[SuiteInfo]:
    """Returns the suites that come with Wavecomb, the fastest first."""
    from wavecomb.bench.suite import suite_names

    found = []
    for name in suite_names():
        try:
            found.append(suite_info(name))
        except WavecombError:
            # Skip a suite that depends on a property of the machine that cannot be determined.
            continue
    return sorted(found, key=lambda info: info.seconds * info.repetitions)


def suite_info(name: str, stages: tuple[str, ...] = ()) -> SuiteInfo:
    """Reads a suite by name or TOML file, restricted to some stages.

    Raises:
        WavecombError: The suite is invalid. The message of the error is one line.
    """
    from wavecomb.bench.machine import limits
    from wavecomb.bench.plan import Estimator, configurations
    from wavecomb.bench.suite import find_suite, load_suite
    from wavecomb.bench.suite_model import only_stages

    suite = load_suite(find_suite(name))
    configs = configurations(only_stages(suite, stages), limits())
    estimator = Estimator()
    names = [config.experiment for config in configs]
    return SuiteInfo(
        name=name,
        title=suite.title or suite.name,
        stages=tuple(suite.stages),
        repetitions=suite.repetitions,
        configurations=len(configs),
        seconds=sum(estimator.seconds(config) for config in configs),
        experiments=tuple((name, names.count(name)) for name in dict.fromkeys(names)),
    )


@dataclass(frozen=True)
class Choice:
    """Arguments of a benchmark.

    Attributes:
        suite: Name of the suite, or path of its TOML file.
        folder: Results folder.
        stages: Stages to run; an empty list means all stages.
        repetitions: Number of repetitions; None means the suite's default.
    """

    suite: str
    folder: Path
    stages: tuple[str, ...] = ()
    repetitions: int | None = None

    @property
    def resumes(self) -> bool:
        """Whether the folder holds results that the suite would resume."""
        return (self.folder / "runs.csv").is_file()

    def arguments(self, *, dry: bool = False) -> list[str]:
        """Returns the benchmark's arguments for the `wavecomb` command."""
        words = ["bench", "run", self.suite, "-o", str(self.folder)]
        for stage in self.stages:
            words += ["--stage", stage]
        if self.repetitions is not None:
            words += ["--repetitions", str(self.repetitions)]
        if self.resumes:
            words.append("--resume")
        return [*words, "--dry-run"] if dry else [*words, "--progress", "json"]


class SuiteChoice(QWidget):
    """Form for the arguments of a benchmark.

    Signals:
        changed(): Emitted when the user changes a field of the form.
        failed(str): Emitted on an error, with one line that says how to fix it.
    """

    changed = Signal()
    failed = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("suiteChoice")
        self._infos: dict[str, SuiteInfo] = {}
        self._reader = Worker("suites", self)
        self._reader.done.connect(self._take)
        self._reader.failed.connect(lambda key, line: self.failed.emit(line))
        self.suite = named(
            QComboBox(), "suite", "Suite", "Suites of `wavecomb bench list`, the fastest first"
        )
        self.suite.currentIndexChanged.connect(self._show)
        self.about = QLabel("Reading the suites ...", self)
        self.about.setObjectName("suiteAbout")
        self.about.setWordWrap(True)
        self.stages = named(QListWidget(), "suiteStages", "Stages", "Stages to run")
        self.stages.setFlow(QListWidget.Flow.LeftToRight)
        self.stages.setWrapping(True)
        self.stages.setResizeMode(QListWidget.ResizeMode.Adjust)
        self.stages.setMaximumHeight(theme.em(4.4))
        self.stages.setSpacing(2)
        self.stages.itemChanged.connect(self._on_changed)
        self.repetitions = named(
            QSpinBox(), "suiteRepetitions", "Repetitions",
            "Runs of each configuration; intervals are wide below 5",
        )  # fmt: skip
        self.repetitions.setRange(1, 1000)
        self.repetitions.valueChanged.connect(self._on_changed)
        title = "Folder for results"
        self.folder = named(QLineEdit(), "suiteFolder", title, "Created if it does not exist")
        self.folder.setPlaceholderText(title)
        self.folder.textChanged.connect(lambda text: self.changed.emit())
        form = QFormLayout(self)
        form.setContentsMargins(0, 0, 0, 0)
        tip = "Choose a TOML file with a custom suite"
        form.addRow("Suite", self._with_button(self.suite, "suiteFile", tip, self._ask_suite))
        form.addRow("", self.about)
        form.addRow("Stages", self.stages)
        form.addRow("Repetitions", self.repetitions)
        tip = "Choose a folder"
        form.addRow("Results", self._with_button(self.folder, "askFolder", tip, self._ask_folder))
        self._reader.submit(suite_infos, "all")

    @staticmethod
    def _with_button(
        field: QWidget, name: str, tip: str, call: Callable[[], object]
    ) -> QHBoxLayout:
        button = tool(name, "...", tip)
        button.clicked.connect(call)
        row = QHBoxLayout()
        row.addWidget(field, 1)
        row.addWidget(button)
        return row

    # ---- the choice ----------------------------------------------------------------------------

    def info(self) -> SuiteInfo | None:
        """Returns the chosen benchmark suite, or None."""
        return self._infos.get(str(self.suite.currentData()))

    def chosen_stages(self) -> list[str]:
        """Returns the names of the checked stages of the suite."""
        items = [self.stages.item(k) for k in range(self.stages.count())]
        return [i.text() for i in items if i.checkState() == Qt.CheckState.Checked]

    def results_folder(self) -> Path:
        """Returns the folder for the results of the benchmark."""
        return Path(self.folder.text().strip()).expanduser()

    def choice(self, *, quiet: bool = False) -> Choice | None:
        """Returns the arguments that the form describes.

        Returns None if the form is incomplete, and emits ``failed`` unless ``quiet`` is set.
        """
        info = self.info()
        stages = self.chosen_stages()
        problem = ""
        if info is None:
            problem = "no suite is chosen"
        elif not stages:
            problem = "no stage is chosen: check at least one"
        elif not self.folder.text().strip():
            problem = "choose a folder for the results"
        if problem or info is None:
            if not quiet:
                self.failed.emit(problem)
            return None
        repetitions = self.repetitions.value()
        return Choice(
            suite=info.name,
            folder=self.results_folder(),
            stages=() if len(stages) == len(info.stages) else tuple(stages),
            repetitions=repetitions if repetitions != info.repetitions else None,
        )

    def set_choice(self, suite: str, folder: Path) -> None:
        """Selects a suite of the list or a TOML file, and a results folder."""
        self.folder.setText(str(folder))
        self._choose_suite(suite)

    def shutdown(self) -> None:
        """Stops the thread that reads suites."""
        self._reader.close()

    # ---- inside --------------------------------------------------------------------------------

    def _take(self, key: object, infos: list[SuiteInfo]) -> None:
        self.suite.blockSignals(True)
        for info in infos:
            if info.name not in self._infos:
                name = Path(info.name).name if info.name.endswith(".toml") else info.name
                self.suite.addItem(f"{name} - {info.title}", info.name)
            self._infos[info.name] = info
        if key != "all":
            self.suite.setCurrentIndex(self.suite.findData(key))
        self.suite.blockSignals(False)
        self._show()

    def _show(self) -> None:
        info = self.info()
        if info is None:
            return
        self.stages.blockSignals(True)
        self.stages.clear()
        for name in info.stages:
            item = QListWidgetItem(name, self.stages)
            item.setFlags(item.flags() | Qt.ItemFlag.ItemIsUserCheckable)
            item.setCheckState(Qt.CheckState.Checked)
        self.stages.blockSignals(False)
        set_quietly(self.repetitions, info.repetitions)
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
                "chosen stages, plus the time to make stages and golden images."
            )
        self.changed.emit()

    def _ask_suite(self) -> None:
        ask_file(self, "Suite", "Suites (*.toml)", self._choose_suite)

    def _choose_suite(self, suite: str) -> None:
        if suite in self._infos:
            self.suite.setCurrentIndex(self.suite.findData(suite))
        else:
            self._reader.submit(lambda: [suite_info(suite)], suite)

    def _ask_folder(self) -> None:
        folder = QFileDialog.FileMode.Directory
        ask_file(self, "Folder for results", "", self.folder.setText, mode=folder)
