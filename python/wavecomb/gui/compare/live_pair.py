# SPDX-License-Identifier: Apache-2.0
"""Settings of a live render in a comparison."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from PySide6.QtWidgets import (
    QFormLayout,
    QGridLayout,
    QLabel,
    QWidget,
)

from wavecomb.gui import theme
from wavecomb.gui.scheduling.choices import Choice, Number, choice, number
from wavecomb.gui.scheduling.setting_controls import (
    ChoiceBox,
    Control,
    control_of,
    show_control,
)
from wavecomb.options import settings

if TYPE_CHECKING:
    from wavecomb.gui.compare.source import SideSource

NOTE = (
    "Both renders run at once and share all threads evenly, so each is slower than alone. "
    "Compare images here, and times with the benchmark."
)


_CHOSEN = ("policy", "ray_order", "roulette", "sampler", "integrator", "lanes")
_NUMBERS = ("spp", "max_depth", "seed", "wave_size", "adaptive", "clamp_indirect")
_SHOWN: dict[str, dict[str, Any]] = {
    "max_depth": {"most": 64},
    "seed": {"most": 2**31 - 1},
    "adaptive": {"least": 0.0, "most": 1.0},
    "clamp_indirect": {"most": 1000.0, "step": 1.0, "decimals": 2},
}
SAME = "Does not change the image."


def _row(name: str) -> Choice | Number:
    """Returns a form row for a setting; its tooltip says whether the setting affects the image."""
    setting = settings()[name]
    row = choice(name) if name in _CHOSEN else replace(number(name), **_SHOWN.get(name, {}))
    return row if setting.changes_picture else replace(row, tip=f"{row.tip} {SAME}")


class LiveSettings(QWidget):
    """Form rows with the settings of two live renders that are compared.

    A change of a setting restarts only the render that the setting belongs to.
    """

    def __init__(self, source: SideSource, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._source = source
        self._widgets: dict[str, Control] = {}
        self.setObjectName(f"live{source.name}")
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        forms = [QFormLayout(), QFormLayout(), QFormLayout()]
        for column, form in enumerate(forms):
            form.setVerticalSpacing(theme.em(0.2))
            grid.addLayout(form, 0, column)
        for place, name in enumerate((*_CHOSEN, *_NUMBERS)):
            self._add(forms[place % 3], _row(name))
        note = QLabel(NOTE, self)
        note.setObjectName("sharing")
        note.setWordWrap(True)
        grid.addWidget(note, 1, 0, 1, 3)

    def _add(self, form: QFormLayout, row: Choice | Number) -> None:
        control = control_of(row, self._change)
        control.setObjectName(f"{row.field}{self._source.name}")
        control.setAccessibleName(f"{row.label} of {self._source.name}")
        if isinstance(control, ChoiceBox):
            # Limit the width, so that three columns fit side by side.
            control.setMinimumContentsLength(7)
        else:
            control.setGroupSeparatorShown(False)
        self._widgets[row.field] = control
        form.addRow(row.label, control)

    def _change(self, name: str, value: Any) -> None:
        self._source.change(**{name: value})
        self.show_setup()

    def show_setup(self) -> None:
        """Shows the current settings of a live render in the form."""
        live = self._source.live
        if live is None:
            return
        for name, control in self._widgets.items():
            if isinstance(control, ChoiceBox) or not control.hasFocus():
                show_control(control, getattr(live.setup, name))
