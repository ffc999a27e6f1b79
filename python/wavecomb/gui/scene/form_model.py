# SPDX-License-Identifier: Apache-2.0
"""Form as data: rows of fields with editable values. Independent of widgets."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QObject, Signal

Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Range:
    """Range of a parameter.

    Attributes:
        low: Smallest value.
        high: Largest value.
        soft_low: Left end of the slider.
        soft_high: Right end of the slider.
        decimals: Number of decimals.
        logarithmic: Whether the slider is logarithmic. If ``low`` is 0, its left end means 0.
    """

    low: float
    high: float
    soft_low: float
    soft_high: float
    decimals: int = 3
    logarithmic: bool = False

    def share(self, value: float) -> float:
        """Returns the position of a value on the slider, from 0 to 1.

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
        """Returns the value at a position of the slider."""
        low, high = self.soft_low, self.soft_high
        if not self.logarithmic:
            return low + share * (high - low)
        return self.low if share <= 0.0 else low * (high / low) ** share


UNIT = Range(0.0, 1.0, 0.0, 1.0)


def differs(shown: Any, value: Any) -> bool:
    """Returns whether a field must be updated.

    Ignores rounding differences, because an update would move the text cursor.
    """
    if isinstance(shown, tuple) != isinstance(value, tuple):
        return True
    if isinstance(value, tuple):
        return any(differs(a, b) for a, b in zip(shown, value, strict=True))
    return bool(abs(shown - value) > 1e-6 * max(1.0, abs(value)))


NUMBER, COLOUR, SWITCH, DRIVEN = "number", "colour", "switch", "driven"


@dataclass(frozen=True)
class FieldRow:
    """A field of a form.

    Attributes:
        name: Name of the parameter.
        label: Label before the field.
        kind: "number", "colour", "switch", or "driven" for a value from a texture or primvar.
        value: Value when the form was made: a number, a colour of three numbers, or a bool; None
            for a driven field.
        title: Full name for people, such as "coat weight".
        bounds: Range of a number, or of each component of a colour.
        default: Value if nothing is authored; None if unknown.
        driver: Source of the value of a driven field, such as "texture wood.png".
        group: Heading above the field, or "".
        tip: Tooltip with the effect and the edited attribute.
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
    """Form of one object at a time. Subclasses provide the values and receive the edits.

    Signals:
        remade(): The rows changed, because another object or none is shown.
        changed(): The values of the same rows changed.

    Attributes:
        rows: Fields, in order.
        title: Name of the object, or "".
        note: Text in place of fields or below them.
        set_typing: Called at the start and end of typing a value, which becomes one undo step.
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
        """Returns the value that a field shows; None leaves the field as it is."""
        raise NotImplementedError

    def is_edited(self, name: str) -> bool:
        """Returns whether a field has an edit that can be reset."""
        raise NotImplementedError

    def set_value(self, name: str, value: Any) -> None:
        """Edits a field; None resets it to the value of the stage."""
        raise NotImplementedError

    def groups(self) -> list[str]:
        """Returns the headings in order. "" comes first if some fields have none."""
        return list(dict.fromkeys(row.group for row in self.rows))

    def is_open(self, group: str) -> bool:
        """Returns whether a heading is open.

        This is the user's choice, or else whether a field below it differs from its default.
        """
        used = any(
            row.kind == DRIVEN or row.value != row.default
            for row in self.rows
            if row.group == group
        )
        return self._folds.get(group, used)

    def fold(self, group: str, opened: bool) -> None:
        """Stores whether the user opened or closed a heading."""
        self._folds[group] = opened
