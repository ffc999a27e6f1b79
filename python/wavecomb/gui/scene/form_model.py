# SPDX-License-Identifier: Apache-2.0
"""A form as data: rows of fields with values that are edited. No widgets."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QObject, Signal

Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Range:
    """What a parameter can be.

    Attributes:
        low: Least value.
        high: Greatest value.
        soft_low: Left end of the slider.
        soft_high: Right end of the slider.
        decimals: Of the number.
        logarithmic: The slider's steps are ratios; its left end is 0 then where low is.
    """

    low: float
    high: float
    soft_low: float
    soft_high: float
    decimals: int = 3
    logarithmic: bool = False

    def share(self, value: float) -> float:
        """Where a value stands on the slider, from 0 to 1.

        >>> Range(0.0, 10.0, 0.0, 2.0).share(0.5), Range(0.0, 10.0, 0.0, 2.0).share(3.0)
        (0.25, 1.0)
        """
        low, high = self.soft_low, self.soft_high
        if self.logarithmic:
            share = math.log(max(value, low) / low) / math.log(high / low)
        else:
            share = (value - low) / (high - low)
        return min(max(share, 0.0), 1.0)

    def value_at(self, share: float) -> float:
        """The value at a place of the slider."""
        low, high = self.soft_low, self.soft_high
        if not self.logarithmic:
            return low + share * (high - low)
        return self.low if share <= 0.0 else low * (high / low) ** share


UNIT = Range(0.0, 1.0, 0.0, 1.0)


def differs(shown: Any, value: Any) -> bool:
    """Whether a field must be set anew: not for rounding, which would take the cursor away."""
    if isinstance(shown, tuple) != isinstance(value, tuple):
        return True
    if isinstance(value, tuple):
        return any(differs(a, b) for a, b in zip(shown, value, strict=True))
    return bool(abs(shown - value) > 1e-6 * max(1.0, abs(value)))


NUMBER, COLOUR, SWITCH, DRIVEN = "number", "colour", "switch", "driven"


@dataclass(frozen=True)
class FieldRow:
    """One field.

    Attributes:
        name: By which it is set.
        label: Before it.
        kind: "number", "colour", "switch", or "driven": something else gives the value.
        value: When the form was made: a number, three of them, a bool; None where it is driven.
        title: For people, with what tells it from others: "coat weight".
        bounds: Of a number, and of each part of a colour.
        default: Value where nobody says any; None: not known.
        driver: What gives the value of a driven one: "texture wood.png".
        group: Heading that it stands under; "": none.
        tip: What it does and where the edit goes.
    """

    name: str
    label: str
    kind: str
    value: Any
    title: str
    bounds: Range = UNIT
    default: Any = None
    driver: str = ""
    group: str = ""
    tip: str = ""


class FormModel(QObject):
    """Fields of one thing at a time. Subclasses say what the values are and where edits go.

    Signals:
        remade(): Other rows: another thing is shown, or none.
        changed(): The same rows, other values.

    Attributes:
        rows: Fields, in order.
        title: What it is of, "" for nothing.
        note: Said in place of fields, or below them.
        set_typing: Starts or ends a value that is being typed, which is one step of undo.
    """

    remade = Signal()
    changed = Signal()

    def __init__(self, set_typing: Callable[[bool], None], parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.set_typing = set_typing
        self.rows: list[FieldRow] = []
        self.title = self.note = ""
        self._folds: dict[str, bool] = {}

    def value(self, name: str) -> Any:
        """What a field is to show now; None: what it shows."""
        raise NotImplementedError

    def is_edited(self, name: str) -> bool:
        """Whether there is something to take back."""
        raise NotImplementedError

    def set_value(self, name: str, value: Any) -> None:
        """Edits a field; None: back to what the stage has."""
        raise NotImplementedError

    def groups(self) -> list[str]:
        """Headings, in order; "" first where fields have none."""
        return list(dict.fromkeys(row.group for row in self.rows))

    def is_open(self, group: str) -> bool:
        """Whether a heading is open: as somebody left it, or where something is not by default."""
        used = any(
            row.kind == DRIVEN or row.value != row.default
            for row in self.rows
            if row.group == group
        )
        return self._folds.get(group, used)

    def fold(self, group: str, opened: bool) -> None:
        """Keeps how somebody left a heading."""
        self._folds[group] = opened
