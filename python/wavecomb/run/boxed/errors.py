# SPDX-License-Identifier: Apache-2.0
"""Exceptions of the process in the sandbox, raised where it was asked."""

from __future__ import annotations

import builtins
from collections.abc import Mapping
from typing import Any

from wavecomb import _core
from wavecomb.errors import WavecombError
from wavecomb.run.boxed.wire import Refused

_MOST = 4000
_PASSED_ON = ("TypeError", "ValueError", "KeyError", "IndexError", "AttributeError", "OSError",
              "OverflowError", "MemoryError", "RuntimeError", "NotImplementedError")  # fmt: skip


def of_error(error: Exception) -> dict[str, str]:
    """An exception as plain data."""
    return {"type": type(error).__name__, "text": str(error)[:_MOST]}


def read_error(value: Mapping[str, Any]) -> Exception:
    """The exception that another process told of; one of a library's own as a RuntimeError.

    Raises:
        Refused: It is none.
    """
    kind, text = value.get("type"), value.get("text")
    if not isinstance(kind, str) or not isinstance(text, str) or len(text) > _MOST:
        raise Refused("an error that is none")
    if kind == "WavecombError":
        return WavecombError(text)
    if kind == "Error":
        return _core.Error(text)
    if kind in _PASSED_ON:
        found: Exception = getattr(builtins, kind)(text)
        return found
    return RuntimeError(f"{kind[:64]}: {text}")
