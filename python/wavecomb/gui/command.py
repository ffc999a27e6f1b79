# SPDX-License-Identifier: Apache-2.0
"""Runs `wavecomb` commands in separate processes, so that the window never waits for them."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Sequence

from PySide6.QtCore import QObject, QProcess, QTimer, Signal

from wavecomb import processes

KILL_MS = 8000
"""Time in milliseconds after which a process that has not followed a stop request is killed."""


class Command(QObject):
    """Process that runs one command at a time.

    Signals:
        event(dict): The process printed a line with a JSON object on stdout.
        said(str): The process printed a line without a JSON object, on stdout or stderr.
        finished(code, text, error): The process ended. ``code`` is the exit code, and ``text`` is
            the whole output on stdout. ``error`` is the last line of stderr if the process failed,
            else "". The exit code of a stopped process is 130.
    """

    event = Signal(dict)
    said = Signal(str)
    finished = Signal(int, str, str)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._process: QProcess | None = None
        self._out = self._err = ""
        self._text = ""
        self._last = ""
        self._stopping = False

    @property
    def running(self) -> bool:
        """Whether a process is running."""
        return self._process is not None

    def start(self, arguments: Sequence[str], *, module: str = "wavecomb", text: str = "") -> None:
        """Runs a module of Wavecomb as a program in a new process.

        Args:
            arguments: Command-line arguments.
            module: Name of the Python module; the default is the command-line program.
            text: Text for the standard input of the process.
        """
        assert self._process is None, "one at a time"
        process = QProcess(self)
        process.readyReadStandardOutput.connect(self._read_out)
        process.readyReadStandardError.connect(self._read_err)
        process.finished.connect(self._end)
        process.errorOccurred.connect(self._fail)
        self._process = process
        self._out = self._err = self._text = self._last = ""
        self._stopping = False
        # Start the process from the main thread, which exists as long as the window, because the
        # kernel ends a child process when the thread that started it ends.
        flags = ["-u", "-X", "utf8"]
        words = processes.command(module, *arguments, parent=os.getpid(), flags=flags)
        process.start(words[0], words[1:])
        process.write(text.encode())
        process.closeWriteChannel()

    def stop(self) -> None:
        """Sends SIGTERM to the process, and kills the process later if it has not ended."""
        process = self._process
        if process is None:
            return
        if self._stopping:
            process.kill()
            return
        self._stopping = True
        process.terminate()
        QTimer.singleShot(KILL_MS, process, process.kill)

    def shutdown(self) -> None:
        """Ends the process when the window closes, waiting at most three seconds."""
        process, self._process = self._process, None
        if process is not None:
            process.blockSignals(True)
            process.terminate()
            if not process.waitForFinished(3000):
                process.kill()
                process.waitForFinished(1000)

    # ---- inside --------------------------------------------------------------------------------

    def _read_out(self) -> None:
        if self._process is None:
            return
        text = bytes(self._process.readAllStandardOutput().data()).decode("utf-8", "replace")
        self._text += text
        *lines, self._out = (self._out + text).split("\n")
        for line in lines:
            self._take(line)

    def _read_err(self) -> None:
        if self._process is None:
            return
        text = bytes(self._process.readAllStandardError().data()).decode("utf-8", "replace")
        *lines, self._err = (self._err + text).split("\n")
        for line in lines:
            self._say(line)

    def _take(self, line: str) -> None:
        if line.startswith("{"):
            with contextlib.suppress(ValueError):
                event = json.loads(line)
                if isinstance(event, dict):
                    self.event.emit(event)
                    return
        self.said.emit(line)

    def _say(self, line: str) -> None:
        if line.strip():
            self._last = line
            self.said.emit(line)

    def _end(self, code: int, status: QProcess.ExitStatus) -> None:
        if self._process is None:
            return
        self._read_out()
        self._read_err()
        self._say(self._err)
        crashed = status == QProcess.ExitStatus.CrashExit
        code = 130 if self._stopping and (crashed or code != 0) else code
        error = ""
        if code not in (0, 130):
            error = self._last.removeprefix("error: ") or f"ended with code {code}"
            if crashed:
                error = f"the process was killed by signal {code}: {self._last}"
        self._process.deleteLater()
        self._process = None
        self.finished.emit(code, self._text, error)

    def _fail(self, error: QProcess.ProcessError) -> None:
        if error == QProcess.ProcessError.FailedToStart and self._process is not None:
            message, program = self._process.errorString(), self._process.program()
            self._process.deleteLater()
            self._process = None
            self.finished.emit(127, "", f"{program}: cannot be started: {message}")
