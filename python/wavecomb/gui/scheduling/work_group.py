# SPDX-License-Identifier: Apache-2.0
"""Controls for the amount of work: roulette, light selection and adaptive sampling."""

from __future__ import annotations

from typing import Any

from PySide6.QtWidgets import (
    QFormLayout,
    QGroupBox,
    QLabel,
    QWidget,
)

from wavecomb.gui.scheduling import choices
from wavecomb.gui.scheduling.choices import Choice
from wavecomb.gui.scheduling.setting_controls import (
    ChoiceBox,
    Control,
    add_row,
    control_of,
    show_control,
)
from wavecomb.gui.viewport.session import Session, Setup

_MODE = Choice("adaptive_mode", "Adaptive", "Distribution of samples.", choices.ADAPTIVE_MODES)
_FIRST = {"adaptive": 0.02, "noise": 0.02}
"""Initial error target of each mode of adaptive sampling."""


class WorkGroup(QGroupBox):
    """Group of controls for the settings that change the amount of work and therefore the noise."""

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__("Amount of work", parent)
        self._session = session
        self._targets = dict(_FIRST)
        form = QFormLayout(self)
        form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        note = QLabel("These change the noise, but not the expectation of the picture.")
        note.setWordWrap(True)
        form.addRow(note)
        self._mode = ChoiceBox(_MODE, self._choose_mode)
        self._controls: dict[str, Control] = {}
        for one in choices.fields_of("work"):
            if one.field == "adaptive":
                add_row(form, "Adaptive", self._mode)
            self._controls[one.field] = control_of(one, self._choose)
            add_row(form, one.label, self._controls[one.field])
        session.setup_changed.connect(self._show)
        self._show(session.setup)

    def _choose(self, field: str, value: Any) -> None:
        if not self._session.change(**{field: value}):
            self._show(self._session.setup)

    def _choose_mode(self, field: str, mode: str) -> None:
        values: dict[str, Any] = {
            "adaptive": self._targets["adaptive"] if mode == "pixel" else 0.0,
            "noise": self._targets["noise"] if mode == "noise" else 0.0,
        }
        setup = self._session.setup
        if mode != "off" and setup.spp < setup.min_spp:
            values["min_spp"] = setup.spp  # the core requires spp to be at least min_spp
        if not self._session.change(**values):
            self._show(setup)

    def _show(self, setup: Setup) -> None:
        self._mode.show_value(mode_of(setup))
        for field in _FIRST:
            if getattr(setup, field):
                self._targets[field] = getattr(setup, field)
        is_adaptive = bool(setup.adaptive or setup.noise)
        for field, control in self._controls.items():
            show_control(control, self._targets.get(field) or getattr(setup, field))
        self._controls["roulette_depth"].setEnabled(setup.roulette != "off")
        self._controls["adaptive"].setEnabled(bool(setup.adaptive))
        self._controls["noise"].setEnabled(bool(setup.noise))
        self._controls["min_spp"].setEnabled(is_adaptive)


def mode_of(setup: Setup) -> str:
    """Returns the adaptive sampling mode of a setup, which has at most one error target."""
    return "pixel" if setup.adaptive else "noise" if setup.noise else "off"
