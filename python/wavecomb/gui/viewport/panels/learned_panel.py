# SPDX-License-Identifier: Apache-2.0
"""Panel with the learned guiding and light distributions at the surface under the cursor."""

from __future__ import annotations

from typing import Any

import numpy as np
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QLabel, QVBoxLayout, QWidget

from wavecomb.gui import theme
from wavecomb.gui.scheduling.plots import Bar, Bars
from wavecomb.gui.viewport.directions_view import DirectionsView
from wavecomb.gui.viewport.navigate import UPS
from wavecomb.gui.viewport.panels.cursor_panel import CursorPanel
from wavecomb.gui.viewport.session import Session, Setup
from wavecomb.image.directions import density_map, map_point

_LATER_MS = 40
_HEIGHT = 128
MOST_LIGHTS = 12
"""Largest number of lights that the panel shows as separate bars. One bar shows the sum of all
other lights."""


def field_text(setup: Setup, learned: dict[str, Any] | None) -> str:
    """Describes the guiding field at a surface point, or gives the reason why there is none.

    Args:
        setup: Setup of the render.
        learned: Result of ``Renderer.learned``.
    """
    if learned is None:
        return "Point at a surface in the viewport."
    if learned["density"] is not None:
        density = learned["density"]
        text = (
            f"Faces {learned['axis']}; {learned['guided_share']:.0%} of bounces are guided; "
            f"most light from where the density is {density.max():.2f} per steradian "
            f"(even: {1 / (2 * np.pi):.2f})."
        )
        if learned["survival"] > 0:
            text += f" Learned roulette: {min(learned['survival'], 1.0):.2f} at throughput 1."
        return text
    may_guide = setup.guiding == "on" or (setup.guiding == "auto" and setup.quality == "auto")
    if not may_guide and setup.roulette != "efficient":
        return "Bounces are not guided: choose Guiding in the Scheduling panel."
    return "No guiding field here: too few samples to learn from, or no predicted gain."


def light_rows(shares: list[tuple[str, float]], most: int = MOST_LIGHTS) -> list[tuple[str, float]]:
    """Returns the lights with the largest probabilities.

    If there are further lights, the last row is their sum.

    >>> light_rows([("a", 0.5), ("b", 0.3), ("c", 0.2)], 2)
    [('a', 0.5), ('2 others', 0.5)]
    """
    if len(shares) <= most:
        return list(shares)
    rest = shares[most - 1 :]
    return [*shares[: most - 1], (f"{len(rest)} others", sum(share for _, share in rest))]


class LearnedPanel(CursorPanel):
    """Panel that shows the surface under the cursor, or the surface that was clicked.

    Attributes:
        learned: The displayed result of ``Renderer.learned``, or None.
    """

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(session, "learned", _LATER_MS, parent)
        self.learned: dict[str, Any] | None = None
        self.note = QLabel(field_text(session.setup, None))
        self.note.setObjectName("learned.note")
        self.note.setWordWrap(True)
        self.map = DirectionsView("learned.map")
        self.map.setAccessibleName("Directions of guided bounces")
        self.map.setToolTip(
            "All directions; the view direction of the camera is in the middle. "
            "The ring is the surface's normal."
        )
        self.lights = Bars("learned_lights", "Lights sampled here, %")
        self.lights.setAccessibleName("Lights sampled here")
        self.lights.setMinimumHeight(theme.em(7))
        self.follow.setToolTip("Off: keep the data of the last clicked pixel")
        self.follow.setAccessibleName("Follow the cursor with the learned data")
        layout = QVBoxLayout(self)
        margin = theme.em(0.3)
        layout.setContentsMargins(margin, margin, margin, margin)
        layout.addWidget(self.note)
        layout.addWidget(self.map, 2)
        layout.addWidget(self.lights, 3)
        layout.addWidget(self.follow)

    def showEvent(self, event: QShowEvent) -> None:
        """Updates the panel when it becomes visible, because hidden panels are not updated."""
        super().showEvent(event)
        self._soon()

    def _soon(self) -> None:
        if self.isVisible():
            super()._soon()

    def _fill(self) -> None:
        session, pixel = self._session, self._pixel
        if pixel is None:
            return
        setup = session.setup
        x, y = min(pixel[0], setup.width - 1) + 0.5, min(pixel[1], setup.height - 1) + 0.5
        self.learned = session.learned(x, y)
        self.note.setText(field_text(setup, self.learned))
        self._draw_map(session.pick(x, y))
        self._draw_lights()

    def _draw_map(self, hit: dict[str, Any] | None) -> None:
        pose = self._session.pose
        density = self.learned["density"] if self.learned is not None else None
        if density is None or pose is None or hit is None or "normal" not in hit:
            self.map.show_map(None)
            return
        up = np.array(UPS[self._session.up_axis])
        values, axes = density_map(density, up, -pose.back, _HEIGHT)
        normal = np.array(hit["normal"])
        if normal @ (np.array(hit["position"]) - pose.position) > 0.0:
            normal = -normal
        self.map.show_map(values, map_point(normal, axes))

    def _draw_lights(self) -> None:
        rows = light_rows(self.learned["light_shares"] if self.learned is not None else [])
        bars = [
            Bar(k, 0.7, 0.0, 100.0 * share, theme.series(0), f"{name}: {100.0 * share:.2f} %")
            for k, (name, share) in enumerate(rows)
        ]
        self.lights.show_bars([name for name, _ in rows], bars)
