# SPDX-License-Identifier: Apache-2.0
"""What loading a stage found: said once each, with how often and where."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

MAX_PLACES = 3
"""Prims named for each finding in a line; the rest is counted."""

MAX_KEPT = 500
"""Prims kept for each finding, for who lists them all."""


@dataclass
class Finding:
    """Something worth saying.

    Attributes:
        what: One line, lower case, no full stop.
        count: How often it came up.
        all_places: Prims or files it concerns, up to ``MAX_KEPT``.
    """

    what: str
    count: int = 0
    all_places: list[str] = field(default_factory=list)
    _known: set[str] = field(default_factory=set, repr=False, compare=False)

    def add(self, place: str, count: int = 1) -> None:
        """Counts it once more."""
        self.count += count
        if place and len(self._known) < MAX_KEPT and place not in self._known:
            self._known.add(place)
            self.all_places.append(place)

    @property
    def places(self) -> list[str]:
        """The first of ``all_places``."""
        return self.all_places[:MAX_PLACES]

    def line(self) -> str:
        """The finding as one line."""
        if not self.places:
            return self.what
        places = self.places
        more = self.count - len(places)
        return f"{self.what}: {', '.join(places)}" + (f" and {more} more" if more > 0 else "")

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {"what": self.what, "count": self.count, "places": self.places}


class LoadReport:
    """Notes, warnings and what is not supported, in the order they came up.

    Attributes:
        notes: What was chosen or approximated ("no camera: framed what is drawn").
        warnings: What is wrong in the stage and what was done about it.
        unsupported: What the stage asks for and Wavecomb does not do.
        counts: Prims by kind, as read.
    """

    def __init__(self) -> None:
        self._notes: dict[str, Finding] = {}
        self._warnings: dict[str, Finding] = {}
        self._unsupported: dict[str, Finding] = {}
        self.counts: dict[str, int] = {}
        self._aliases: dict[str, str] = {}

    @classmethod
    def of(
        cls,
        notes: Iterable[Finding] = (),
        warnings: Iterable[Finding] = (),
        unsupported: Iterable[Finding] = (),
        counts: Mapping[str, int] | None = None,
        aliases: Mapping[str, str] | None = None,
    ) -> LoadReport:
        """A report that another process was told."""
        report = cls()
        for to, findings in (
            (report._notes, notes),
            (report._warnings, warnings),
            (report._unsupported, unsupported),
        ):
            for finding in findings:
                finding._known.update(finding.all_places[:MAX_KEPT])
                to[finding.what] = finding
        report.counts.update(counts or {})
        report._aliases.update(aliases or {})
        return report

    @property
    def aliases(self) -> dict[str, str]:
        """Names of prototypes of USD's own: those of their first instances."""
        return dict(self._aliases)

    def alias(self, prototype: object, instance: object) -> None:
        """Makes places in a prototype of USD's own be named by the first instance of it."""
        self._aliases.setdefault(str(prototype), self.place(instance))

    def place(self, place: object) -> str:
        """A prim's path as the user knows it."""
        path = str(place)
        if not path.startswith("/__Prototype_"):
            return path
        head, slash, tail = path[1:].partition("/")
        return self._aliases.get(f"/{head}", f"/{head}") + slash + tail

    def note(self, what: str, place: object = "", count: int = 1) -> None:
        """Adds a note."""
        self._notes.setdefault(what, Finding(what)).add(self.place(place), count)

    def warn(self, what: str, place: object = "", count: int = 1) -> None:
        """Adds a warning about a prim or a file."""
        self._warnings.setdefault(what, Finding(what)).add(self.place(place), count)

    def missing(self, what: str, place: object = "", count: int = 1) -> None:
        """Adds something that is not supported."""
        self._unsupported.setdefault(what, Finding(what)).add(self.place(place), count)

    def absorb(self, other: LoadReport) -> None:
        """Adds all that another report was told, its prototypes named as here."""
        for add, findings in (
            (self.note, other.notes),
            (self.warn, other.warnings),
            (self.missing, other.unsupported),
        ):
            for finding in findings:
                first, *others = finding.all_places or [""]
                add(finding.what, first, finding.count - len(others))
                for place in others:
                    add(finding.what, place)
        for kind, count in other.counts.items():
            self.tally(kind, count)

    def absorb_new(self, other: LoadReport) -> None:
        """Adds what another report was told, of places where this one was not told the same."""
        for known, add, findings in (
            (self._notes, self.note, other.notes),
            (self._warnings, self.warn, other.warnings),
            (self._unsupported, self.missing, other.unsupported),
        ):
            for finding in findings:
                there = known[finding.what]._known if finding.what in known else set()
                for place in [one for one in finding.all_places if one not in there]:
                    add(finding.what, place)

    def tally(self, kind: str, count: int = 1) -> None:
        """Counts prims of a kind."""
        if count:
            self.counts[kind] = self.counts.get(kind, 0) + count

    @property
    def notes(self) -> list[Finding]:
        """What was chosen or approximated."""
        return list(self._notes.values())

    @property
    def warnings(self) -> list[Finding]:
        """What is wrong in the stage."""
        return list(self._warnings.values())

    @property
    def unsupported(self) -> list[Finding]:
        """What was asked for and is not done."""
        return list(self._unsupported.values())

    def lines(self) -> list[str]:
        """All findings as lines for a log, warnings first."""
        return [
            *(f"warning: {finding.line()}" for finding in self.warnings),
            *(f"not supported: {finding.line()}" for finding in self.unsupported),
            *(f"note: {finding.line()}" for finding in self.notes),
        ]

    def as_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "notes": [finding.as_dict() for finding in self.notes],
            "warnings": [finding.as_dict() for finding in self.warnings],
            "unsupported": [finding.as_dict() for finding in self.unsupported],
            "counts": dict(self.counts),
        }
