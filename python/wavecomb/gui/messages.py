# SPDX-License-Identifier: Apache-2.0
"""Error messages of the window: one line of text that the user closes, never a traceback."""

from __future__ import annotations

import datetime
import sys
import threading
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType

from PySide6.QtCore import QObject, QStandardPaths, Qt, QTimer, Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QSizePolicy, QToolButton, QWidget

from wavecomb.gui import theme
from wavecomb.gui.bridge import port
from wavecomb.gui.widgets import named

WARNING_MS = 12000


class MessageBar(QFrame):
    """Message bar over the image.

    Errors and findings of the loader stay until the user closes them; warnings disappear after some
    time.

    Signals:
        details(): Emitted when the user asks for details of the loader's findings.
    """

    details = Signal()

    def __init__(self, name: str = "message", parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName(name)
        self.setFrameShape(QFrame.Shape.StyledPanel)
        self.setAutoFillBackground(True)
        self._label = named(QLabel(), f"{name}.text", "Message", "")
        self._label.setWordWrap(True)
        self._label.setTextInteractionFlags(
            Qt.TextInteractionFlag.TextSelectableByMouse
            | Qt.TextInteractionFlag.TextSelectableByKeyboard
        )
        self._label.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        close = named(QToolButton(), f"{name}.close", "Close the message", "Close (Esc)")
        close.setText("\u2715")
        close.setAutoRaise(True)
        close.clicked.connect(self.hide)
        row = QHBoxLayout(self)
        pad = theme.em(0.4)
        row.setContentsMargins(2 * pad, pad, pad, pad)
        row.addWidget(self._label, 1)
        self._more = named(QToolButton(), f"{name}.details", "Details", "List all findings")
        self._more.setText("Details")
        self._more.clicked.connect(self.details)
        row.addWidget(self._more, 0, Qt.AlignmentFlag.AlignTop)
        row.addWidget(close, 0, Qt.AlignmentFlag.AlignTop)
        self._timer = QTimer(self)
        self._timer.setSingleShot(True)
        self._timer.timeout.connect(self.hide)
        self._is_error = False
        theme.on_change(self._colour)
        self.hide()

    def text(self) -> str:
        """The current message, or "" while the bar is hidden."""
        return self._label.text() if not self.isHidden() else ""

    def show_error(self, message: str) -> None:
        """Shows an error until the user closes it or another message replaces it."""
        self._timer.stop()
        self._show("Error: " + message, True)

    def show_warning(self, message: str) -> None:
        """Shows a warning for a limited time, unless an error is shown."""
        if self._is_error and not self.isHidden():
            return
        self._show(message, False)
        self._timer.start(WARNING_MS)

    def show_findings(self, lines: Sequence[str]) -> None:
        """Shows the first of several lines and the number of further lines.

        The message stays until it is closed or replaced.
        """
        more = f" (and {len(lines) - 1} more)" if len(lines) > 1 else ""
        text = lines[0] + more if lines else ""
        if text and text != self._label.text():
            self._show(text, False)
            self._more.show()
        elif not text:
            self._label.clear()
            self.hide()

    def _show(self, message: str, is_error: bool) -> None:
        self._is_error = is_error
        self._more.hide()
        self._label.setText(" ".join(message.split()))
        self._colour()
        self.show()

    def _colour(self) -> None:
        colour = theme.error() if self._is_error else theme.warning()
        self._label.setStyleSheet(f"color: {colour.name()};")


class _Reporter(QObject):
    """Receiver of errors from any thread, which reports the errors on the window's thread."""

    def __init__(self, tell: Callable[[str], None]) -> None:
        super().__init__()
        self._tell: Callable[[str], None] | None = tell
        self.caught = port(self._take)

    def _take(self, line: str) -> None:
        if self._tell is not None:
            self._tell(line)

    def end(self) -> None:
        """Stops reporting errors."""
        self._tell = None
        self.deleteLater()


def log_folder() -> Path:
    """Returns the folder for error reports."""
    place = QStandardPaths.StandardLocation.AppLocalDataLocation
    return Path(QStandardPaths.writableLocation(place))


def install_hooks(tell: Callable[[str], None]) -> Callable[[], None]:
    """Installs hooks that report internal errors of all threads, in one line and in a report file.

    Args:
        tell: Function that is called on the window's thread with the line that reports an error.

    Returns:
        Returns a function that removes the hooks.
    """
    reporter = _Reporter(tell)
    caught = reporter.caught  # The exception hooks must not hold a reference to a Qt object.
    before, before_threads = sys.excepthook, threading.excepthook

    def hook(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        if issubclass(kind, KeyboardInterrupt):
            before(kind, error, trace)
            return
        caught.send(fault_line(error, write_report(kind, error, trace)))

    def thread_hook(details: threading.ExceptHookArgs) -> None:
        if details.exc_value is not None:
            hook(details.exc_type, details.exc_value, details.exc_traceback)

    sys.excepthook, threading.excepthook = hook, thread_hook

    def remove() -> None:
        sys.excepthook, threading.excepthook = before, before_threads
        reporter.end()

    return remove


def fault_line(error: BaseException, report: Path | None) -> str:
    """Returns a line of text that reports an internal error."""
    from wavecomb.run.error_messages import describe

    core = describe(error) if isinstance(error, Exception) else str(error)
    if not core.startswith("internal:"):
        return core
    where = f"; please report it with {report}" if report is not None else "; please report it"
    return f"internal: {type(error).__name__}: {' '.join(str(error).split())}{where}"


def write_report(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> Path | None:
    """Writes the traceback to a report file; returns None if the file cannot be written."""
    from wavecomb.version import version

    now = datetime.datetime.now().strftime("%Y%m%d-%H%M%S")
    text = "".join(traceback.format_exception(kind, error, trace))
    try:
        folder = log_folder()
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"fault-{now}.txt"
        with path.open("a", encoding="utf-8") as file:
            file.write(f"wavecomb {version()}\n{text}\n")
    except OSError:
        return None
    return path
