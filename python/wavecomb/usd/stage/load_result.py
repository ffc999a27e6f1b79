# SPDX-License-Identifier: Apache-2.0
"""Result of loading a stage."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from wavecomb.usd.render_settings.reader import ProductSettings
from wavecomb.usd.stage.report import LoadReport
from wavecomb.usd.volumes.grids import VolumeFacts

if TYPE_CHECKING:
    from wavecomb import _core
    from wavecomb.usd.materials.texture import TextureCache


@dataclass(repr=False)
class LoadedStage:
    """A loaded stage.

    Attributes:
        scene: The scene, ready to render.
        report: Notes and warnings of the load.
        camera_path: Prim of the camera; None if the default camera framed the bounds.
        seconds: Time that the load took, in seconds.
        stage_path: The file of the stage.
        cameras: Prims of all selectable cameras.
        lights: Prims of all supported lights, including invisible ones.
        material_paths: Prim of each material of the scene by id; "" if the loader created the
            material, for example from a display colour. A material prim has several ids if meshes
            provide different primvars.
        light_paths: Prim of each light of the scene by index; "" for the default dome light.
            Materials and lights in instances are named after the first instance.
        frame: Time code that was read; None for default values.
        shutter: Opening and closing time relative to the frame, in time codes; None without motion
            blur.
        render: Values of the stage's render settings.
        working_space: Working colour space, one of ``WORKING_SPACES``.
        textures: Textures for the next load to share; None unless the load was ``editable``.
        leaves_out_levels: Whether textures have only the mip levels that this view needs.
        outline: Extreme points (n, 3) of the scene; None unless a view was framed from them.
        volumes: Description of each volume in the scene.
        catchers: Paths of prims that are shadow catchers.
        origin: World position of the scene's origin, which is subtracted from world coordinates.
            The origin is 0 unless the camera is far from the world's origin (docs/stages.md).
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
    render: ProductSettings = field(default_factory=ProductSettings)
    working_space: str = "rec709"
    leaves_out_levels: bool = False
    outline: NDArray[np.float64] | None = None
    volumes: tuple[VolumeFacts, ...] = ()
    catchers: tuple[str, ...] = ()
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    _kept: list[_core.Renderer] = field(default_factory=list, init=False, repr=False, compare=False)

    def __repr__(self) -> str:
        scene = self.scene
        counts = (
            (scene.instanced_triangles, "triangle"),
            (len(scene.materials), "material"),
            (scene.light_count, "light"),
        )
        said = ", ".join(f"{count:,} {name}{'s' * (count != 1)}" for count, name in counts)
        camera = self.camera_path or "none"
        return f"<wavecomb.LoadedStage {self.stage_path}: {said}, camera {camera}>"

    @contextlib.contextmanager
    def renderer(self, threads: int = 0) -> Iterator[tuple[_core.Renderer, bool]]:
        """Yields a renderer of the scene for exclusive use, and whether it was newly built.

        The most recently returned renderer is kept with its acceleration structures and light
        statistics, for the next render. `threads` is the number of threads for building a renderer.
        """
        from wavecomb import _core

        kept = None
        # Reuse the kept renderer. The list is empty while another thread uses this renderer.
        with contextlib.suppress(IndexError):
            kept = self._kept.pop()
        # Make a new renderer if the kept one was made for an earlier version of the scene.
        is_new = kept is None or kept.scene is not self.scene
        renderer = _core.Renderer(self.scene, threads) if kept is None or is_new else kept
        try:
            yield renderer, is_new
        finally:
            self._kept[:] = [renderer]
