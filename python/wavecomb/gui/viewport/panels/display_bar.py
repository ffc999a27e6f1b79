# SPDX-License-Identifier: Apache-2.0
"""Tool bar with display settings: layer, exposure, tone mapping, false colours and zoom."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

from PySide6.QtCore import QSettings, Qt
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QDoubleSpinBox,
    QLabel,
    QSizePolicy,
    QSlider,
    QToolBar,
    QWidget,
)

from wavecomb import ocio
from wavecomb.gui import theme
from wavecomb.gui.viewport import display
from wavecomb.gui.viewport.frames import Frame
from wavecomb.gui.viewport.panels.expression_dialog import ExpressionDialog
from wavecomb.gui.viewport.session import Session, Setup
from wavecomb.gui.viewport.viewport import Viewport
from wavecomb.gui.widgets import caption, choice, named, real, set_quietly
from wavecomb.image.layer_view import has_false_colours, is_light
from wavecomb.run import aovs as aov_names
from wavecomb.run import expressions

EXPOSURE = 10.0
"""Largest exposure in stops. The smallest exposure is the negative of this value."""
EXPRESSION = expressions.PREFIX
"""Entry of the layer box that opens the dialog for light path expressions."""
_ZOOMS = ("Fit", "50 %", "100 %", "200 %", "400 %", "800 %", "1600 %")


@cache
def _titles() -> dict[str, str]:
    """Returns the titles of the layers that the layer box offers, in order."""
    names = ("beauty", "denoised", *aov_names.core_aovs(), "samples", *aov_names.ERRORS)
    rows = {name: aov_names.row_of(name) for name in names}
    return {name: row.title for name, row in rows.items() if row and row.title}


def _title(layer: str) -> str:
    """Returns the displayed title of a layer."""
    if layer == EXPRESSION:
        return "Light path\u2026"
    if layer.startswith(expressions.LAYER):
        return layer.removeprefix(expressions.LAYER) + " (light path)"
    return _titles().get(layer, layer.removeprefix(aov_names.LIGHT) + " (light group)")


class DisplayBar(QToolBar):
    """Tool bar of display settings.

    Choosing a layer that the current render lacks restarts the render.

    Attributes:
        layer: Combo box that selects the displayed layer.
        exposure: Number box of the exposure in stops.
        view: Combo box that selects the tone mapping.
    """

    def __init__(self, session: Session, viewport: Viewport, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("display")
        self._session, self._viewport = session, viewport
        self._denoising = session.setup.denoise
        self._dialog: ExpressionDialog | None = None
        self.layer = choice(
            "display.layer",
            "Layer",
            "Displayed layer; a layer that is not rendered yet restarts the render",
            [],
            lambda text: self.choose_layer(self.layer.currentData()),
        )
        self._fill_layers()
        self.exposure = real(
            "display.exposure",
            "Exposure",
            "Stops: each doubles the light.  [ and ] change it, \\ resets it",
            -EXPOSURE, EXPOSURE, 0.25, 0.0, changed=self.set_exposure,
        )  # fmt: skip
        self.exposure.setSuffix(" EV")
        self.slider = named(
            QSlider(Qt.Orientation.Horizontal), "display.exposure_slider", "Exposure slider",
            "Exposure in stops",
        )  # fmt: skip
        self.slider.setRange(round(-EXPOSURE * 20), round(EXPOSURE * 20))
        self.slider.setPageStep(20)
        self.slider.setMinimumWidth(theme.em(3))
        self.slider.valueChanged.connect(lambda value: self.set_exposure(value / 20))
        self.view = choice(
            "display.view",
            "View",
            "Tone mapping: Linear (as `wavecomb render --png`), Neutral (highlights "
            "rolled off), or a view of OpenColorIO; $OCIO chooses the configuration",
            display.views(),
            self.set_view,
        )
        for box, letters in ((self.layer, 10), (self.view, 8)):
            box.setSizeAdjustPolicy(
                QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon
            )
            box.setMinimumContentsLength(letters)
            box.view().setTextElideMode(Qt.TextElideMode.ElideNone)
        self.automatic = named(
            QCheckBox("Auto range"), "display.auto", "Automatic range",
            "False colours from the smallest to the largest value of the picture",
        )  # fmt: skip
        self.automatic.setChecked(True)
        self.automatic.toggled.connect(self._range_changed)
        self.low = self._bound("display.low", "Smallest value of the false colours")
        self.high = self._bound("display.high", "Largest value of the false colours")
        self.zoom = choice(
            "display.zoom",
            "Zoom",
            "Screen pixels per image pixel; Ctrl+wheel zooms, right drag pans",
            _ZOOMS,
            self._zoom_chosen,
        )
        self.zoom.setEditable(False)
        self._lay_out()
        viewport.zoom_changed.connect(self._zoom_changed)
        viewport.shown.connect(self._shown)
        session.setup_changed.connect(self._setup_changed)
        session.frame.connect(self._refresh)
        if session.setup.denoise:
            self._apply(layer="denoised")
            self.layer.setCurrentIndex(self.layer.findData("denoised"))
        self._update_range()

    def _bound(self, name: str, title: str) -> QDoubleSpinBox:
        def changed(value: float) -> None:
            self._range_changed()

        return real(name, title, title, -1e9, 1e9, 0.1, 0.0, changed=changed, decimals=4)

    def _lay_out(self) -> None:
        self._to = QLabel(" to ")
        self._stops = caption(" &Exposure ", self.exposure)
        gap = QWidget()
        gap.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        self._places = {
            widget: self.addWidget(widget)
            for widget in (
                self.layer, self._stops, self.slider, self.exposure,
                self.view, self.automatic, self.low, self._to, self.high, gap, self.zoom,
            )
        }  # fmt: skip

    # ---- layers ----------------------------------------------------------------------------------

    def _fill_layers(self) -> None:
        """Fills the combo box of layers.

        The combo box offers AOVs, rendered light path expressions and, if there are several, light
        groups.
        """
        scene, names = self._session.scene, list(_titles())
        groups = () if scene is None else scene.light_groups
        further = [aov_names.LIGHT + group for group in groups] if len(groups) > 1 else []
        kept = filter(expressions.is_expression, self._session.setup.aovs)
        names += dict.fromkeys([*further, *map(expressions.layer_of, kept), EXPRESSION])
        if [self.layer.itemData(i) for i in range(self.layer.count())] == names:
            return
        self.layer.clear()
        for name in names:
            self.layer.addItem(_title(name), name)
        self._show_current()

    def _show_current(self) -> None:
        self.layer.setCurrentIndex(max(self.layer.findData(self._viewport.look.layer), 0))

    def ask_expression(self) -> ExpressionDialog:
        """Opens the dialog that adds a light path expression and shows its layer."""
        if self._dialog is None:
            self._dialog = ExpressionDialog(self._session, self.choose_layer, self)
        self._dialog.show()
        self._dialog.raise_()
        return self._dialog

    def choose_layer(self, name: str) -> None:
        """Shows a layer. Restarts the render with this layer if the current render lacks it."""
        setup = self._session.setup
        if name == EXPRESSION:
            self._show_current()
            self.ask_expression()
            return
        if not self._ask_for(name, setup):
            self._show_current()
            return
        self._fill_layers()
        self.layer.setCurrentIndex(self.layer.findData(name))
        self._apply(layer=name, low=None, high=None)
        self.automatic.setChecked(True)
        self._update_range()

    def _ask_for(self, name: str, setup: Setup) -> bool:
        if name == "beauty" or name in map(expressions.layer_of, setup.aovs):
            return True
        if name == "denoised":
            return setup.denoise or self._session.change(denoise=True)
        return self._session.change(aovs=(*setup.aovs, name))

    def step_layer(self, by: int) -> None:
        """Shows the next or previous layer of the current frame."""
        frame = self._session.last_frame
        if frame is None:
            return
        names = [n for n in frame.names() if self.layer.findData(n) >= 0]
        current = self._viewport.look.layer
        at = names.index(current) if current in names else 0
        self.choose_layer(names[(at + by) % len(names)])

    def _setup_changed(self, setup: Setup) -> None:
        """Shows the denoised layer or the beauty when denoising is switched on or off."""
        shown = self._viewport.look.layer
        if setup.denoise and not self._denoising and shown == "beauty":
            self.choose_layer("denoised")
        elif not setup.denoise and shown == "denoised":
            self.choose_layer("beauty")
        self._denoising = setup.denoise

    def _refresh(self, frame: Frame | None) -> None:
        self._fill_layers()

    # ---- exposure and view -----------------------------------------------------------------------

    def set_exposure(self, stops: float) -> None:
        """Sets the exposure in stops."""
        stops = min(max(stops, -EXPOSURE), EXPOSURE)
        set_quietly(self.exposure, stops)
        set_quietly(self.slider, round(stops * 20))
        self._apply(exposure=stops)

    def set_view(self, name: str) -> None:
        """Sets the tone mapping. Ignores an unknown name."""
        index = self.view.findText(name)
        if index >= 0:
            self.view.setCurrentIndex(index)
            self._apply(view=name)

    def _apply(self, **values: Any) -> None:
        look = replace(self._viewport.look, **values)
        if look != self._viewport.look:
            self._viewport.set_look(look)

    # ---- false colours ---------------------------------------------------------------------------

    def _range_changed(self) -> None:
        if self.automatic.isChecked():
            self._apply(low=None, high=None)
        else:
            self._apply(low=self.low.value(), high=self.high.value())
        self._update_range()

    def _update_range(self) -> None:
        light = is_light(self._viewport.look.layer)
        coloured = has_false_colours(self._viewport.look.layer)
        for widget in (self._stops, self.exposure, self.slider, self.view):
            self._places[widget].setVisible(light)
        self._places[self.automatic].setVisible(coloured)
        for widget in (self.low, self._to, self.high):
            self._places[widget].setVisible(coloured and not self.automatic.isChecked())

    def _shown(self, frame: Frame, look: display.Look) -> None:
        legend = self._viewport.legend()
        if legend is not None and self.automatic.isChecked():
            set_quietly(self.low, legend.low)
            set_quietly(self.high, legend.high)

    # ---- zoom ------------------------------------------------------------------------------------

    def _zoom_chosen(self, text: str) -> None:
        self._viewport.set_zoom(None if text == "Fit" else float(text.split()[0]) / 100.0)

    def _zoom_changed(self, zoom: float) -> None:
        text = "Fit" if self._viewport.is_fitted() else f"{zoom * 100.0:.0f} %"
        for i in range(self.zoom.count() - 1, len(_ZOOMS) - 1, -1):
            self.zoom.removeItem(i)
        if self.zoom.findText(text) < 0:
            self.zoom.addItem(text)
        self.zoom.setCurrentText(text)

    # ---- saved settings
    # ------------------------------------------------------------------------------

    def restore(self, settings: QSettings) -> None:
        """Restores the tone mapping that was saved in an earlier session."""
        self.set_view(str(settings.value("display/view", display.LINEAR)))
        if (problem := ocio.problem()) is not None:
            self._session.warned.emit(problem)

    def keep(self, settings: QSettings) -> None:
        """Saves the tone mapping for the next session."""
        settings.setValue("display/view", self._viewport.look.view)
