# SPDX-License-Identifier: Apache-2.0
"""Reads the frames of a stage, which stays open between frames."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pxr import UsdGeom

from wavecomb.core_table import camera_defaults
from wavecomb.load_options import LoadOptions
from wavecomb.usd import mtlx
from wavecomb.usd.cameras.camera import camera_motion, read_camera
from wavecomb.usd.geometry.shutter import find_motion
from wavecomb.usd.layers.opening import open_stage
from wavecomb.usd.render_settings.reader import ProductSettings
from wavecomb.usd.render_settings.view import check_view, view_settings
from wavecomb.usd.stage.context import find_origin, to_scene_space
from wavecomb.usd.stage.frame_cache import FrameCache
from wavecomb.usd.stage.load import load_stage
from wavecomb.usd.stage.report import LoadReport, capture_diagnostics
from wavecomb.usd.stage.time_codes import frame_number, time_code

if TYPE_CHECKING:
    from pxr import Usd

    from wavecomb.usd.stage.load_result import LoadedStage


@dataclass(frozen=True)
class CameraUpdate:
    """Camera and metadata of a frame whose scene otherwise equals an earlier frame's scene.

    Attributes:
        camera: Camera arguments for ``Renderer.edit``; None if the camera does not change.
        camera_path: Value of ``LoadedStage.camera_path`` at the frame.
        shutter: Value of ``LoadedStage.shutter`` at the frame.
        render: Value of ``LoadedStage.render`` at the frame.
        frame: Value of ``LoadedStage.frame`` at the frame.
    """

    camera: dict[str, Any] | None
    camera_path: str | None
    shutter: tuple[float, float] | None
    render: ProductSettings
    frame: float | None

    def as_dict(self) -> dict[str, Any]:
        """Returns the attributes by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


class FrameReader:
    """An open stage, with data that several of its frames share.

    While the reader is used, files of the stage must not change, except for images.
    """

    def __init__(self, path: Path, options: LoadOptions) -> None:
        """Opens the stage. Raises WavecombError if the stage cannot be opened."""
        check_view(options)
        opening = LoadReport()
        layer = None if options.session_layer is None else Path(options.session_layer)
        with capture_diagnostics(opening):
            self._stage: Usd.Stage = open_stage(
                path, options.variants, mask=options.mask, session_layer=layer,
                payloads=options.payloads,
            )  # fmt: skip
            mtlx.report_problems(self._stage, opening)
            self._cache = FrameCache(self._stage, opening)
        self._before: LoadedStage | None = None

    def read(self, options: LoadOptions, **how: Any) -> LoadedStage:
        """Reads the stage at a frame.

        Args:
            options: Load options, including the frame.
            **how: Further arguments that are passed to ``load_stage``.

        Raises:
            WavecombError: The stage cannot be rendered.
        """
        self._before = None
        # These options were applied when the stage was opened, so do not apply them again.
        here = replace(options, mask=(), payloads=(), session_layer=None, variants=None)
        self._before = load_stage(self._stage, here, cache=self._cache, **how)
        return self._before

    def read_camera(self, options: LoadOptions) -> CameraUpdate | None:
        """Returns the changes at a frame if at most the camera changes; otherwise returns None."""
        before, when = self._before, time_code(self._stage, options.frame)
        if before is None:
            return None
        settings = self._read_camera(before, when, options)
        if settings is not None:
            changes = {
                name: value for name, value in settings.as_dict().items() if name != "camera"
            }
            self._before = replace(before, **changes)
        return settings

    def _read_camera(
        self, before: LoadedStage, when: Usd.TimeCode, options: LoadOptions
    ) -> CameraUpdate | None:
        number = frame_number(when)
        if not self._cache.varying.is_view_only and before.frame != number:
            return None
        if before.leaves_out_levels:
            # Load the stage again, since the loaded textures lack mip levels that the new view may
            # need.
            return None
        report = LoadReport()
        settings = view_settings(self._stage, options, report)
        if before.camera_path is None or settings.camera is None:
            # Without a camera in the stage, the default view is used, which shows all geometry. The
            # loaded scene can be kept only if both views are the default view.
            is_same = before.camera_path is None and settings.camera is None
            if not is_same or before.render != settings.choice:
                return None
            return CameraUpdate(None, before.camera_path, before.shutter, before.render, number)
        origin = find_origin(self._stage, when, settings.camera, settings.purposes)
        if origin != before.origin:
            # All coordinates are relative to the scene origin, so a different origin requires a new
            # scene.
            return None
        to_world = np.array(UsdGeom.XformCache(when).GetLocalToWorldTransform(settings.camera))
        to_world = to_scene_space(to_world, origin)
        view = read_camera(settings.camera, to_world, when, report, settings.lens)
        motion = find_motion(settings.camera, when, settings.blur, report)
        shutter = None if motion is None else motion.shutter
        if view is None or not {*report.lines()} <= {*before.report.lines()}:
            return None
        if not self._cache.varying.is_view_only and shutter != before.shutter:
            return None
        if not self._cache.has_same_levels(view, options.size):
            return None
        moves = camera_motion(settings.camera, motion, origin)
        camera = {"transform": view.transform, **camera_defaults(), **view.options, "motion": moves}
        return CameraUpdate(
            camera, str(settings.camera.GetPath()), shutter, settings.choice, number
        )
