# SPDX-License-Identifier: Apache-2.0
"""Dialog of "Render > Send to a farm", which submits a job and shows its progress."""

from __future__ import annotations

import html
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from PySide6.QtCore import Qt
from PySide6.QtGui import QCloseEvent
from PySide6.QtWidgets import (
    QDialog,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QProgressBar,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from wavecomb.errors import WavecombError
from wavecomb.gui import theme
from wavecomb.gui.command import Command
from wavecomb.gui.widgets import named

Describe = Callable[[str], dict[str, Any]]
"""Type of a function that takes an output file and describes a farm job for ``farm.from_json``.
Raises WavecombError."""


class FarmDialog(QDialog):
    """Dialog that asks for output and workers, submits the job and shows its progress.

    Attributes:
        folder: Folder of the job; None until the job is submitted.
    """

    def __init__(self, describe: Describe, output: str, parent: QWidget | None = None) -> None:
        """Creates the dialog without submitting a job.

        Args:
            describe: Function that describes the job.
            output: Initial path of the output file.
            parent: Parent window of the dialog.
        """
        super().__init__(parent)
        self.setObjectName("farm")
        self.setWindowTitle("Send to a farm")
        self.folder: Path | None = None
        self._describe = describe
        self._command = Command(self)
        self._command.event.connect(self._take)
        self._command.finished.connect(self._end)
        self._is_resuming = False
        self.output = self._line(
            "farm.output", "Picture", output, "File name; with #### for several frames"
        )
        self.frames = self._line(
            "farm.frames", "Frames", "", "Such as 1-48; empty means the current frame"
        )
        self.tiles = self._line(
            "farm.tiles", "Tiles", "auto", "auto, or columns and rows such as 4x3"
        )
        self.engine = self._line(
            "farm.on", "On", "local:2", "local:N, dask:ADDRESS, slurm:N, or none"
        )
        self.send = named(QPushButton("&Send"), "farm.send", "Send", "Write the job and render it")
        self.stop = named(QPushButton("S&top"), "farm.stop", "Stop", "Keeps finished tiles")
        self.bar = named(QProgressBar(), "farm.bar", "Progress", "Finished tiles")
        self.bar.setFormat("%v of %m tiles")
        self.bar.setTextVisible(False)
        self.state = named(QLabel(), "farm.state", "State", "State of the job")
        self.state.setWordWrap(True)
        self.state.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.stop.setEnabled(False)
        self.send.clicked.connect(self.begin)
        self.stop.clicked.connect(self.end)
        self._lay_out()

    def _line(self, name: str, title: str, text: str, tip: str) -> QLineEdit:
        return named(QLineEdit(text), name, title, tip)

    def _lay_out(self) -> None:
        form = QFormLayout()
        for line in (self.output, self.frames, self.tiles, self.engine):
            line.setPlaceholderText(line.toolTip())
            form.addRow(line.accessibleName(), line)
        buttons = QHBoxLayout()
        buttons.addStretch(1)
        buttons.addWidget(self.send)
        buttons.addWidget(self.stop)
        self.setMinimumWidth(theme.em(30))
        column = QVBoxLayout(self)
        column.addLayout(form)
        column.addLayout(buttons)
        column.addWidget(self.bar)
        column.addWidget(self.state)

    # ---- what it does ----------------------------------------------------------------------------

    def begin(self) -> None:
        """Submits the job in a separate process, and then runs the job.

        The separate process is used since reading a stage takes time.
        """
        try:
            wanted = self._describe(self.output.text())
        except WavecombError as error:
            self.say(str(error))
            return
        options = wanted["options"]
        options["tiles"] = self.tiles.text() or "auto"
        if self.frames.text().strip():
            options["frames"] = self.frames.text().strip()
            options.pop("frame", None)
        self.folder = None
        self.bar.setMaximum(0)  # The progress bar shows "busy" until the first tile arrives.
        self.say("reading the stage \u2026")
        self._start([], module="wavecomb.farm.json_submission", text=json.dumps(wanted))

    def _start(self, words: list[str], **how: str) -> None:
        self._is_resuming = bool(words)
        self._command.start(words, **how)
        self.send.setEnabled(False)
        self.stop.setEnabled(True)

    def _take(self, found: dict[str, Any]) -> None:
        """Handles a JSON line of the farm process: the submitted job, an error, or progress."""
        if "error" in found:
            self.say(found["error"])
        elif "job" in found and not self._is_resuming:
            self.folder = Path(found["job"])
        else:
            found = found.get("progress", found)
            tasks, images = found["tasks"], found["images"]
            self.bar.setTextVisible(True)
            self.bar.setMaximum(tasks["all"])
            self.bar.setValue(tasks["done"])
            words = f"{images['done']} of {images['all']} images"
            self.say(f"{self.folder}: {found['state']}, {words}")

    def _end(self, code: int, text: str, error: str) -> None:
        self.send.setEnabled(True)
        self.stop.setEnabled(False)
        self.bar.setMaximum(max(self.bar.maximum(), 1))
        engine = self.engine.text() or "local"
        if error:
            self.say(error)
        elif self._is_resuming or self.folder is None or code:
            return
        elif engine == "none":
            self.say(f"{self.folder}: written; `wavecomb farm resume` renders it")
        else:
            self._start(["farm", "resume", str(self.folder), "--on", engine, "--json"])

    def end(self) -> None:
        """Stops the farm job; `wavecomb farm resume` continues it."""
        self._command.stop()

    def say(self, line: str) -> None:
        """Shows a line of text about the state of the job."""
        self.state.setText(html.escape(line))

    def closeEvent(self, event: QCloseEvent) -> None:
        """Stops a running farm job, and hides the dialog until the job has ended.

        Finished tiles of the job are kept.
        """
        if not self._command.running:
            super().closeEvent(event)
            return
        self._command.finished.disconnect()
        self._command.finished.connect(lambda *_: self.deleteLater())
        self._command.stop()
        event.ignore()
        self.hide()
