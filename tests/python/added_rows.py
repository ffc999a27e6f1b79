# SPDX-License-Identifier: Apache-2.0
"""Tables of parameters with a few rows more, for tests that such rows are found everywhere."""

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
    """Makes the table have those rows, too, as if the core had them.

    Args:
        monkeypatch: Ends it.
        table: As the modules that read it have it.
        added: The rows.
        follow: Modules that make something of the table when they are imported.
    """
    for name in follow:  # which others use after this test, as they are without those rows
        importlib.import_module(name)
    rows = MappingProxyType({**table(), **{row.name: row for row in added}})
    for module in [one for name, one in sys.modules.items() if name.startswith("wavecomb.")]:
        for name in [name for name, value in vars(module).items() if value is table]:
            monkeypatch.setattr(module, name, lambda: rows)


def made_again(name: str) -> ModuleType:
    """A module as it is made with the table of now, beside the one that there is."""
    known = importlib.util.find_spec(name)
    assert known is not None
    assert known.origin is not None
    spec = importlib.util.spec_from_file_location(f"{name}_again", known.origin)
    assert spec is not None
    assert spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = made  # where dataclasses look
    try:
        spec.loader.exec_module(made)
    finally:
        del sys.modules[spec.name]
    return made
