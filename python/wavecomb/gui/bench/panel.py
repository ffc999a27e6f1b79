# SPDX-License-Identifier: Apache-2.0
"""The benchmark panel: starts ``wavecomb bench run``, shows its progress and opens the report.

The report is an HTML page, which the window opens in the web browser (docs/bench-report.md).
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QPointF, QSize, Qt, QUrl, Signal
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import (
    QHBoxLayout,
    QLabel,
    QPlainTextEdit,
    QProgressBar,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from wavecomb.gui import theme
from wavecomb.gui.bench.choice import SuiteChoice
from wavecomb.gui.command import Command
from wavecomb.gui.widgets import TakesFiles, named, set_text_colour
from wavecomb.run.progress import time_text

if TYPE_CHECKING:
    from wavecomb.gui.viewport.session import Session

_PREPARES = {
    "stage": "Generating the stage",
    "golden": "Rendering the golden image",
    "trace": "Recording the oracle's trace",
    "warm-up": "Warming up",
}


class BenchPanel(TakesFiles, QWidget):
    """Panel with the options, the start and stop buttons, the progress and the log of a benchmark.

    The viewport pauses while a benchmark suite runs, since renders of the viewport would disturb
    the measurement.

    Signals:
        done(Path): Emitted after the report page was opened in a browser.
        failed(str): Emitted on an error, with one line that says how to fix it. The panel also
            shows this line.
    """

    done = Signal(object)
    failed = Signal(str)

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("benchPanel")
        self.setWindowTitle("Benchmarks")
        self.setAcceptDrops(True)
        self._session = session
        self._folder = Path()
        self._measuring = self._reporting = False
        self._runs = 0
        self._left = ""
        self._warnings: list[str] = []
        self.suite = Command(self)
        self.suite.event.connect(self._take)
        self.suite.said.connect(self._log_line)
        self.suite.finished.connect(self._end_suite)
        # Process that estimates the duration of a suite and writes its report.
        self.helper = Command(self)
        self.helper.finished.connect(self._end_helper)
        self.choice = SuiteChoice(self)
        self.choice.failed.connect(self._fail)
        self.choice.changed.connect(self._show_choice)
        session.state_changed.connect(self._keep_paused)
        self._lay_out()
        self._show_choice()

    def _lay_out(self) -> None:
        buttons = QHBoxLayout()
        self.buttons = {}
        for name, text, tip, call in (
            ("benchStart", "Start", "Runs the suite in the background, then opens its report",
             self.start),
            ("benchCancel", "Stop", "Discards the current run; the suite can be resumed",
             self.cancel),
            ("benchEstimate", "Estimate the time", "Uses results in the folder, or else a "
             "calibration of some seconds", self.estimate),
            ("benchReport", "Open the report", "Opens report.html of the results folder in the "
             "browser; makes it first if it is missing or older than the results",
             self.open_report),
        ):  # fmt: skip
            self.buttons[name] = named(QPushButton(text), name, text, tip)
            self.buttons[name].clicked.connect(call)
            buttons.addWidget(self.buttons[name])
        buttons.addStretch(1)
        self.note, self.state = QLabel(self), QLabel(self)
        self.note.setObjectName("benchNote")
        self.state.setObjectName("benchState")
        self.state.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        for label in (self.note, self.state):
            label.setTextFormat(Qt.TextFormat.PlainText)
            label.setWordWrap(True)
        self.bar = named(QProgressBar(self), "benchProgress", "Finished runs", "Finished runs")
        self.bar.setValue(0)
        self.log = named(QPlainTextEdit(self), "benchLog", "Log", "Output of the benchmark")
        self.log.setReadOnly(True)
        self.log.setMaximumBlockCount(5000)
        column = QVBoxLayout(self)
        column.addWidget(self.choice)
        column.addWidget(self.note)
        column.addLayout(buttons)
        column.addWidget(self.bar)
        column.addWidget(self.state)
        column.addWidget(self.log, 1)

    def sizeHint(self) -> QSize:
        """Returns a preferred size that fits the form and a few lines of the log."""
        return QSize(theme.em(64), theme.em(36))

    # ---- actions -------------------------------------------------------------------------------

    @property
    def busy(self) -> bool:
        """Whether a suite is running, or a report or a time estimate is in preparation."""
        return self.suite.running or self.helper.running

    def start(self) -> None:
        """Starts the chosen benchmark suite, or resumes the suite if its results already exist."""
        choice = self.choice.choice()
        if choice is None or self.suite.running:
            return
        self._folder = choice.folder
        self._warnings = []
        self._runs, self._left = 0, ""
        self.helper.stop()
        self.log.clear()
        self._say("Starting ...")
        self.bar.setRange(0, 0)
        self._enable(False)
        self._measuring = True
        self._pause()
        words = choice.arguments()
        self._log_line("wavecomb " + " ".join(words))
        self.suite.start(words)

    def cancel(self) -> None:
        """Stops the benchmark suite; the Start button resumes it."""
        if self.suite.running:
            self._say("Stopping ...")
            self.suite.stop()

    def estimate(self) -> None:
        """Runs ``wavecomb bench run --dry-run`` and shows the estimated run time."""
        choice = self.choice.choice()
        if choice is not None and not self.busy:
            self._reporting = False
            self._say("Estimating ...")
            self.helper.start(choice.arguments(dry=True))

    def open_report(self, folder: Path | None = None) -> None:
        """Opens the report of a results folder in the web browser, making the report if necessary.

        Args:
            folder: Results folder; None means the folder that is entered in the form.
        """
        if self.busy:
            return
        self._folder = folder or self.choice.results_folder()
        runs, page = self._folder / "runs.csv", self._folder / "report.html"
        if not runs.is_file():
            self._fail(f"{self._folder}: holds no results (no runs.csv); choose another folder")
        elif page.is_file() and page.stat().st_mtime >= runs.stat().st_mtime:
            self._open_page()
        else:
            self._reporting = True
            self._say("Making the report ...")
            self.helper.start(["bench", "report", str(self._folder)])

    def shutdown(self) -> None:
        """Stops all processes that the panel started. A stopped benchmark suite can be resumed."""
        self._measuring = False
        self.choice.shutdown()
        self.suite.shutdown()
        self.helper.shutdown()

    def take_files(self, paths: list[str], at: QPointF) -> None:
        """Opens the report of a results folder that was dropped on the panel."""
        self.open_report(Path(paths[0]))

    # ---- messages of the processes -------------------------------------------------------------

    def _take(self, event: dict[str, Any]) -> None:
        kind = event["event"]
        if kind == "prepare":
            self._say(f"{_PREPARES.get(event['what'], event['what'])}: {event['name']}")
        elif kind == "plan":
            self._runs = int(event["runs"])
            self.bar.setRange(0, max(self._runs, 1))
            self.bar.setValue(0)
            before = f", {event['done']} are done already" if event["done"] else ""
            self._say(f"{self._runs} runs{before}; about {time_text(event['seconds_left'])}")
        elif kind == "begin":
            self._say(f"Run {event['number']} of {self._runs}: {event['run']}{self._left}")
        elif kind == "run":
            self.bar.setValue(int(event["number"]))
            self._left = f"; about {time_text(event['seconds_left'])} left"
            if event["status"] != "ok":
                self._warnings.append(f"{event['run']} failed: {event['error']}")
        elif kind == "done" and event["failed"]:
            self._warnings.append(f"{event['failed']} runs failed; Start tries them again")

    def _end_suite(self, code: int, text: str, error: str) -> None:
        self._measuring = False
        # Resume the viewport's render, which was paused for the benchmark, unless the user has
        # stopped it.
        if self._session.state != "stopped":
            self._session.resume()
        self._enable(True)
        self.bar.setRange(0, max(self._runs, 1))
        self.bar.setValue(self._runs if code == 0 else self.bar.value())
        self._show_choice()
        if code == 130:
            self._say("Stopped. Start resumes the suite.")
        elif error:
            self._fail(error)
        else:
            self.open_report(self._folder)

    def _end_helper(self, code: int, text: str, error: str) -> None:
        if code == 130 or self.suite.running:
            return
        if error:
            self._fail(error)
        elif self._reporting:
            self._open_page()
        else:
            lines = text.strip().splitlines()
            self._say(lines[-1] if lines else "No estimate.")
            for line in lines:
                self._log_line(line)

    def _open_page(self) -> None:
        page = (self._folder / "report.html").resolve()
        QDesktopServices.openUrl(QUrl.fromLocalFile(str(page)))
        self._say("; but ".join([f"Opened {page} in the browser", *self._warnings]))
        self.done.emit(page)

    # ---- helpers -------------------------------------------------------------------------------

    def _keep_paused(self, state: str) -> None:
        if self._measuring and state == "rendering":
            self._pause()

    def _pause(self) -> None:
        if self._session.state == "rendering":
            self._log_line("The viewport is paused: it would disturb the measurement.")
        self._session.pause()

    def _enable(self, idle: bool) -> None:
        self.choice.setEnabled(idle)
        for name, button in self.buttons.items():
            button.setEnabled(idle != (name == "benchCancel"))

    def _show_choice(self) -> None:
        choice = self.choice.choice(quiet=True)
        resumes = choice is not None and choice.resumes
        self.buttons["benchStart"].setText("Resume" if resumes else "Start")
        self._enable(not self.suite.running)
        self.note.setText(
            ("The folder holds results: only missing runs will be made. " if resumes else "")
            + "The viewport pauses while a suite runs. Leave the machine idle meanwhile: runs "
            "that other programs disturb are marked as noisy."
        )

    def _log_line(self, line: str) -> None:
        self.log.appendPlainText(line)

    def _say(self, text: str) -> None:
        set_text_colour(self.state, theme.text())
        self.state.setText(text)

    def _fail(self, message: str) -> None:
        set_text_colour(self.state, theme.error())
        self.state.setText(message)
        self.failed.emit(message)
