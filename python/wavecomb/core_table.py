# SPDX-License-Identifier: Apache-2.0
"""Converts parameter tables of the core to Python rows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, Protocol, TypeVar


class _Named(Protocol):
    @property
    def name(self) -> str: ...


R = TypeVar("R", bound=_Named)


def rows_by_name(row: type[R], given: Iterable[Mapping[str, Any]]) -> Mapping[str, R]:
    """Returns the rows of a table by name, in the table's order.

    Args:
        row: Class of a row.
        given: Result of ``_core.setting_table()`` or a similar function. Its float32 values become
            the shortest decimal numbers that represent them, such as 0.53.
    """

    def plain(value: Any) -> Any:
        return float(f"{value:.7g}") if isinstance(value, float) else value

    made = [row(**{key: plain(value) for key, value in one.items()}) for one in given]
    return MappingProxyType({one.name: one for one in made})
