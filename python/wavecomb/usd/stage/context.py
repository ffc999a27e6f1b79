# SPDX-License-Identifier: Apache-2.0
"""Stage, frame, options and results that all readers of one load share."""

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
"""Default purposes of material bindings, in order of preference."""


@dataclass
class LoadContext:
    """State of one load of a stage at one frame.

    Attributes:
        stage: The stage.
        time: Time code of the frame.
        builder: Scene builder that receives the geometry, materials and lights.
        report: Collects notes, warnings and unsupported features.
        options: Options of the load.
        motion: The shutter; None means no motion blur.
        origin: World position that becomes the origin of the scene.
        purposes: Purposes of the geometry that is rendered.
        binding_purposes: Purposes of material bindings in order of preference.
        framed: Directions (k, 3) in which the extent of the world is needed to frame it; None if a
            camera prim defines the view.
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
        """Whether the shapes of lights are invisible to all rays."""
        return self.options.lights == "hidden"

    def at(self, time: float) -> LoadContext:
        """Returns the context at another time code, without motion and with a discarded report."""
        return replace(self, time=Usd.TimeCode(time), report=LoadReport(), motion=None)
