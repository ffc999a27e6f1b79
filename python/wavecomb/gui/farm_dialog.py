# SPDX-License-Identifier: Apache-2.0
"""Render > Send to a farm: a job of what the window shows, and how far it is."""

from __future__ import annotations

import html
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from PySide6.QtCore import QProcess, Qt
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

from wavecomb import processes
from wavecomb.errors import WavecombError
from wavecomb.gui.widgets import named

Describe = Callable[[str], dict[str, Any]]
"""From an output file to what ``farm.from_json`` takes; raises WavecombError."""


class FarmDialog(QDialog):
    """Asks where to, sends, and watches.

    Attributes:
        folder: Of the job; None: there is none yet.
    """

    def __init__(self, describe: Describe, output: str, parent: QWidget | None = None) -> None:
        """Nothing is sent yet.

        Args:
            describe: What is to be rendered.
            output: A file to begin with.
            parent: The window.
        """
        super().__init__(parent)
        self.setObjectName("farm")
        self.setWindowTitle("Send to a farm")
        self.folder: Path | None = None
        self._describe = describe
        self._process: QProcess | None = None
        self._wanted: dict[str, Any] = {}
        self.output = self._line(
            "farm.output", "Picture", output, "A file; for frames a name with ####"
        )
        self.frames = self._line(
            "farm.frames", "Frames", "", "Such as 1-48; empty: the one that is shown"
        )
        self.tiles = self._line(
            "farm.tiles", "Tiles", "auto", "auto, or columns and rows such as 4x3"
        )
        self.engine = self._line(
            "farm.on", "On", "local:2", "local:N, dask:ADDRESS, slurm:N, or none"
        )
        self.send = named(QPushButton("&Send"), "farm.send", "Send", "Write the job and work on it")
        self.stop = named(QPushButton("S&top"), "farm.stop", "Stop", "Finished tiles are kept")
        self.bar = named(QProgressBar(), "farm.bar", "Progress", "Tasks that are done")
        self.state = named(QLabel(), "farm.state", "State", "Where the job stands")
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
        column = QVBoxLayout(self)
        column.addLayout(form)
        column.addLayout(buttons)
        column.addWidget(self.bar)
        column.addWidget(self.state)

    # ---- what it does ----------------------------------------------------------------------------

    def begin(self) -> None:
        """Has the job written, by a process of its own, since reading a stage takes its time."""
        try:
            self._wanted = self._describe(self.output.text())
        except WavecombError as error:
            self.say(str(error))
            return
        options = self._wanted["options"]
        options["tiles"] = self.tiles.text() or "auto"
        if self.frames.text().strip():
            options["frames"] = self.frames.text().strip()
            options.pop("frame", None)
        self.folder = None
        self.say("reading the stage \u2026")
        process = self._start(["wavecomb.farm.from_json"], self._written)
        process.write(json.dumps(self._wanted).encode())
        process.closeWriteChannel()

    def _start(self, words: list[str], ended: Callable[[], None]) -> QProcess:
        process = QProcess(self)
        process.finished.connect(lambda code, how: ended())
        started = processes.command(*words, parent=os.getpid())
        process.start(started[0], started[1:])
        self._process = process
        self.send.setEnabled(False)
        self.stop.setEnabled(True)
        return process

    def _written(self) -> None:
        assert self._process is not None
        said = bytes(self._process.readAllStandardOutput().data())
        self._let_go()
        try:
            told = json.loads(said)
        except ValueError:
            told = {"error": "the job was not written"}
        if "error" in told:
            self.say(told["error"])
            return
        self.folder = Path(told["job"])
        engine = self.engine.text() or "local"
        if engine == "none":
            self.say(f"{self.folder}: written; `wavecomb farm resume` renders it")
            return
        words = ["wavecomb", "farm", "resume", told["job"], "--on", engine, "--json"]
        process = self._start(words, self._ended)
        process.readyReadStandardOutput.connect(self.look)

    def _ended(self) -> None:
        assert self._process is not None
        self.look()
        code = self._process.exitCode()
        said = bytes(self._process.readAllStandardError().data()).decode(errors="replace")
        self._let_go()
        lines = said.strip().splitlines()
        if code and lines:
            self.say(lines[-1].removeprefix("error: "))

    def _let_go(self) -> None:
        assert self._process is not None
        self._process.deleteLater()
        self._process = None
        self.send.setEnabled(True)
        self.stop.setEnabled(False)

    def end(self) -> None:
        """Stops the job; `wavecomb farm resume` continues it."""
        if self._process is not None:
            self._process.terminate()

    def look(self) -> None:
        """Shows the last line of progress that the command wrote."""
        if self._process is None:
            return
        found = None
        while self._process.canReadLine():
            line = bytes(self._process.readLine().data())
            try:
                told = json.loads(line)
                found = told.get("progress", told)
            except ValueError:
                continue
        if found is not None:
            tasks, images = found["tasks"], found["images"]
            self.bar.setMaximum(tasks["all"])
            self.bar.setValue(tasks["done"])
            words = f"{images['done']} of {images['all']} images, "
            words += f"{tasks['done']} of {tasks['all']} tiles"
            self.say(f"{self.folder}: {found['state']}: {words}")

    def say(self, line: str) -> None:
        """A line in place of the state."""
        self.state.setText(html.escape(line))

    def closeEvent(self, event: QCloseEvent) -> None:
        """A job that runs is stopped, out of sight; finished tiles are kept."""
        if self._process is None:
            super().closeEvent(event)
            return
        self._process.finished.disconnect()
        self._process.finished.connect(lambda code, how: self.deleteLater())
        self._process.terminate()
        event.ignore()
        self.hide()
