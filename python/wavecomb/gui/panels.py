# SPDX-License-Identifier: Apache-2.0
"""Which panels the window has, and where."""

from __future__ import annotations

import importlib
import importlib.util
from dataclasses import dataclass

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget

from wavecomb.gui.session import Session

_LEFT = Qt.DockWidgetArea.LeftDockWidgetArea
_RIGHT = Qt.DockWidgetArea.RightDockWidgetArea
_BOTTOM = Qt.DockWidgetArea.BottomDockWidgetArea

_PARTS = (
    ("scene", "Scene", "scene_panel", "ScenePanel", _LEFT, False),
    ("scheduling", "Scheduling", "scheduling_panel", "SchedulingPanel", _RIGHT, False),
    ("plots", "Plots", "plots_panel", "PlotsPanel", _BOTTOM, True),
    ("compare", "Compare", "compare_window", "CompareWindow", _BOTTOM, True),
    ("bench", "Bench", "bench_panel", "BenchPanel", _BOTTOM, True),
)


@dataclass(frozen=True)
class Panel:
    """A panel of the window.

    Attributes:
        name: For its state.
        title: For people.
        widget: Takes part in the session.
        area: Where its dock is at first.
        hidden: Whether it waits in the View menu at first.
    """

    name: str
    title: str
    widget: QWidget
    area: Qt.DockWidgetArea
    hidden: bool


def make_panels(session: Session) -> list[Panel]:
    """All of them."""
    panels: list[Panel] = []
    for name, title, module, kind, area, hidden in _PARTS:
        if importlib.util.find_spec(f"wavecomb.gui.{module}") is None:
            continue
        widget = getattr(importlib.import_module(f"wavecomb.gui.{module}"), kind)(session)
        panels.append(Panel(name, title, widget, area, hidden))
    widgets = {panel.name: panel.widget for panel in panels}
    if "bench" in widgets and "compare" in widgets:
        widgets["bench"].compare.connect(widgets["compare"].compare)
    return panels
