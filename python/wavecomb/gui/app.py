# SPDX-License-Identifier: Apache-2.0
"""Starts the window and runs it until it is closed."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Mapping

from PySide6.QtCore import (
    QCoreApplication,
    QEvent,
    QMessageLogContext,
    Qt,
    QTimer,
    QtMsgType,
    qInstallMessageHandler,
)
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QApplication, QWidget

from wavecomb.errors import WavecombError
from wavecomb.gui import theme
from wavecomb.gui.messages import install_hooks
from wavecomb.gui.needs import NO_DISPLAY, has_display, libraries_message, missing_libraries
from wavecomb.gui.setup import Setup


def _qt_says(kind: QtMsgType, context: QMessageLogContext, text: str) -> None:
    """Handles messages of Qt.

    A fatal message becomes one error line. All other messages are shown only to developers.
    """
    if kind == QtMsgType.QtFatalMsg:
        line = " ".join(text.split())
        if "platform plugin" in line and not has_display():
            line = NO_DISPLAY
        elif "platform plugin" in line or "display" in line:
            missing = missing_libraries()
            why = libraries_message(missing) if missing else f"{line} (try `wavecomb doctor`)"
            line = f"no window can be opened: {why}"
        sys.stderr.write(f"error: {line}\n")
        sys.stderr.flush()
        os._exit(2)
    if os.environ.get("WAVECOMB_DEBUG"):
        sys.stderr.write(f"qt: {text}\n")


def make_application() -> QApplication:
    """Creates the application. Raises WavecombError if there is no display."""
    if not has_display():
        raise WavecombError(NO_DISPLAY)
    qInstallMessageHandler(_qt_says)
    QGuiApplication.setHighDpiScaleFactorRoundingPolicy(
        Qt.HighDpiScaleFactorRoundingPolicy.PassThrough
    )
    application = QApplication(["wavecomb"])
    application.setApplicationName("Wavecomb")
    application.setOrganizationName("Wavecomb")
    application.setDesktopFileName("wavecomb")
    return application


def run(
    stage: str | None,
    setup: Setup,
    *,
    camera: str | None = None,
    time: float | None = None,
    variants: Mapping[str, str] | None = None,
    purposes: tuple[str, ...] | None = None,
) -> int:
    """Shows the window until it is closed, and returns the exit code."""
    application = make_application()
    from wavecomb.gui.main_window import MainWindow
    from wavecomb.usd.stage.report import DiagnosticListener

    window = MainWindow(setup)
    theme.apply(str(window.settings.value("theme", theme.DARK)))
    remove = install_hooks(window.message.show_error)
    before = [
        (one, signal.signal(one, lambda *_: window.close()))
        for one in (signal.SIGINT, signal.SIGTERM)
    ]
    # Python handles signals only while its interpreter runs, so a timer regularly runs a Python
    # function.
    beat = QTimer(window)
    beat.start(200)
    # USD also reports problems during edits and when panels read the stage. The timer therefore
    # regularly moves USD's messages to the notes panel.
    listening = DiagnosticListener()
    beat.timeout.connect(lambda: window.session.note_words(listening.take()))
    window.show()
    if stage is not None:
        window.open(stage, camera, time, variants, purposes)
    try:
        return application.exec()
    finally:
        remove()
        listening.stop()
        for one, handler in before:
            signal.signal(one, handler)
        destroy(window)


def destroy(window: QWidget) -> None:
    """Destroys a closed window immediately, without waiting for Python's garbage collector.

    The Python objects of the window's panels remain, but their Qt objects no longer exist.
    """
    window.deleteLater()
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
