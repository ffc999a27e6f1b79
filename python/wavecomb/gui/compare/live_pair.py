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

if TYPE_CHECKING:
    from wavecomb.gui.compare.source import SideSource

NOTE = (
    "Both renders go on at once and share all threads evenly, so each is slower than alone. "
    "Compare pictures here; compare times by the benchmark."
)


def _choices() -> dict[str, tuple[str, Sequence[Any], str]]:
    """Settings with a few values: label, values, tooltip."""
    from wavecomb import _core
    from wavecomb.scheduling import POLICIES, RAY_ORDERS

    return {
        "policy": ("Policy", POLICIES, "Order of shading; changes no bit of the picture"),
        "ray_order": (
            "Ray order",
            RAY_ORDERS,
            "Order of bounce rays; changes no bit of the picture",
        ),
        "roulette": (
            "Roulette",
            ("off", "throughput", "cost-aware"),
            "When paths end early: changes noise and time",
        ),
        "sampler": ("Sampler", ("sobol", "independent"), "Random numbers"),
        "integrator": ("Integrator", ("wavefront", "reference"), "The wave, or the scalar oracle"),
        "lanes": (
            "Lanes",
            (0, *_core.lane_widths()),
            "SIMD width, 0: widest; changes no bit of the picture",
        ),
    }


_NUMBERS = {
    "spp": ("Samples", 1, 1 << 20, "Samples per pixel"),
    "max_depth": ("Depth", 1, 64, "Scattering vertices of a path"),
    "seed": ("Seed", 0, 2**31 - 1, "Of the random numbers: another one is other noise"),
    "wave_size": ("Wave size", 0, 1 << 24, "Paths of a wave, 0: chosen; changes no bit"),
}
_REALS = {
    "adaptive": ("Adaptive", 1.0, 0.005, "Error to sample to, 0: all pixels alike"),
    "clamp_indirect": ("Clamp", 1000.0, 1.0, "Most that an indirect sample may add, 0: no limit"),
}


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
        for name, (label, values, tip) in _choices().items():
            self._add(forms[len(self._widgets) % 3], name, label, tip, self._combo(name, values))
        for name, (label, low, high, tip) in _NUMBERS.items():
            spin = QSpinBox(self)
            spin.setRange(low, high)
            spin.setKeyboardTracking(False)
            spin.valueChanged.connect(lambda value, name=name: self._change(name, value))
            self._add(forms[len(self._widgets) % 3], name, label, tip, spin)
        for name, (label, high_real, step, tip) in _REALS.items():
            real = QDoubleSpinBox(self)
            real.setRange(0.0, high_real)
            real.setDecimals(4 if high_real <= 1.0 else 2)
            real.setSingleStep(step)
            real.setKeyboardTracking(False)
            real.valueChanged.connect(lambda value, name=name: self._change(name, value))
            self._add(forms[len(self._widgets) % 3], name, label, tip, real)
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

    def _add(self, form: QFormLayout, name: str, label: str, tip: str, widget: QWidget) -> None:
        widget.setObjectName(f"{name}{self._source.name}")
        widget.setAccessibleName(f"{label} of {self._source.name}")
        widget.setToolTip(tip)
        widget.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self._widgets[name] = widget
        form.addRow(label, widget)

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
