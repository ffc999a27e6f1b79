# SPDX-License-Identifier: Apache-2.0
"""The stage, frame, options and results that all readers of one load share."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from pxr import Usd, UsdGeom

from wavecomb.load_options import PURPOSES, LoadOptions
from wavecomb.usd.geometry.shutter import Motion
from wavecomb.usd.stage.origin import WORLD, Origin
from wavecomb.usd.stage.report import LoadReport

if TYPE_CHECKING:
    from wavecomb import _core

BINDING_PURPOSES = ("full", "preview")
"""Purposes of material bindings where render settings name none, the preferred one first."""


@dataclass
class LoadContext:
    """One load of a stage at one frame.

    Attributes:
        stage: The stage.
        time: The frame.
        builder: Receives the scene.
        report: Receives notes, warnings and what is not supported.
        options: Options of the load.
        motion: Motion while the shutter is open; None means that nothing is blurred.
        origin: World position that the scene is built around.
        purposes: Purposes of the geometry that is drawn.
        binding_purposes: Purposes of material bindings, the preferred one first.
        framed: Directions (k, 3) in which a view asks how far the world reaches; None where a
            camera prim gives the view.
    """

    stage: Usd.Stage
    time: Usd.TimeCode
    builder: _core.SceneBuilder
    report: LoadReport = field(default_factory=LoadReport)
    options: LoadOptions = field(default_factory=LoadOptions)
    motion: Motion | None = None
    origin: Origin = WORLD
    purposes: tuple[str, ...] = PURPOSES[:2]
    binding_purposes: tuple[str, ...] = BINDING_PURPOSES
    framed: Any = None

    @property
    def up_axis(self) -> str:
        """The stage's up axis: X, Y or Z."""
        return str(UsdGeom.GetStageUpAxis(self.stage))

    @property
    def hides_lights(self) -> bool:
        """Whether no ray hits the shapes of lights."""
        return self.options.lights == "hidden"

    def at(self, time: float) -> LoadContext:
        """The same at another time code, without motion and with a report that nobody reads."""
        return replace(self, time=Usd.TimeCode(time), report=LoadReport(), motion=None)
