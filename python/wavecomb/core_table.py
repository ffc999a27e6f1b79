# SPDX-License-Identifier: Apache-2.0
"""Tables of parameters that the core has, as rows of Python."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, Protocol, TypeVar


class _Named(Protocol):
    @property
    def name(self) -> str: ...


R = TypeVar("R", bound=_Named)


def rows_by_name(row: type[R], given: Iterable[Mapping[str, Any]]) -> Mapping[str, R]:
    """The rows of a table by name, in its order.

    Args:
        row: Made of what the core says of each.
        given: ``_core.setting_table()`` and the like. The core's floats become the shortest number
            that stands for them: 0.53, and not the double next to it.
    """

    def plain(value: Any) -> Any:
        return float(f"{value:.7g}") if isinstance(value, float) else value

    made = [row(**{key: plain(value) for key, value in one.items()}) for one in given]
    return MappingProxyType({one.name: one for one in made})
