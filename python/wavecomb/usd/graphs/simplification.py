# SPDX-License-Identifier: Apache-2.0
"""Algebraic simplification of the operations of graphs."""

from __future__ import annotations

from typing import Any


def simplified(code: str, parts: tuple[Any, ...]) -> Any | None:
    """Simplifies an operation algebraically; returns None if the operation is needed."""
    a = parts[0]
    b = parts[1] if len(parts) > 1 else None
    if code == "add":
        return b if a == 0.0 else a if b == 0.0 else None
    if code == "subtract":
        return a if b == 0.0 else None
    if code == "multiply":
        if a == 0.0 or b == 0.0:
            return 0.0
        return b if a == 1.0 else a if b == 1.0 else None
    if code in ("divide", "power"):
        return a if b == 1.0 else None
    if code == "mix":
        c = parts[2]
        return a if c == 0.0 or a == b else b if c == 1.0 else None
    if code == "select":
        if isinstance(a, float):
            return b if a != 0.0 else parts[2]
        return b if b == parts[2] else None
    return None
