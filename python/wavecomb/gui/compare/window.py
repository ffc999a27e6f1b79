# SPDX-License-Identifier: Apache-2.0
"""Compare window, which shows two images or two live renders and their difference values."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtGui import QHideEvent, QPalette
from PySide6.QtWidgets import (
    QApplication,
    QComboBox,
    QDockWidget,
    QHBoxLayout,
    QLabel,
    QSplitter,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from wavecomb.gui import theme
from wavecomb.gui.compare.differences import MAPS, Numbers
from wavecomb.gui.compare.jobs import Ask, Jobs
from wavecomb.gui.compare.layout import MODES, SIDE
from wavecomb.gui.compare.numbers import NumbersPanel
from wavecomb.gui.compare.picker import SidePicker
from wavecomb.gui.compare.picture_sides import Side, common_layers
from wavecomb.gui.compare.source import SideSource
from wavecomb.gui.compare.view import CompareView
from wavecomb.gui.viewport import display
from wavecomb.gui.viewport.display import Look
from wavecomb.gui.widgets import named, real, set_text_colour, tool
from wavecomb.image.compare.heatmap import Scale

if TYPE_CHECKING:
    from PySide6.QtGui import QImage

    from wavecomb.gui.viewport.session import Session

_KEYS = {"side": "1", "wipe": "2", "flip": "3", "difference": "4", "three": "5"}


class CompareWindow(QWidget):
    """Window that compares images A and B visually and by difference values.

    Signals:
        failed(str): Emitted on an error, with one line that says how to fix it. The window also
            shows this line.
    """

    failed = Signal(str)

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("compareWindow")
        self.setWindowTitle("Compare")
        self.session = session
        self.a = SideSource("A", session, self)
        self.b = SideSource("B", session, self)
        self.sources = {"A": self.a, "B": self.b}
        self.view = CompareView(self)
        self.numbers = NumbersPanel(self)
        self._jobs = Jobs(self)
        self._pickers = {name: SidePicker(s, session, self) for name, s in self.sources.items()}
        self._error = QLabel(self)
        self._error.setObjectName("compareError")
        self._error.setWordWrap(True)
        self._error.hide()
        self._lay_out()
        self._mark_mode()
        theme.on_change(self._mark_mode)
        for name, source in self.sources.items():
            source.changed.connect(self.refresh)
            source.failed.connect(self._fail)
            self._pickers[name].dropped.connect(lambda paths, name=name: self.open(name, paths))
        self.view.dropped.connect(self.open)
        self.view.hovered.connect(self._hover)
        self._jobs.images.connect(self._take_images)
        self._jobs.numbers.connect(self._take_numbers)
        self._jobs.map.connect(self._take_map)
        self._jobs.failed.connect(self._fail)
        self.refresh()

    # ---- layout --------------------------------------------------------------------------------

    def _lay_out(self) -> None:
        sides = QHBoxLayout()
        swap = tool("swap", "⇄", "Exchange A and B", self)
        swap.clicked.connect(lambda: self.a.exchange(self.b))
        sides.addWidget(self._pickers["A"], 1)
        sides.addWidget(swap, 0, Qt.AlignmentFlag.AlignTop)
        sides.addWidget(self._pickers["B"], 1)
        split = QSplitter(Qt.Orientation.Horizontal, self)
        split.addWidget(self.view)
        split.addWidget(self.numbers)
        split.setStretchFactor(0, 1)
        split.setSizes([theme.em(45), theme.em(22)])
        column = QVBoxLayout(self)
        column.addLayout(sides)
        column.addWidget(self._error)
        column.addLayout(self._mode_bar())
        column.addLayout(self._look_bar())
        column.addWidget(split, 1)

    def _mode_bar(self) -> QHBoxLayout:
        bar = QHBoxLayout()
        self._modes: dict[str, QToolButton] = {}
        for mode, title in MODES.items():
            button = tool(f"mode-{mode}", title, f"{title} (Alt+{_KEYS[mode]})", self)
            button.setCheckable(True)
            button.setAutoExclusive(True)
            button.setShortcut(f"Alt+{_KEYS[mode]}")
            button.clicked.connect(lambda checked=False, mode=mode: self.set_mode(mode))
            button.toggled.connect(lambda checked: self._mark_mode())
            self._modes[mode] = button
            bar.addWidget(button)
        self._modes[SIDE].setChecked(True)
        bar.addStretch(1)
        for name, text, tip, call in (
            ("fit", "Fit", "The whole picture (0)", self.view.fit),
            ("one", "1:1", "One image pixel per screen pixel (1)", self._one_to_one),
        ):
            button = tool(name, text, tip, self)
            button.clicked.connect(lambda checked=False, call=call: call())
            bar.addWidget(button)
        return bar

    def _mark_mode(self) -> None:
        """Highlights the button of the chosen view mode."""
        colours = QApplication.palette()
        for button in self._modes.values():
            own = QPalette()
            if button.isChecked():
                own.setColor(QPalette.ColorRole.Button, colours.highlight().color())
                own.setColor(QPalette.ColorRole.ButtonText, colours.highlightedText().color())
            button.setPalette(own)

    def _look_bar(self) -> QHBoxLayout:
        bar = QHBoxLayout()
        self._map = self._combo("map", "Difference", "Kind of difference to show")
        for kind, title in MAPS.items():
            self._map.addItem(title, kind)
        self._layer = self._combo("layer", "Layer", "Layer to compare")
        self._layer.addItem("beauty")
        self._exposure = real(
            "compareExposure", "Exposure of both",
            "Exposure of both pictures in stops; PSNR and FLIP are computed with it",
            -20.0, 20.0, 0.5, 0.0, changed=lambda value: self.refresh(),
        )  # fmt: skip
        self._exposure.setSuffix(" stops")
        self._tone = self._combo("tone", "Tone mapping of both", "Tone mapping of both pictures")
        self._tone.addItems(display.views())
        for combo in (self._map, self._layer, self._tone):
            combo.currentIndexChanged.connect(self.refresh)
        for widget in (self._map, self._layer, self._exposure, self._tone):
            bar.addWidget(widget)
        bar.addStretch(1)
        return bar

    def _combo(self, name: str, accessible: str, tip: str) -> QComboBox:
        combo = named(QComboBox(self), f"compare-{name}", accessible, tip)
        combo.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        combo.setMinimumContentsLength(12)
        return combo

    def sizeHint(self) -> QSize:
        """Returns a preferred size that fits two images and the table of difference values."""
        return QSize(theme.em(70), theme.em(42))

    # ---- public methods
    # ----------------------------------------------------------------------------

    def keep(self, which: str) -> None:
        """Copies the viewport's current image to image "A" or "B"."""
        self.sources[which].keep()

    def open(self, which: str, paths: list[str | Path]) -> None:
        """Opens a file as image "A" or "B". Two files at once become A and B."""
        if len(paths) > 2:
            self._fail(f"{len(paths)} files were dropped: drop one, or two for A and B")
        elif len(paths) == 2:
            self.a.open(Path(paths[0]))
            self.b.open(Path(paths[1]))
        else:
            self.sources[which].open(Path(paths[0]))

    def compare(self, a: Side | Path | None, b: Side | Path | None) -> None:
        """Shows two images, and raises the window.

        An argument of None keeps the current image of that side.
        """
        for source, side in ((self.a, a), (self.b, b)):
            if isinstance(side, Side):
                source.set_side(side)
            elif side is not None:
                source.open(side)
        dock = self.parentWidget()
        while dock is not None and not isinstance(dock, QDockWidget):
            dock = dock.parentWidget()
        if dock is not None:
            dock.show()
            dock.raise_()

    def set_mode(self, mode: str) -> None:
        """Sets the view mode, one of ``layout.MODES``."""
        self._modes[mode].setChecked(True)
        self.view.set_mode(mode)
        self.view.setFocus()

    @property
    def busy(self) -> bool:
        """Whether an image is being read or a difference is being computed."""
        return self._jobs.busy or self.a.loading or self.b.loading

    def shutdown(self) -> None:
        """Stops the live renders and all computations of the window."""
        self._jobs.close()
        self.a.close()
        self.b.close()

    # ---- inside --------------------------------------------------------------------------------

    def _one_to_one(self) -> None:
        self.view.set_zoom(1.0 / self.view.devicePixelRatioF())

    def look(self) -> Look:
        """Returns the layer, exposure and tone mapping that apply to both images."""
        layer = self._layer.currentText() or "beauty"
        return Look(layer, self._exposure.value(), self._tone.currentText())

    def refresh(self) -> None:
        """Computes everything that the compare window shows."""
        self._show_layers()
        for name, source in self.sources.items():
            title = source.side.name if source.side is not None else ""
            self.view.names[name] = f"{name}  {title}"
        ask = Ask(self.a.side, self.b.side, self.look(), self._map.currentData())
        self.view.names["D"] = f"A - B: {self._map.currentText()}"
        self.view.set_message(ask.problem)
        self._error.hide()
        self._jobs.want(ask)
        self._hover(*self._pixel)

    _pixel = (-1, -1)

    def _show_layers(self) -> None:
        names = common_layers(self.a.side, self.b.side) or ["beauty"]
        if names == [self._layer.itemText(i) for i in range(self._layer.count())]:
            return
        chosen = self._layer.currentText()
        self._layer.blockSignals(True)
        self._layer.clear()
        self._layer.addItems(names)
        self._layer.setCurrentText(chosen if chosen in names else names[0])
        self._layer.blockSignals(False)

    def _take_images(self, a: QImage | None, b: QImage | None) -> None:
        self.view.set_image("A", a)
        self.view.set_image("B", b)

    def _take_numbers(self, found: Numbers | None) -> None:
        self.numbers.set_numbers(found, self.view.message)

    def _take_map(self, image: QImage | None, scale: Scale | str | None) -> None:
        """Shows the difference map, or a text that says why there is none."""
        self.view.set_image("D", image)
        self.view.set_scale(scale if isinstance(scale, Scale) else None)
        if isinstance(scale, str):
            self.view.set_message(scale)
        elif image is not None:
            self.view.set_message("")

    def _hover(self, x: int, y: int) -> None:
        self._pixel = (x, y)
        self.numbers.set_pixel(self.a.side, self.b.side, self.look().layer, x, y)

    def _fail(self, message: str) -> None:
        set_text_colour(self._error, theme.error())
        self._error.setText(message)
        self._error.show()
        self.failed.emit(message)
        if not self.isVisible():
            self.session.failed.emit(message)

    def hideEvent(self, event: QHideEvent) -> None:
        """Pauses the window's separate renders while the window is hidden."""
        for source in self.sources.values():
            if source.live is not None:
                source.live.pause()

    def showEvent(self, event: object) -> None:
        """Resumes the window's separate renders."""
        for source in self.sources.values():
            if source.live is not None and self.session.state != "paused":
                source.live.resume()
