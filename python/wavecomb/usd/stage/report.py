# SPDX-License-Identifier: Apache-2.0
"""Messages from loading a stage, including USD's diagnostics, each reported once."""

from __future__ import annotations

import contextlib
import os
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from pxr import Tf

MAX_PLACES = 3
"""Maximum number of locations in the text of a message; further locations are counted."""

LEVELS = ("warning", "not supported", "note")
"""Kinds of messages, in the order of a log."""

MAX_KEPT = 500
"""Maximum number of locations that are stored per message."""


@dataclass
class Finding:
    """A message with its locations.

    Attributes:
        what: Text of the message: one line in lower case, without a full stop.
        count: Number of occurrences of the message.
        all_places: Prims or files that the message concerns, up to ``MAX_KEPT``.
    """

    what: str
    count: int = 0
    all_places: list[str] = field(default_factory=list)
    _known: set[str] = field(default_factory=set, repr=False, compare=False)

    def add(self, place: str, count: int = 1) -> None:
        """Adds an occurrence of the message."""
        self.count += count
        if place and len(self._known) < MAX_KEPT and place not in self._known:
            self._known.add(place)
            self.all_places.append(place)

    @property
    def places(self) -> list[str]:
        """The first ``MAX_PLACES`` locations of the message."""
        return self.all_places[:MAX_PLACES]

    def line(self) -> str:
        """Returns the message with its locations as one line."""
        if not self.places:
            return self.what
        places = self.places
        more = self.count - len(places)
        return f"{self.what}: {', '.join(places)}" + (f" and {more} more" if more > 0 else "")

    def as_dict(self) -> dict[str, Any]:
        """Returns the message as plain data for JSON."""
        return {"what": self.what, "count": self.count, "places": self.places}


class LoadReport:
    """Notes, warnings and unsupported features, in order of occurrence.

    Attributes:
        notes: Choices and approximations, such as "no camera: framed what is drawn".
        warnings: Errors in the stage, and the way in which they were handled.
        unsupported: Features of the stage that Wavecomb does not support.
        counts: Number of prims read, by kind.
    """

    def __init__(self) -> None:
        self._found: dict[str, dict[str, Finding]] = {level: {} for level in LEVELS}
        self.counts: dict[str, int] = {}
        self._aliases: dict[str, str] = {}

    def alias(self, prototype: object, instance: object) -> None:
        """Makes paths in one of USD's prototypes appear as paths in its first instance."""
        self._aliases.setdefault(str(prototype), self.place(instance))

    def place(self, place: object) -> str:
        """Returns the path by which the user knows a prim."""
        path = str(place)
        if not path.startswith("/__Prototype_"):
            return path
        head, slash, tail = path[1:].partition("/")
        return self._aliases.get(f"/{head}", f"/{head}") + slash + tail

    def _add(self, level: str, what: str, place: object, count: int = 1) -> None:
        self._found[level].setdefault(what, Finding(what)).add(self.place(place), count)

    def note(self, what: str, place: object = "", count: int = 1) -> None:
        """Adds a note."""
        self._add("note", what, place, count)

    def warn(self, what: str, place: object = "", count: int = 1) -> None:
        """Adds a warning about a prim or a file."""
        self._add("warning", what, place, count)

    def missing(self, what: str, place: object = "", count: int = 1) -> None:
        """Adds a message about an unsupported feature."""
        self._add("not supported", what, place, count)

    def absorb(self, other: LoadReport) -> None:
        """Adds all messages and counts of another report; renames paths in USD's prototypes."""
        for level, findings in other._found.items():
            for finding in findings.values():
                first, *others = finding.all_places or [""]
                self._add(level, finding.what, first, finding.count - len(others))
                for place in others:
                    self._add(level, finding.what, place)
        for kind, count in other.counts.items():
            self.tally(kind, count)

    def absorb_new(self, other: LoadReport) -> None:
        """Adds messages of another report, except for locations that already have this message."""
        for level, findings in other._found.items():
            for what, finding in findings.items():
                known = self._found[level].get(what)
                there = set() if known is None else set(known._known)
                for place in finding.all_places:
                    if place not in there:
                        self._add(level, what, place)

    def tally(self, kind: str, count: int = 1) -> None:
        """Counts prims of a kind."""
        if count:
            self.counts[kind] = self.counts.get(kind, 0) + count

    @property
    def notes(self) -> list[Finding]:
        """Notes about choices and approximations."""
        return list(self._found["note"].values())

    @property
    def warnings(self) -> list[Finding]:
        """Warnings about errors in the stage."""
        return list(self._found["warning"].values())

    @property
    def unsupported(self) -> list[Finding]:
        """Messages about unsupported features."""
        return list(self._found["not supported"].values())

    def lines(self) -> list[str]:
        """Returns all messages as lines for a log, warnings first."""
        return [
            f"{level}: {finding.line()}"
            for level, findings in self._found.items()
            for finding in findings.values()
        ]

    def as_dict(self) -> dict[str, Any]:
        """Returns the report as plain data for JSON."""
        return {
            "notes": [finding.as_dict() for finding in self.notes],
            "warnings": [finding.as_dict() for finding in self.warnings],
            "unsupported": [finding.as_dict() for finding in self.unsupported],
            "counts": dict(self.counts),
        }


NOT_TEXT = "it holds text that is not UTF-8; the file is damaged"

MAX_LINES = 12
"""Maximum number of USD diagnostics that are reported individually; the rest are only counted."""


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
"""USD diagnostics that are reworded; the first group of each pattern is the prim or file."""


_SAID = re.compile(r"Could not (open asset|load sublayer) @[^@]*\.mtlx\]*@", re.IGNORECASE)
"""USD diagnostics that are dropped because ``usd.mtlx`` reports the same problem in more detail."""


def _add_to_report(report: LoadReport, text: str) -> None:
    """Adds one USD diagnostic to a report."""
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
    # USD's message may quote bytes of the file that are not valid UTF-8.
    except UnicodeDecodeError:
        return NOT_TEXT


def _text(diagnostic: Any) -> str:
    """Returns the text of a USD diagnostic."""
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
    """Adds to the report the Python exceptions that USD's C++ code catches and prints.

    Such exceptions occur for values whose types Python does not know.
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
    """Moves the messages of a diagnostic trap to a report."""
    texts = [_text(item) for item in (*trap.GetErrors(), *trap.GetWarnings())]
    lines = sorted({plain(text) for text in texts if not _SAID.search(text)})
    # Messages of USD that Wavecomb rewords are grouped in the report, so they do not count towards
    # the limit of messages.
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
        """Returns USD's messages since the last call; None if there are none."""
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
