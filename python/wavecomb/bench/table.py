# SPDX-License-Identifier: Apache-2.0
"""Tables of a TOML file, read key by key, with errors that name the place."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from wavecomb.errors import WavecombError


class Table:
    """A table of the file; takes keys one by one, so that what is left over is unknown."""

    def __init__(self, path: Path, where: str, values: Mapping[str, Any]) -> None:
        self.path = path
        self.where = where
        self._values = dict(values)
        self._known: list[str] = []

    def error(self, key: str, what: str) -> WavecombError:
        """What to raise: a line that names the file, this table and the key."""
        place = f"{self.where}: {key}" if self.where else key
        return WavecombError(f"{self.path}: {place}: {what}")

    def below(self, where: str, values: Any) -> Table:
        """A table in it."""
        if not isinstance(values, Mapping):
            raise self.error(where, "must be a table")
        return Table(self.path, where, values)

    def take(self, key: str, kind: type, default: Any) -> Any:
        """The value of a key, of a type."""
        self._known.append(key)
        value = self._values.pop(key, default)
        if value is not default and (
            not isinstance(value, kind) or (kind is int and isinstance(value, bool))
        ):
            names = {str: "text", int: "a whole number", bool: "true or false", list: "a list"}
            raise self.error(key, f"must be {names.get(kind, 'a table')}, not {value!r}")
        return value

    def count(self, key: str, default: int, least: int) -> int:
        """A whole number from ``least`` up."""
        value = int(self.take(key, int, default))
        if value < least:
            raise self.error(key, f"must be at least {least}, not {value}")
        return value

    def choice(self, key: str, default: str, allowed: tuple[str, ...]) -> str:
        """One of some words."""
        value = str(self.take(key, str, default))
        if value not in allowed:
            raise self.error(key, f"must be one of {', '.join(allowed)}, not {value!r}")
        return value

    def tables(self, key: str) -> list[tuple[str, Any]]:
        """Tables by name."""
        return list(self.take(key, dict, {}).items())

    def list_of_tables(self, key: str) -> list[Any]:
        """Tables in a list."""
        entries = list(self.take(key, list, []))
        for entry in entries:
            if not isinstance(entry, Mapping):
                raise self.error(key, f"write [[{key}]] tables")
        return entries

    def rest(self) -> dict[str, Any]:
        """All keys that are left."""
        values, self._values = self._values, {}
        return values

    def end(self) -> None:
        """Raises WavecombError if a key is left."""
        for key in self._values:
            raise self.error(key, f"no such key; there are {', '.join(self._known)}")
