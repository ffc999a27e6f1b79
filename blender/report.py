# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages about parts of a scene that are not, or not exactly, translated."""

from __future__ import annotations


class Report:
    """Collects messages, each once, in the order of their arrival.

    Attributes:
        missing: Features that have no effect in the render.
        near: Features that the render approximates.
    """

    def __init__(self) -> None:
        self.missing: dict[str, list[str]] = {}
        self.near: dict[str, list[str]] = {}

    def miss(self, feature: str, owner: str) -> None:
        """Notes a feature of a data-block that has no effect."""
        self._note(self.missing, feature, owner)

    def approximate(self, feature: str, owner: str) -> None:
        """Notes a feature of a data-block that is approximated."""
        self._note(self.near, feature, owner)

    @staticmethod
    def _note(table: dict[str, list[str]], feature: str, owner: str) -> None:
        owners = table.setdefault(feature, [])
        if owner not in owners:
            owners.append(owner)

    def lines(self) -> list[str]:
        """Returns one line per feature, with the names of the data-blocks that use the feature."""
        found = []
        for word, table in (("not supported", self.missing), ("approximated", self.near)):
            for feature, owners in table.items():
                shown = ", ".join(owners[:4]) + (", ..." if len(owners) > 4 else "")
                found.append(f"{word}: {feature}: {shown}")
        return found
