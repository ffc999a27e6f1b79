# SPDX-License-Identifier: Apache-2.0
"""Messages from loading a stage, each reported once with its number and locations."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

MAX_PLACES = 3
"""Locations in the text of a message; further ones are counted."""

LEVELS = ("warning", "not supported", "note")
"""Kinds of messages, in the order of a log."""

MAX_KEPT = 500
"""Maximum number of locations that are stored per message."""


@dataclass
class Finding:
    """A message with its locations.

    Attributes:
        what: One line in lower case, without a full stop.
        count: Number of occurrences.
        all_places: Prims or files that it concerns, up to ``MAX_KEPT``.
    """

    what: str
    count: int = 0
    all_places: list[str] = field(default_factory=list)
    _known: set[str] = field(default_factory=set, repr=False, compare=False)

    def add(self, place: str, count: int = 1) -> None:
        """Adds an occurrence."""
        self.count += count
        if place and len(self._known) < MAX_KEPT and place not in self._known:
            self._known.add(place)
            self.all_places.append(place)

    @property
    def places(self) -> list[str]:
        """The first ``MAX_PLACES`` locations."""
        return self.all_places[:MAX_PLACES]

    def line(self) -> str:
        """Returns the message with its locations as one line."""
        if not self.places:
            return self.what
        places = self.places
        more = self.count - len(places)
        return f"{self.what}: {', '.join(places)}" + (f" and {more} more" if more > 0 else "")

    def as_dict(self) -> dict[str, Any]:
        """Returns plain data for JSON."""
        return {"what": self.what, "count": self.count, "places": self.places}


class LoadReport:
    """Notes, warnings and unsupported features, in order of occurrence.

    Attributes:
        notes: Choices and approximations, such as "no camera: framed what is drawn".
        warnings: Errors in the stage and how they were handled.
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
        """Returns the path of a prim as the user knows it."""
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
        """Adds an unsupported feature."""
        self._add("not supported", what, place, count)

    def absorb(self, other: LoadReport) -> None:
        """Adds all messages and counts of another report, with this report's prototype names."""
        for level, findings in other._found.items():
            for finding in findings.values():
                first, *others = finding.all_places or [""]
                self._add(level, finding.what, first, finding.count - len(others))
                for place in others:
                    self._add(level, finding.what, place)
        for kind, count in other.counts.items():
            self.tally(kind, count)

    def absorb_new(self, other: LoadReport) -> None:
        """Adds messages of another report for locations that do not have the same message yet."""
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
        """Choices and approximations."""
        return list(self._found["note"].values())

    @property
    def warnings(self) -> list[Finding]:
        """Errors in the stage."""
        return list(self._found["warning"].values())

    @property
    def unsupported(self) -> list[Finding]:
        """Unsupported features."""
        return list(self._found["not supported"].values())

    def lines(self) -> list[str]:
        """Returns all messages as lines for a log, warnings first."""
        return [
            f"{level}: {finding.line()}"
            for level, findings in self._found.items()
            for finding in findings.values()
        ]

    def as_dict(self) -> dict[str, Any]:
        """Returns plain data for JSON."""
        return {
            "notes": [finding.as_dict() for finding in self.notes],
            "warnings": [finding.as_dict() for finding in self.warnings],
            "unsupported": [finding.as_dict() for finding in self.unsupported],
            "counts": dict(self.counts),
        }
