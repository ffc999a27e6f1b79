# SPDX-License-Identifier: Apache-2.0
"""Frames of one stage, which stays open between them."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pxr import UsdGeom

from wavecomb import _core
from wavecomb.api import check_memory, picture_of, prepare
from wavecomb.run.frame_names import parse_frames
from wavecomb.run.stats import make_stats
from wavecomb.usd import LoadReport, load_stage, open_stage
from wavecomb.usd.cameras.camera import camera_motion, read_camera
from wavecomb.usd.geometry.shutter import find_motion
from wavecomb.usd.materialx import references as mtlx
from wavecomb.usd.stage.diagnostics import captured
from wavecomb.usd.stage.shared import FrameStock
from wavecomb.usd.stage.times import frame_number, time_code
from wavecomb.usd.stage.view_options import ViewOptions

if TYPE_CHECKING:
    from pxr import Usd

    from wavecomb._core import Result, Settings
    from wavecomb.api import Picture
    from wavecomb.usd import LoadedStage

_CAMERA: dict[str, Any] = {
    "lens_radius": 0.0,
    "focus_distance": 1.0,
    "near_clip": 0.0,
    "far_clip": 1e30,
    "projection": "perspective",
    "conform": "expandAperture",
    "pixel_aspect": 1.0,
    "clip_planes": [],
    "exposure": 1.0,
}
"""What ``SceneBuilder.set_camera`` takes where a camera says nothing."""


class Frames:
    """Reads and renders frames of a stage; each is, bit for bit, what it is alone.

    Where only views change, the scene and its hierarchy stay and the camera is read. Else the stage
    is walked again; meshes that do not change, and textures, are those of the frame before.

    Contract: files of the stage must not change meanwhile, but for images.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        variants: Mapping[str, str] | None = None,
        mask: Iterable[str] = (),
        session_layer: str | os.PathLike[str] | None = None,
        threads: int = 0,
        **options: Any,
    ) -> None:
        """Opens the stage; options: of ``load_stage``. Raises WavecombError."""
        self._path = Path(path)
        self._threads = threads
        self._options = options
        self._view(options).check()
        opening = LoadReport()
        started = time.perf_counter()
        layer = None if session_layer is None else Path(session_layer)
        with captured(opening):
            self._stage: Usd.Stage = open_stage(
                self._path, variants, mask=tuple(mask), session_layer=layer
            )
            mtlx.tell(self._stage, opening)
            self._stock = FrameStock(self._stage, opening)
        self._opening_s = time.perf_counter() - started
        self._renderer: _core.Renderer | None = None
        self._loaded: LoadedStage | None = None
        self._is_built = False

    @staticmethod
    def _view(options: Mapping[str, Any]) -> ViewOptions:
        names = {field.name for field in fields(ViewOptions)}
        return ViewOptions(**{name: options[name] for name in names if name in options})

    def load(self, frame: float | None, **options: Any) -> LoadedStage:
        """The stage at a frame; None: its start, else default values.

        Args:
            frame: Time code.
            **options: Of ``load_stage``, in place of those that were given at first.

        Raises:
            WavecombError: It cannot be rendered.
        """
        started = time.perf_counter()
        options = {**self._options, **options}
        when = time_code(self._stage, frame)
        loaded = self._seen_anew(when, options)
        if loaded is None:
            # Let go of first: two hierarchies at a time would be twice the memory.
            self._renderer, self._loaded = None, None
            loaded = load_stage(
                self._stage, frame=frame, threads=self._threads, stock=self._stock, **options
            )
        seconds = time.perf_counter() - started + self._opening_s
        self._opening_s = 0.0
        self._loaded = replace(
            loaded, seconds=seconds, stage_path=self._path, frame=frame_number(when)
        )
        return self._loaded

    def _seen_anew(self, when: Usd.TimeCode, options: Mapping[str, Any]) -> LoadedStage | None:
        """The scene that is there with its camera at a frame; None where more may be other."""
        before, renderer = self._loaded, self._renderer
        if before is None or renderer is None:
            return None
        if not self._stock.varying.is_view_only and before.frame != frame_number(when):
            return None
        if before.leaves_out_levels:
            return None  # another view shows other textures near
        told = LoadReport()
        seen = self._view(options).on(self._stage, told)
        if before.camera_path is None or seen.camera is None:
            # What is drawn is framed; not where a camera is no good.
            is_same = before.camera_path is None and seen.camera is None
            return before if is_same and before.render == seen.choice else None
        to_world = np.array(UsdGeom.XformCache(when).GetLocalToWorldTransform(seen.camera))
        view = read_camera(seen.camera, to_world, when, told, seen.lens)
        motion = find_motion(seen.camera, when, seen.blur, told)
        shutter = None if motion is None else motion.shutter
        if view is None or not {*told.lines()} <= {*before.report.lines()}:
            return None
        if not self._stock.varying.is_view_only and shutter != before.shutter:
            return None
        if not self._stock.has_same_levels(view, options.get("size")):
            return None
        moves = camera_motion(seen.camera, motion)
        lens = {**_CAMERA, **view.options, "motion": moves}
        renderer.edit(camera={"transform": view.transform, **lens})
        path = str(seen.camera.GetPath())
        return replace(
            before, scene=renderer.scene, shutter=shutter, camera_path=path, render=seen.choice
        )

    def render(
        self,
        settings: Settings,
        progress: Any = None,
        policy: Any = None,
        costs: Any = None,
        *,
        watcher: Any = None,
        state: Any = None,
    ) -> Result:
        """Renders what was loaded last; the arguments are those of ``_core.render``."""
        assert self._loaded is not None
        self._is_built = self._renderer is None
        if self._renderer is None:
            self._renderer = _core.Renderer(self._loaded.scene, settings.threads)
        return self._renderer.render(settings, progress, policy, costs, watcher, state)

    def stats(self, result: Result, **options: Any) -> dict[str, Any]:
        """``make_stats`` of what was rendered last; options: further ones of it."""
        stats = make_stats(result, stage=os.fspath(self._path), loaded=self._loaded, **options)
        if not self._is_built:
            stats["seconds"]["build"] = 0.0
        return stats


def render_frames(
    path: str | os.PathLike[str],
    frames: str | Iterable[float],
    *,
    size: tuple[int, int] = (600, 600),
    spp: int = 64,
    camera: str | None = None,
    purposes: Iterable[str] | None = None,
    variants: Mapping[str, str] | None = None,
    mask: Iterable[str] = (),
    session_layer: str | os.PathLike[str] | None = None,
    subdivision: str | int = "auto",
    shutter: tuple[float, float] | None = None,
    motion_blur: bool | None = None,
    motion_steps: int | None = None,
    depth_of_field: bool | None = None,
    projection: str | None = None,
    exposure: bool = True,
    render_settings: str | None = None,
    product: str | None = None,
    texture_limit: float | None = None,
    working_space: str = "rec709",
    lights: str = "visible",
    progress: Any = None,
    policy: Any = None,
    costs: Any = None,
    aovs: Iterable[str] | None = None,
    **settings: Any,
) -> Iterator[tuple[float, Picture]]:
    """Renders frames of a stage one after another, and shares between them what does not change.

    Each picture is, bit for bit, what ``render(path, frame=...)`` gives.

    Args:
        path: .usd, .usda, .usdc or .usdz.
        frames: "1-48", "1-48x2", "1,5,9", or numbers.
        size: As in ``render``, like spp, progress, policy, costs, aovs and settings.
        spp: Likewise.
        camera: As in ``load``, like what follows.
        purposes: Likewise.
        variants: Likewise.
        mask: Likewise.
        session_layer: Likewise.
        subdivision: Likewise.
        shutter: Likewise.
        motion_blur: Likewise.
        motion_steps: Likewise.
        depth_of_field: Likewise.
        projection: Likewise.
        exposure: Likewise.
        render_settings: Likewise.
        product: Likewise.
        texture_limit: Likewise.
        working_space: Likewise.
        lights: Likewise.
        progress: As in ``render``, for each frame.
        policy: Likewise.
        costs: Likewise; every frame starts from the same.
        aovs: Likewise.
        **settings: Likewise.

    Returns:
        An iterator of (frame, picture); each is rendered when it is asked for.

    >>> for frame, picture in wavecomb.render_frames("shot.usd", "1-48"):  # doctest: +SKIP
    ...     picture.save(f"shot.{int(frame):04d}.exr")

    Raises:
        WavecombError: Frames, options or the stage are no good.
    """
    numbers = parse_frames(frames)
    own, profile, names, chosen = prepare(size, spp, policy, costs, aovs, settings)
    options: dict[str, Any] = {} if purposes is None else {"purposes": tuple(purposes)}
    shots = Frames(
        path,
        camera=camera,
        variants=variants,
        mask=mask,
        session_layer=session_layer,
        threads=chosen.threads,
        subdivision=subdivision,
        shutter=shutter,
        motion_blur=motion_blur,
        motion_steps=motion_steps,
        depth_of_field=depth_of_field,
        projection=projection,
        exposure=exposure,
        render_settings=render_settings,
        product=product,
        texture_limit=texture_limit,
        working_space=working_space,
        lights=lights,
        size=(chosen.width, chosen.height),
        **options,
    )
    return _pictures(shots, numbers, chosen, names, progress, own, profile)


def _pictures(
    shots: Frames,
    frames: Iterable[float],
    settings: Settings,
    names: tuple[str, ...],
    progress: Any,
    policy: Any,
    profile: Any,
) -> Iterator[tuple[float, Picture]]:
    for frame in frames:
        scene = shots.load(frame).scene
        if "light_groups" in names:
            check_memory(settings, names, len(scene.light_groups))
        result = shots.render(settings, progress, policy, profile)
        yield frame, picture_of(result, shots.stats(result), scene=scene, aovs=names)
