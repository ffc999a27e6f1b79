# SPDX-License-Identifier: Apache-2.0
"""A form as data: rows of fields with values that are edited. No widgets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QObject, Signal

from wavecomb.gui.scene.ranges import UNIT, Range

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
    """

    remade = Signal()
    changed = Signal()

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
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

    def set_typing(self, typing: bool) -> None:
        """Whether a value is being typed, which is one step however slow it is."""
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
