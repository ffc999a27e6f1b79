# SPDX-License-Identifier: Apache-2.0
"""Adds rows to parameter tables, to test that every user of a table picks up new rows."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType, ModuleType
from typing import Any

import pytest


def add_rows(
    monkeypatch: pytest.MonkeyPatch,
    table: Callable[[], Mapping[str, Any]],
    added: Iterable[Any],
    follow: Iterable[str] = (),
) -> None:
    """Adds rows to a table, as if the core had them, until the test ends.

    Args:
        monkeypatch: Restores the table.
        table: Function that returns the table, as modules import it.
        added: The additional rows.
        follow: Modules that derive data from the table when they are imported.
    """
    # Import modules before adding rows, so that later tests see them without the added rows.
    for name in follow:
        importlib.import_module(name)
    rows = MappingProxyType({**table(), **{row.name: row for row in added}})
    for module in [one for name, one in sys.modules.items() if name.startswith("wavecomb.")]:
        for name in [name for name, value in vars(module).items() if value is table]:
            monkeypatch.setattr(module, name, lambda: rows)


def made_again(name: str) -> ModuleType:
    """Returns a second copy of a module, executed with the current table."""
    known = importlib.util.find_spec(name)
    assert known is not None
    assert known.origin is not None
    spec = importlib.util.spec_from_file_location(f"{name}_again", known.origin)
    assert spec is not None
    assert spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = made
    try:
        spec.loader.exec_module(made)
    finally:
        del sys.modules[spec.name]
    return made
