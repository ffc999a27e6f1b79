# SPDX-License-Identifier: Apache-2.0
"""A stage that was read, whoever read it."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from wavecomb.usd.stage.choice import RenderChoice
from wavecomb.usd.stage.report import LoadReport
from wavecomb.usd.volumes.info import VolumeFacts

if TYPE_CHECKING:
    from wavecomb import _core
    from wavecomb.usd.looks.texture import TextureCache


@dataclass
class LoadedStage:
    """A stage that was read.

    Attributes:
        scene: Ready to render.
        report: What there is to say about it.
        camera_path: Prim of the camera; None where the bounds were framed.
        seconds: Time taken.
        stage_path: The file.
        cameras: Prims of all cameras that could be chosen.
        lights: Prims of all lights that Wavecomb knows, invisible ones too.
        material_paths: Prim of each material of the scene, by id; "" where the loader made it (of a
            display colour). One prim has several where meshes bring values of their own.
        light_paths: Prim of each light of the scene, by index; "" of the soft dome. In instances
            both are named by the first instance.
        frame: Time code that was read; None: default values.
        shutter: When it opens and closes, time codes from the frame; None: no motion blur.
        render: What the stage's render settings ask for.
        working_space: What its colours are in: of ``WORKING_SPACES``.
        textures: What the next read of the stage can share; None unless it was read ``editable``.
        leaves_out_levels: Whether textures have only the mip levels that its view needs.
        outline: Points (n, 3) of the scene where what is drawn reaches farthest; None unless a view
            was framed for it.
        volumes: What there is to say of each.
        catchers: Prims of which only the shadows show.
        origin: World position that the scene is built around: the scene's coordinates are the
            world's less these. It is 0 unless the stage is seen from far away (docs/stages.md).
    """

    scene: _core.Scene
    report: LoadReport
    camera_path: str | None
    seconds: float
    stage_path: Path
    cameras: tuple[str, ...] = ()
    lights: tuple[str, ...] = ()
    material_paths: tuple[str, ...] = ()
    light_paths: tuple[str, ...] = ()
    frame: float | None = None
    textures: TextureCache | None = None
    shutter: tuple[float, float] | None = None
    render: RenderChoice = field(default_factory=RenderChoice)
    working_space: str = "rec709"
    leaves_out_levels: bool = False
    outline: NDArray[np.float64] | None = None
    volumes: tuple[VolumeFacts, ...] = ()
    catchers: tuple[str, ...] = ()
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    _kept: list[_core.Renderer] = field(default_factory=list, init=False, repr=False, compare=False)

    @contextlib.contextmanager
    def renderer(self, threads: int = 0) -> Iterator[tuple[_core.Renderer, bool]]:
        """A renderer of the scene, to be had by one caller at a time, and whether it was built now.

        The last one that nobody has any more stays with the stage, with its hierarchy and what it
        found out of the lights, for whoever renders it next; `threads` are for building one.
        """
        from wavecomb import _core

        kept = None
        with contextlib.suppress(IndexError):  # other threads may have it
            kept = self._kept.pop()
        is_new = kept is None or kept.scene is not self.scene  # edited
        renderer = _core.Renderer(self.scene, threads) if kept is None or is_new else kept
        try:
            yield renderer, is_new
        finally:
            self._kept[:] = [renderer]
