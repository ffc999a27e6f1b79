# SPDX-License-Identifier: Apache-2.0
"""The panels of the window and their initial positions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDockWidget, QMainWindow, QWidget

from wavecomb.gui import theme
from wavecomb.gui.bench.panel import BenchPanel
from wavecomb.gui.compare.window import CompareWindow
from wavecomb.gui.scene.scene_panel import ScenePanel
from wavecomb.gui.scheduling.panel import SchedulingPanel
from wavecomb.gui.scheduling.plots_panel import PlotsPanel
from wavecomb.gui.viewport.panels.learned_panel import LearnedPanel
from wavecomb.gui.viewport.panels.render_panel import RenderPanel
from wavecomb.gui.viewport.session import Session

_LEFT = Qt.DockWidgetArea.LeftDockWidgetArea
_RIGHT = Qt.DockWidgetArea.RightDockWidgetArea
_BOTTOM = Qt.DockWidgetArea.BottomDockWidgetArea


@dataclass(frozen=True)
class Panel:
    """A panel of the window.

    Attributes:
        name: Name of the panel in the saved window state.
        title: Displayed title of the panel.
        widget: Widget inside the panel.
        area: Initial dock area of the panel.
        hidden: Whether the panel is hidden initially.
    """

    name: str
    title: str
    widget: QWidget
    area: Qt.DockWidgetArea
    hidden: bool = False


def make_panels(session: Session) -> list[Panel]:
    """Creates all panels of the window."""
    return [
        Panel("scene", "Scene", ScenePanel(session), _LEFT),
        Panel("render", "Render", RenderPanel(session), _RIGHT),
        Panel("scheduling", "Scheduling", SchedulingPanel(session), _RIGHT, hidden=True),
        Panel("learned", "Learned", LearnedPanel(session), _RIGHT),
        Panel("plots", "Plots", PlotsPanel(session), _BOTTOM, hidden=True),
        Panel("bench", "Bench", BenchPanel(session), _BOTTOM, hidden=True),
        Panel("compare", "Compare", CompareWindow(session), _BOTTOM, hidden=True),
    ]


def keep_half(window: QMainWindow, centre: QWidget, docks: Iterable[QDockWidget]) -> None:
    """Narrows the panels on both sides until the image has half of the window's width."""
    sides = [
        dock
        for dock in docks
        if dock.isVisible() and not dock.isFloating() and not dock.visibleRegion().isEmpty()
        and window.dockWidgetArea(dock) != _BOTTOM
    ]  # fmt: skip
    if sides and centre.width() < window.width() // 2:
        share = window.width() // 2 // len(sides) - theme.em(0.5)
        window.resizeDocks(sides, [share] * len(sides), Qt.Orientation.Horizontal)
