# SPDX-License-Identifier: Apache-2.0
"""Keeps USD's own diagnostics off the terminal and turns them into lines of the report."""

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
"""Diagnostics that are passed on; the rest is counted."""


def plain(text: str) -> str:
    """One short line of a USD diagnostic."""
    text = re.sub(r"\((?:instantiating|recomposing|loading)[^()]*stage[^()]*\)", "", text)
    text = re.sub(r" <0x[0-9a-f]+>", "", " ".join(text.split()))
    return text if len(text) <= 300 else text[:297] + "..."


_FORMS = (
    (
        re.compile(r"Found material bindings on prim at path \((\S+)\) but MaterialBindingAPI"),
        "material binding without MaterialBindingAPI applied (used all the same)",
    ),
    (re.compile(r"Could not open asset @([^@]*)@"), "cannot open layer"),
    (re.compile(r"^In <([^>]*)>: (.*)$"), ""),
)
"""Diagnostics that are said in our words: the place is the first group."""


_SAID = re.compile(r"Could not (open asset|load sublayer) @[^@]*\.mtlx\]*@", re.IGNORECASE)
"""What ``usd.mtlx`` says better, where it comes to nothing."""


def _tell(report: LoadReport, text: str) -> None:
    """Adds one diagnostic to a report."""
    for form, words in _FORMS:
        match = form.search(text)
        if match:
            report.warn(words or f"USD: {match.group(2)}", match.group(1))
            return
    report.warn(f"USD: {text}")


def commentary(error: BaseException) -> str:
    """What a ``Tf.ErrorException`` says, first message only."""
    try:
        for item in error.args:
            text = getattr(item, "commentary", None)
            if text:
                return plain(text)
        return plain(str(error))
    except UnicodeDecodeError:  # USD quotes the file, whatever is in it
        return NOT_TEXT


def _text(diagnostic: Any) -> str:
    """What a diagnostic says."""
    try:
        return str(diagnostic.commentary)
    except UnicodeDecodeError:
        return NOT_TEXT


@contextlib.contextmanager
def _muted_stderr() -> Iterator[None]:
    """File descriptor 2 to nowhere, for USD versions without ``Tf.DiagnosticTrap``."""
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
def captured(report: LoadReport) -> Iterator[None]:
    """Collects what USD's C++ side reports inside the block as warnings of the report."""
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
    """Collects exceptions that USD's C++ side meets in Python, and prints.

    They are of values that have no type in Python.
    """
    before = sys.excepthook

    def tell(kind: type[BaseException], error: BaseException, trace: Any) -> None:
        _tell(report, plain(f"{kind.__name__}: {error}"))

    sys.excepthook = tell
    try:
        yield
    finally:
        sys.excepthook = before


def _pass_on(trap: Any, report: LoadReport) -> None:
    """Tells a report what a trap holds, and empties it."""
    texts = [_text(item) for item in (*trap.GetErrors(), *trap.GetWarnings())]
    lines = sorted({plain(text) for text in texts if not _SAID.search(text)})
    # What can be said in our words is grouped there, however often it comes.
    known = [line for line in lines if any(f.search(line) for f, words in _FORMS if words)]
    for line in known:
        _tell(report, line)
    lines = [line for line in lines if line not in set(known)]
    for line in lines[:MAX_LINES]:
        _tell(report, line)
    if len(lines) > MAX_LINES:
        report.warn(f"USD: {len(lines) - MAX_LINES} more messages like these")
    trap.Clear()


class Listening:
    """Collects what USD's C++ side reports on this thread for as long as a program runs.

    With USD versions that have no ``Tf.DiagnosticTrap`` it does nothing.
    """

    def __init__(self) -> None:
        kind = getattr(Tf, "DiagnosticTrap", None)
        self._open = contextlib.ExitStack()
        self._trap = None if kind is None else self._open.enter_context(kind())

    def take(self) -> LoadReport | None:
        """What was said since the last call; None: nothing."""
        if self._trap is None or self._trap.IsClean():
            return None
        report = LoadReport()
        _pass_on(self._trap, report)
        return report if report.warnings else None

    def stop(self) -> None:
        """Ends it, on the thread that began it."""
        if self._trap is not None:
            self._trap.Clear()
            self._trap = None
        self._open.close()
