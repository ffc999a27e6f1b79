# SPDX-License-Identifier: Apache-2.0
"""Settings of a live render that is compared with another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QComboBox,
    QDoubleSpinBox,
    QFormLayout,
    QGridLayout,
    QLabel,
    QSpinBox,
    QWidget,
)

from wavecomb.gui import theme
from wavecomb.gui.scheduling.choices import choice
from wavecomb.options import Setting, settings

if TYPE_CHECKING:
    from wavecomb.gui.compare.source import SideSource

NOTE = (
    "Both renders go on at once and share all threads evenly, so each is slower than alone. "
    "Compare pictures here; compare times by the benchmark."
)


_CHOSEN = ("policy", "ray_order", "roulette", "sampler", "integrator", "lanes")
_NUMBERS = ("spp", "max_depth", "seed", "wave_size", "adaptive", "clamp_indirect")
_HIGHEST = {"max_depth": 64, "seed": 2**31 - 1, "adaptive": 1.0, "clamp_indirect": 1000.0}
_STEPS = {"adaptive": 0.005, "clamp_indirect": 1.0}


def _tip(row: Setting) -> str:
    """What it is, and whether the picture depends on it."""
    zero = f" 0: {row.zero}." if row.zero else ""
    return row.help + zero + ("" if row.changes_picture else " Changes no bit of the picture.")


class LiveSettings(QWidget):
    """A grid of settings; each change restarts that side alone."""

    def __init__(self, source: SideSource, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._source = source
        self._showing = False
        self._widgets: dict[str, QWidget] = {}
        self.setObjectName(f"live{source.name}")
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        forms = [QFormLayout(), QFormLayout(), QFormLayout()]
        for column, form in enumerate(forms):
            form.setVerticalSpacing(theme.em(0.2))
            grid.addLayout(form, 0, column)
        rows = settings()
        for name in _CHOSEN:
            offered = tuple(choice(name).values)
            self._add(forms[len(self._widgets) % 3], rows[name], self._combo(name, offered))
        for name in _NUMBERS:
            self._add(forms[len(self._widgets) % 3], rows[name], self._spin(rows[name]))
        note = QLabel(NOTE, self)
        note.setObjectName("sharing")
        note.setWordWrap(True)
        grid.addWidget(note, 1, 0, 1, 3)

    def _combo(self, name: str, values: Sequence[Any]) -> QComboBox:
        combo = QComboBox(self)
        for value in values:
            combo.addItem(str(value), value)
        combo.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        combo.setMinimumContentsLength(8)
        combo.activated.connect(lambda index, name=name: self._change(name, combo.itemData(index)))
        return combo

    def _spin(self, row: Setting) -> QSpinBox | QDoubleSpinBox:
        spin: QSpinBox | QDoubleSpinBox
        least, most = row.least or 0.0, _HIGHEST.get(row.name, row.most or 0.0)
        if row.zero:
            least = 0
        if row.kind == "integer":
            spin = QSpinBox(self)
            spin.setRange(int(least), int(most))
        else:
            spin = QDoubleSpinBox(self)
            spin.setDecimals(4 if most <= 1.0 else 2)
            spin.setRange(least, most)
            spin.setSingleStep(_STEPS.get(row.name, 0.1))
        spin.setKeyboardTracking(False)
        spin.valueChanged.connect(lambda value, name=row.name: self._change(name, value))
        return spin

    def _add(self, form: QFormLayout, row: Setting, widget: QWidget) -> None:
        widget.setObjectName(f"{row.name}{self._source.name}")
        widget.setAccessibleName(f"{row.label} of {self._source.name}")
        widget.setToolTip(_tip(row))
        widget.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self._widgets[row.name] = widget
        form.addRow(row.label, widget)

    def _change(self, name: str, value: Any) -> None:
        if not self._showing:
            self._source.change(**{name: value})
            self.show_setup()

    def show_setup(self) -> None:
        """What the render uses."""
        live = self._source.live
        if live is None:
            return
        self._showing = True
        for name, widget in self._widgets.items():
            value = getattr(live.setup, name)
            if isinstance(widget, QComboBox):
                widget.setCurrentIndex(max(widget.findData(value), 0))
            elif isinstance(widget, (QSpinBox, QDoubleSpinBox)) and not widget.hasFocus():
                widget.setValue(value)
        self._showing = False
