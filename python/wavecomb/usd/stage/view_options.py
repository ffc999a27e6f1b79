# SPDX-License-Identifier: Apache-2.0
"""What is seen and how: options, and under them what the stage's render settings say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pxr import Usd

from wavecomb.errors import WavecombError
from wavecomb.usd.cameras.camera import PROJECTIONS, Lens, find_camera
from wavecomb.usd.geometry.shutter import Blur
from wavecomb.usd.looks.material import BINDING_PURPOSES
from wavecomb.usd.stage.choice import RenderChoice
from wavecomb.usd.stage.render_settings import read_choices
from wavecomb.usd.stage.report import LoadReport

PURPOSES = ("default", "render", "proxy", "guide")


@dataclass(frozen=True)
class Seen:
    """What ``ViewOptions`` come to on a stage.

    Attributes:
        choice: Of the render settings.
        camera: Prim; None: there is none.
        lens: For ``read_camera``.
        blur: For ``find_motion``.
        purposes: Of the geometry.
        binding_purposes: Of material bindings.
    """

    choice: RenderChoice
    camera: Usd.Prim | None
    lens: Lens
    blur: Blur
    purposes: tuple[str, ...]
    binding_purposes: tuple[str, ...]


@dataclass(frozen=True)
class ViewOptions:
    """Options of ``load_stage`` that go before the render settings; None: as these say."""

    camera: str | None = None
    purposes: Sequence[str] | None = None
    shutter: tuple[float, float] | None = None
    motion_blur: bool | None = None
    motion_steps: int | None = None
    depth_of_field: bool | None = None
    projection: str | None = None
    exposure: bool = True
    render_settings: str | None = None
    product: str | None = None

    def check(self) -> None:
        """Raises WavecombError for what no stage can have."""
        unknown = [name for name in self.purposes or () if name not in PURPOSES]
        if unknown:
            raise WavecombError(f"no purpose {unknown[0]!r}; there are {', '.join(PURPOSES)}")
        if self.projection is not None and self.projection not in PROJECTIONS:
            raise WavecombError(
                f"no camera projection {self.projection!r}; there are {', '.join(PROJECTIONS)}"
            )
        self._blur(True)

    def on(self, stage: Usd.Stage, report: LoadReport) -> Seen:
        """On a stage; raises WavecombError where it has not what is asked for."""
        choices = read_choices(stage, self.render_settings, self.product, report)
        choice = choices[0]
        if self.product is None and len(choices) > 1:
            report.note(f"render product {choice.product} is the first of {len(choices)}")
        sharp = choice.depth_of_field if self.depth_of_field is None else self.depth_of_field
        lens = Lens(self.projection, self.exposure, sharp, choice.conform, choice.pixel_aspect)
        return Seen(
            choice,
            find_camera(stage, self.camera or choice.camera),
            lens,
            self._blur(choice.motion_blur),
            tuple(self.purposes or choice.purposes or PURPOSES[:2]),
            choice.material_purposes or BINDING_PURPOSES,
        )

    def _blur(self, wanted: bool) -> Blur:
        """``wanted``: by the render settings; a shutter that is chosen says that it is."""
        blurs = self.motion_blur
        if blurs is None:
            blurs = wanted or self.shutter is not None
        return Blur.chosen(self.shutter, blurs, self.motion_steps)
