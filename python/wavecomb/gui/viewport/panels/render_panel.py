# SPDX-License-Identifier: Apache-2.0
"""Panel of the settings that lighting artists change: time, light transport and denoising."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from PySide6.QtWidgets import QCheckBox, QFormLayout, QWidget

from wavecomb.gui import theme
from wavecomb.gui.scheduling.choices import Choice, choice, number
from wavecomb.gui.scheduling.setting_controls import (
    ChoiceBox,
    Control,
    add_row,
    control_of,
    show_control,
)
from wavecomb.gui.viewport.session import Session, Setup
from wavecomb.gui.widgets import named

_OFF = {"least": 0, "zero": "off"}
_ROWS: dict[str, tuple[str, dict[str, Any]]] = {
    "spp": ("&Samples", {}),
    "noise": ("&Noise target", {**_OFF, "step": 0.005}),
    "time_limit": ("&Time limit", {**_OFF, "step": 10}),
    "max_depth": ("De&pth", {}),
    "guiding": ("&Guiding", {}),
    "transport": ("&Caustics", {}),
    "firefly": ("&Fireflies", {}),
    "clamp_indirect": ("C&lamp", {}),
}
"""For each setting, its label and those display options that differ from the Scheduling panel's."""
_CHOICES = ("guiding", "transport", "firefly")
_TEXTS = {"path": "camera paths", "light": "light paths", "bdpt": "both, connected"}
_NAMES = {"max_depth": "depth"}
"""Object names of controls that differ from the names of their settings."""


class RenderPanel(QWidget):
    """Panel of the most frequently used render settings."""

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self.controls: dict[str, Control] = {}
        self.denoise = named(
            QCheckBox("&Denoise"), "render.denoise", "Denoise",
            "Denoise the picture with Open Image Denoise (Shift+D)",
        )  # fmt: skip
        form = QFormLayout(self)
        form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        for name, (label, options) in _ROWS.items():
            row: Choice | Any = choice(name) if name in _CHOICES else number(name)
            box = self.controls[name] = control_of(replace(row, **options), self._change)
            box.setObjectName(f"render.{_NAMES.get(name, name)}")
            if isinstance(box, ChoiceBox):
                for value, text in _TEXTS.items():
                    if (at := box.find(value)) >= 0:
                        box.setItemText(at, text)
            else:
                box.setGroupSeparatorShown(False)
            box.setMinimumWidth(theme.em(5))
            add_row(form, label, box)
            if name == "max_depth":
                form.addRow("", self.denoise)
        self.denoise.toggled.connect(self._denoise_toggled)
        session.setup_changed.connect(self._show)
        self._show(session.setup)

    def _change(self, name: str, value: Any) -> None:
        values = {name: value}
        setup = self._session.setup
        if name == "noise" and value:
            # A render can have only one error target, so the other target is set to 0. The core
            # requires that min_spp is at most spp.
            values |= {"adaptive": 0.0, "min_spp": min(setup.min_spp, setup.spp)}
        if name == "spp" and (setup.noise or setup.adaptive):
            values["min_spp"] = min(setup.min_spp, value)
        if not self._session.change(**values):
            self._show(setup)

    def _denoise_toggled(self, on: bool) -> None:
        if on:
            from wavecomb.errors import WavecombError
            from wavecomb.image.denoise import check_denoiser

            try:
                check_denoiser()
            except WavecombError as error:
                self._session.failed.emit(str(error))
                self.denoise.setChecked(False)
                return
        self._session.change(denoise=on)

    def _show(self, setup: Setup) -> None:
        for name, control in self.controls.items():
            show_control(control, getattr(setup, name))
        self.denoise.blockSignals(True)
        self.denoise.setChecked(setup.denoise)
        self.denoise.blockSignals(False)
