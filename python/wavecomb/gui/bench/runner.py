# SPDX-License-Identifier: Apache-2.0
"""Starts `wavecomb bench run` in a process of its own, and shows how far it is."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QCheckBox,
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
from wavecomb.gui.widgets import set_text_colour
from wavecomb.run.progress import time_text

if TYPE_CHECKING:
    from wavecomb.gui.viewport.session import Session

_PREPARES = {
    "stage": "Making the stage",
    "golden": "Rendering the converged picture",
    "trace": "Recording the oracle's trace",
    "warm-up": "Warming up",
}


class BenchRunner(QWidget):
    """Choice, progress, log.

    The viewport stands still while it measures: a picture that renders beside it would be noise.

    Signals:
        done(Path): A folder holds new results.
        failed(str): One line that says what to do.
    """

    done = Signal(object)
    failed = Signal(str)

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("benchRunner")
        self._session = session
        self._measuring = False
        self._runs = 0
        self._warnings: list[str] = []
        self.command = Command(self)
        self.command.event.connect(self._take)
        self.command.said.connect(self._log_line)
        self.command.finished.connect(self._end)
        self._estimate = Command(self)
        self._estimate.finished.connect(self._estimated)
        self.choice = SuiteChoice(self)
        self.choice.failed.connect(self._fail)
        self.choice.changed.connect(self._show_choice)
        session.state_changed.connect(self._keep_still)
        self._lay_out()
        self._show_choice()

    def _lay_out(self) -> None:
        self.start_button = self._button("benchStart", "Start", "Runs the suite in the background")
        self.start_button.clicked.connect(self.start)
        self.cancel_button = self._button(
            "benchCancel", "Stop", "Ends after the run that goes on is thrown away; can be resumed"
        )
        self.cancel_button.clicked.connect(self.cancel)
        self.cancel_button.setEnabled(False)
        self.estimate_button = self._button(
            "benchEstimate",
            "Estimate the time",
            "From results in the folder, else from a calibration of some seconds",
        )
        self.estimate_button.clicked.connect(self.estimate)
        self.report = QCheckBox("Make the report at the end", self)
        self.report.setObjectName("benchMakeReport")
        self.report.setToolTip("Figures and a page, by `wavecomb bench report`")
        self.report.setChecked(True)
        self.note = self._label("benchNote")
        self.state = self._label("benchState")
        self.bar = QProgressBar(self)
        self.bar.setObjectName("benchProgress")
        self.bar.setAccessibleName("Runs that are done")
        self.bar.setToolTip("Runs that are done")
        self.log = QPlainTextEdit(self)
        self.log.setObjectName("benchLog")
        self.log.setAccessibleName("Log of the benchmark")
        self.log.setToolTip("What the benchmark says")
        self.log.setReadOnly(True)
        self.log.setMaximumBlockCount(5000)
        buttons = QHBoxLayout()
        for widget in (self.start_button, self.cancel_button, self.estimate_button, self.report):
            buttons.addWidget(widget)
        buttons.addStretch(1)
        column = QVBoxLayout(self)
        column.addWidget(self.choice)
        column.addWidget(self.note)
        column.addLayout(buttons)
        column.addWidget(self.bar)
        column.addWidget(self.state)
        column.addWidget(self.log, 1)
        self.bar.setValue(0)

    def _button(self, name: str, text: str, tip: str) -> QPushButton:
        button = QPushButton(text, self)
        button.setObjectName(name)
        button.setToolTip(tip)
        return button

    def _label(self, name: str) -> QLabel:
        label = QLabel(self)
        label.setObjectName(name)
        label.setTextFormat(Qt.TextFormat.PlainText)
        label.setWordWrap(True)
        return label

    # ---- what others call ----------------------------------------------------------------------

    @property
    def running(self) -> bool:
        """Whether a benchmark runs."""
        return self.command.running

    def start(self) -> None:
        """Starts, or goes on with what the folder holds."""
        choice = self.choice.choice()
        if choice is None or self.command.running:
            return
        self._folder = choice.folder
        self._make_report = self.report.isChecked()
        self._warnings = []
        self._runs = 0
        self._estimate.stop()
        self.log.clear()
        self._say("Starting ...")
        self.bar.setRange(0, 0)
        self._enable(False)
        self._measuring = True
        self._still()
        words = choice.arguments()
        self._log_line("wavecomb " + " ".join(words))
        self.command.start(words)

    def cancel(self) -> None:
        """Stops it; the folder can be gone on with."""
        if self.command.running:
            self._say("Stopping ...")
            self.command.stop()

    def estimate(self) -> None:
        """Asks `wavecomb bench run --dry-run` how long it would take."""
        choice = self.choice.choice()
        if choice is not None and not self._estimate.running:
            self.estimate_button.setEnabled(False)
            self._say("Estimating ...")
            self._estimate.start(choice.arguments(dry=True))

    def shutdown(self) -> None:
        """Stops what runs; the folder can be gone on with."""
        self._measuring = False
        self.choice.shutdown()
        self.command.shutdown()
        self._estimate.shutdown()

    # ---- what the process says -----------------------------------------------------------------

    def _take(self, event: dict[str, Any]) -> None:
        kind = event["event"]
        if kind == "prepare":
            self._say(f"{_PREPARES.get(event['what'], event['what'])}: {event['name']}")
        elif kind == "plan":
            self._runs = int(event["runs"])
            self.bar.setRange(0, max(self._runs, 1))
            self.bar.setValue(0)
            before = f", {event['done']} are done already" if event["done"] else ""
            left = time_text(event["seconds_left"])
            self._say(f"{self._runs} runs{before}; about {left}")
        elif kind == "begin":
            self._say(f"Run {event['number']} of {self._runs}: {event['run']}{self._left}")
        elif kind == "run":
            self.bar.setValue(int(event["number"]))
            self._left = f"; about {time_text(event['seconds_left'])} left"
            if event["status"] != "ok":
                self._warnings.append(f"{event['run']} failed: {event['error']}")
        elif kind == "done" and event["failed"]:
            self._warnings.append(f"{event['failed']} runs failed; Start tries them again")

    _left = ""

    def _log_line(self, line: str) -> None:
        self.log.appendPlainText(line)

    def _end(self, code: int, text: str, error: str) -> None:
        self._left = ""
        if code == 0 and self._make_report and self._measuring:
            self._measuring = False
            self._let_go()
            self._say("Making the report ...")
            self.bar.setRange(0, 0)
            self._make_report = False
            self.command.start(["bench", "report", str(self._folder)])
            return
        self._measuring = False
        self._let_go()
        self._enable(True)
        self.bar.setRange(0, max(self._runs, 1))
        self.bar.setValue(self._runs if code == 0 else self.bar.value())
        if code == 130:
            self._say("Stopped. Start goes on with what is done.")
        elif error:
            self._fail(error)
        else:
            self._say("Done." if not self._warnings else "Done, but: " + "; ".join(self._warnings))
        self._show_choice()
        if code == 0:
            self.done.emit(self._folder)

    def _estimated(self, code: int, text: str, error: str) -> None:
        self.estimate_button.setEnabled(not self.command.running)
        if self.command.running or code == 130:
            return
        if error:
            self._fail(error)
        else:
            lines = text.strip().splitlines()
            self._say(lines[-1] if lines else "No estimate.")
            for line in lines:
                self._log_line(line)

    # ---- inside --------------------------------------------------------------------------------

    def _keep_still(self, state: str) -> None:
        """The viewport does not render while it is measured."""
        if self._measuring and state == "rendering":
            self._still()

    def _still(self) -> None:
        if self._session.state == "rendering":
            self._log_line("The viewport is paused: it would disturb the measurement.")
        self._session.pause()

    def _let_go(self) -> None:
        if self._session.state != "stopped":  # that was the user's wish
            self._session.resume()

    def _enable(self, idle: bool) -> None:
        for widget in (self.choice, self.start_button, self.estimate_button, self.report):
            widget.setEnabled(idle)
        self.cancel_button.setEnabled(not idle)

    def _show_choice(self) -> None:
        choice = self.choice.choice(quiet=True)
        resumes = choice is not None and choice.resumes
        self.start_button.setText("Go on" if resumes else "Start")
        self.note.setText(
            ("The folder holds results: only what is missing will be run. " if resumes else "")
            + "The viewport is paused while it measures. Leave the machine alone meanwhile: "
            "runs that other work disturbs are marked as noisy."
        )

    def _say(self, text: str) -> None:
        set_text_colour(self.state, theme.text())
        self.state.setText(text)

    def _fail(self, message: str) -> None:
        set_text_colour(self.state, theme.error())
        self.state.setText(message)
        self.state.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.failed.emit(message)

    def open_choice(self, suite: str, folder: Path) -> None:
        """Chooses a suite and a folder, as a user would."""
        self.choice.set_choice(suite, folder)
