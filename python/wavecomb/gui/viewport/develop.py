# SPDX-License-Identifier: Apache-2.0
"""Turns a layer of a frame into what the screen shows. No Qt."""

from __future__ import annotations

from dataclasses import dataclass, replace

from wavecomb.gui.viewport.display import Look, Shown, show
from wavecomb.gui.viewport.frames import Frame


@dataclass(frozen=True)
class Developed:
    """A frame, how it is looked at, and what that gives."""

    frame: Frame
    look: Look
    shown: Shown


def develop_frame(frame: Frame, look: Look) -> Developed:
    """A layer of a frame for the screen; the beauty where it does not have the layer yet."""
    layer = frame.layer(look.layer)
    if layer is None:
        return Developed(frame, look, show(frame.beauty, replace(look, layer="beauty")))
    return Developed(frame, look, show(layer, look))
