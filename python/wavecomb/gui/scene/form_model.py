# SPDX-License-Identifier: Apache-2.0
"""Form data without a user interface: rows of fields with editable values.

The form is independent of widgets.
"""

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
        low: Smallest allowed value.
        high: Largest allowed value.
        soft_low: Value at the left end of the slider.
        soft_high: Value at the right end of the slider.
        decimals: Number of displayed decimals.
        logarithmic: Whether the slider is logarithmic. If ``low`` is 0, the left end of a
            logarithmic slider stands for the value 0.
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
    """Returns whether a field must be updated to show a new value.

    Ignores rounding differences of values, because updating a field moves its text cursor.
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
        name: Name of the edited parameter.
        label: Label in front of the field.
        kind: "number", "colour", "switch", or "driven" for a value from a texture or primvar.
        value: Value at the time when the form was made: a number, a colour of three numbers, or a
            bool. None for a driven field.
        title: Full name to display, such as "coat weight".
        bounds: Range of the number, or of each component of the colour.
        default: Value of the parameter if nothing is authored; None if unknown.
        driver: Source of the value of a driven field, such as "texture wood.png".
        group: Heading above the field, or "" for none.
        tip: Tooltip that describes the field's effect and names the edited attribute.
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
    """Form that edits one object at a time.

    Subclasses provide the values of the fields and receive the edits.

    Signals:
        remade(): The rows changed, because the form shows another object or no object.
        changed(): Values of the form changed, but its rows are the same.

    Attributes:
        rows: Fields of the form, in order.
        title: Name of the edited object, or "".
        note: Text below the fields. It is shown even if there are no fields.
        set_typing: Function that is called when the user begins and ends typing a value. All
            changes in between become one undo step.
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
        """Returns the value that a field shows; None means that the field must not change."""
        raise NotImplementedError

    def is_edited(self, name: str) -> bool:
        """Returns whether a field has an edit that the user can reset."""
        raise NotImplementedError

    def set_value(self, name: str, value: Any) -> None:
        """Edits a field; the value None resets the field to the value in the stage's files."""
        raise NotImplementedError

    def groups(self) -> list[str]:
        """Returns the headings of the form in order.

        The heading "" comes first if some fields have no heading.
        """
        return list(dict.fromkeys(row.group for row in self.rows))

    def is_open(self, group: str) -> bool:
        """Returns whether a heading is open.

        The user can open and close headings. By default, a heading is open if a field below it
        differs from its default.
        """
        used = any(
            row.kind == DRIVEN or row.value != row.default
            for row in self.rows
            if row.group == group
        )
        return self._folds.get(group, used)

    def fold(self, group: str, opened: bool) -> None:
        """Stores whether the user opened or closed a heading of the form."""
        self._folds[group] = opened
