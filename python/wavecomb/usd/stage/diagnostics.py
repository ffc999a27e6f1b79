# SPDX-License-Identifier: Apache-2.0
"""Captures USD's diagnostics and converts them to warnings of the load report."""

from __future__ import annotations

import contextlib
import os
import re
import sys
from collections.abc import Iterator
from typing import Any

from pxr import Tf

from wavecomb.usd.stage.report import LoadReport

NOT_TEXT = "it holds text that is not UTF-8; the file is damaged"

MAX_LINES = 12
"""Diagnostics that are reported individually; further ones are only counted."""


def plain(text: str) -> str:
    """Shortens a USD diagnostic to one line."""
    text = re.sub(r"\((?:instantiating|recomposing|loading)[^()]*stage[^()]*\)", "", text)
    text = re.sub(r" <0x[0-9a-f]+>", "", " ".join(text.split()))
    return text if len(text) <= 300 else text[:297] + "..."


_FORMS = (
    (
        re.compile(r"Found material bindings on prim at path \((\S+)\) but MaterialBindingAPI"),
        "material binding without MaterialBindingAPI applied (used anyway)",
    ),
    (re.compile(r"Could not open asset @([^@]*)@"), "cannot open layer"),
    (re.compile(r"^In <([^>]*)>: (.*)$"), ""),
)
"""Diagnostics that are reworded; the first group of the pattern is the prim or file."""


_SAID = re.compile(r"Could not (open asset|load sublayer) @[^@]*\.mtlx\]*@", re.IGNORECASE)
"""Diagnostics that are dropped because ``usd.mtlx`` reports the same problem in more detail."""


def _add_to_report(report: LoadReport, text: str) -> None:
    """Adds one diagnostic to a report."""
    for form, words in _FORMS:
        match = form.search(text)
        if match:
            report.warn(words or f"USD: {match.group(2)}", match.group(1))
            return
    report.warn(f"USD: {text}")


def first_message(error: BaseException) -> str:
    """Returns the first message of a ``Tf.ErrorException``."""
    try:
        for item in error.args:
            text = getattr(item, "commentary", None)
            if text:
                return plain(text)
        return plain(str(error))
    # USD quotes bytes of the file that are not valid UTF-8.
    except UnicodeDecodeError:
        return NOT_TEXT


def _text(diagnostic: Any) -> str:
    """Returns the text of a diagnostic."""
    try:
        return str(diagnostic.commentary)
    except UnicodeDecodeError:
        return NOT_TEXT


@contextlib.contextmanager
def _muted_stderr() -> Iterator[None]:
    """Redirects file descriptor 2 to /dev/null, for USD versions without ``Tf.DiagnosticTrap``."""
    sys.stderr.flush()
    saved = os.dup(2)
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(null)


@contextlib.contextmanager
def capture_diagnostics(report: LoadReport) -> Iterator[None]:
    """Adds messages that USD's C++ code emits inside the block to the report as warnings."""
    trap_type = getattr(Tf, "DiagnosticTrap", None)
    if trap_type is None:
        with _muted_stderr():
            yield
        return
    with _hooked(report), trap_type() as trap:
        try:
            yield
        finally:
            _pass_on(trap, report)


@contextlib.contextmanager
def _hooked(report: LoadReport) -> Iterator[None]:
    """Adds exceptions to the report that USD's C++ code catches from Python and prints.

    Such errors are caused by values of types that Python does not know.
    """
    before = sys.excepthook

    def tell(kind: type[BaseException], error: BaseException, trace: Any) -> None:
        _add_to_report(report, plain(f"{kind.__name__}: {error}"))

    sys.excepthook = tell
    try:
        yield
    finally:
        sys.excepthook = before


def _pass_on(trap: Any, report: LoadReport) -> None:
    """Moves the messages of a trap to a report."""
    texts = [_text(item) for item in (*trap.GetErrors(), *trap.GetWarnings())]
    lines = sorted({plain(text) for text in texts if not _SAID.search(text)})
    # Reworded messages are grouped in the report, so they do not count towards the limit.
    known = [line for line in lines if any(f.search(line) for f, words in _FORMS if words)]
    for line in known:
        _add_to_report(report, line)
    lines = [line for line in lines if line not in set(known)]
    for line in lines[:MAX_LINES]:
        _add_to_report(report, line)
    if len(lines) > MAX_LINES:
        report.warn(f"USD: {len(lines) - MAX_LINES} more messages like these")
    trap.Clear()


class DiagnosticListener:
    """Capture of messages that USD's C++ code emits on this thread while the program runs.

    Does nothing with USD versions that have no ``Tf.DiagnosticTrap``.
    """

    def __init__(self) -> None:
        kind = getattr(Tf, "DiagnosticTrap", None)
        self._open = contextlib.ExitStack()
        self._trap = None if kind is None else self._open.enter_context(kind())

    def take(self) -> LoadReport | None:
        """Returns messages since the last call; None if there are none."""
        if self._trap is None or self._trap.IsClean():
            return None
        report = LoadReport()
        _pass_on(self._trap, report)
        return report if report.warnings else None

    def stop(self) -> None:
        """Stops capturing; must be called on the thread that created the object."""
        if self._trap is not None:
            self._trap.Clear()
            self._trap = None
        self._open.close()
