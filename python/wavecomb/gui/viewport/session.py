# SPDX-License-Identifier: Apache-2.0
"""The open stage and its live render, shared by all panels of the window.

A session is used on the UI thread, and none of its methods blocks. Loading, rendering, denoising
and saving run on other threads, whose results arrive as signals.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom
from PySide6.QtCore import QObject, Signal

from wavecomb.gui.loader import Read, Request, Source, copied, read
from wavecomb.gui.setup import Setup
from wavecomb.gui.viewport.display import Look
from wavecomb.gui.viewport.engine import Edit
from wavecomb.gui.viewport.frames import Frame
from wavecomb.gui.viewport.live import Live
from wavecomb.gui.viewport.navigate import Pose, pose_of_scene
from wavecomb.gui.viewport.saving import save_frame
from wavecomb.gui.viewport.scene_lookup import (
    camera_pose,
    edits_again,
    light_key,
    make_renderer,
    prim_bounds,
)
from wavecomb.gui.worker import Tasks, Worker
from wavecomb.usd.stage.context import WORLD

if TYPE_CHECKING:
    from wavecomb._core import Scene
    from wavecomb.usd import LoadedStage, LoadReport

__all__ = ["Frame", "Live", "Pose", "Session", "Setup"]


class Session(Live):
    """A stage, its live render, and optional further live renders with other settings (twins).

    Signals:
        opened(LoadedStage): A stage was loaded, or loaded again after a change of its contents.
        closing(): The stage will be reloaded from disk. Receivers must release the stage's prims.
        busy(str): Description of the work in the background, or "" if there is none.
        camera_changed(Pose): The camera moved, or another camera was chosen.
        selected(str | None): The selection changed. The argument is the path of the selected prim.
        saved(str): A file was written.
        noted(LoadedStage): The load report of the stage has new messages.

    Attributes:
        stage: The loaded stage, or None.
        usd: The open USD stage, or None. Edits change the session layer and then call ``rebuild``.
        up_axis: "X", "Y" or "Z".
        pose: Pose of the camera, or None.
        selection: Path of the selected prim, or None.
        material_edits: Values that ``edit_material`` has changed, by material name.
        light_edits: Values that ``edit_light`` has changed, by name and number among lights of that
            name.
        twins: Live renders with separate settings that show the same scene and camera.
    """

    opened = Signal(object)
    closing = Signal()
    busy = Signal(str)
    camera_changed = Signal(object)
    selected = Signal(object)
    saved = Signal(str)
    noted = Signal(object)

    def __init__(self, setup: Setup | None = None, parent: QObject | None = None) -> None:
        super().__init__(setup, parent)
        self.stage: LoadedStage | None = None
        self.usd: Usd.Stage | None = None
        self.up_axis = "Y"
        self.pose: Pose | None = None
        self.material_edits: dict[str, dict[str, Any]] = {}
        self.light_edits: dict[tuple[str, int], dict[str, Any]] = {}
        self.selection: str | None = None
        self.twins: list[Live] = []
        self._loader = Worker("load", self)
        self._loader.done.connect(self._take_stage)
        self._loader.failed.connect(self._take_failure)
        self._tasks = Tasks(self)
        self._tasks.busy.connect(self.busy)
        self._tasks.failed.connect(self.failed)
        self._request: Request | None = None
        self._request_wanted: Request | None = None
        self._playing = False
        self._readings = itertools.count(1)
        self._reading = 0
        self._closed = False

    # ---- what there is -------------------------------------------------------------------------

    @property
    def scene(self) -> Scene | None:
        """The core's scene with all edits, or None.

        Use ``Scene.material(i)`` and ``Scene.light(i)`` to read current parameter values.
        """
        if self.renderer is not None:
            return self.renderer.scene
        return self.stage.scene if self.stage is not None else None

    @property
    def path(self) -> Path | None:
        """File of the stage, or None."""
        return self.stage.stage_path if self.stage is not None else None

    # ---- stages --------------------------------------------------------------------------------

    def open(
        self,
        path: str | os.PathLike[str],
        camera: str | None = None,
        time: float | None = None,
        variants: Mapping[str, str] | None = None,
        purposes: tuple[str, ...] | None = None,
    ) -> None:
        """Loads a stage on another thread, and then emits ``opened`` or ``failed``.

        The current stage stays open until the new stage is loaded.
        """
        source = Source(Path(path), camera, time, variants, purposes)
        self._read(Request(source, threads=self.setup.threads), f"reading {source.path.name}")

    def reload(self) -> None:
        """Reloads the stage from disk. Edits are dropped, and the camera is kept."""
        if self._request is None or self.stage is None:
            self.failed.emit("there is no stage to reload: open one first")
            return
        usd = self.usd
        if usd is None:
            return  # a thread is already loading the stage
        usd.GetSessionLayer().Clear()
        self.usd = None
        self.closing.emit()
        source = self._request.source
        request = Request(source, usd, None, True, self.setup.threads)
        self._read(request, f"reading {source.path.name} again")

    def rebuild(self, reason: str) -> None:
        """Loads the stage again after edits of the session layer, keeping the camera.

        Args:
            reason: Description of the change for people, such as "variant of /World/Car".
        """
        if self._request is None or self.usd is None:
            return
        overrides = copied(self.usd.GetSessionLayer())
        request = Request(self._request.source, self.usd, overrides, False, self.setup.threads)
        self._read(request, reason)

    def show_time(self, time: float, *, moving: bool = False) -> None:
        """Loads the stage again at another time code. Edits and a free camera are kept.

        Args:
            time: The time code.
            moving: Whether further time codes follow; images are reduced until ``restart``.
        """
        if self._request is not None and self.usd is not None:
            source = replace(self._request.source, time=time)
            self._request = replace(self._request, source=source)
            self._playing = moving
            self.rebuild(f"reading frame {time:g}")

    @property
    def is_reading(self) -> bool:
        """Whether the stage is being loaded."""
        return self._loader.busy

    def _read(self, request: Request, what: str) -> None:
        if request.usd is not None and self.stage is not None:
            request = replace(request, textures=self.stage.textures)
        request = replace(request, size=(self.setup.width, self.setup.height))
        self._request_wanted, self._reading = request, next(self._readings)
        self._tasks.begin("load", what)
        self._loader.submit(partial(read, request), self._reading)

    def _take_stage(self, number: int, found: Read) -> None:
        request, usd, loaded = self._request_wanted, found.usd, found.stage
        if self._closed or request is None or number != self._reading:
            return  # A newer request to load a stage has replaced this one.
        again = request.usd is not None
        if not again or request.fresh:
            self.material_edits.clear()
            self.light_edits.clear()
        if again and self.pose is not None and self.stage is not None:
            self.pose = self.pose.around(self.stage.origin, loaded.origin)
        self._request, self.usd, self.stage = request, usd, loaded
        if not again:
            self.select(None)
        usd.SetEditTarget(usd.GetSessionLayer())
        self.up_axis = str(UsdGeom.GetStageUpAxis(usd))
        before = self.pose if again else None
        if before is None or before.path is not None:
            there = self._pose_of(before.path) if before is not None and before.path else None
            self.pose = there or pose_of_scene(loaded.scene.camera, loaded.camera_path)
        edit = edits_again(loaded.scene, self.material_edits, self.light_edits)
        edit.camera = self.pose.options() if self.pose is not None else None
        make = partial(make_renderer, loaded.scene, self.setup.threads)
        for live in self._lives():
            live.begin(make, loaded, edit.copied(), moving=self._playing)
        self._playing = False
        self._tasks.end("load")
        self.opened.emit(loaded)
        self.camera_changed.emit(self.pose)

    def _take_failure(self, number: int, message: str) -> None:
        request = self._request_wanted
        if self._closed or request is None or number != self._reading:
            return
        self._tasks.end("load")
        if request.fresh and request.usd is not None:
            self.usd = request.usd
            self.opened.emit(self.stage)
        self.failed.emit(message)

    def note_words(self, report: LoadReport | None) -> None:
        """Adds messages that USD emits after loading to the report of the open stage."""
        if report is not None and self.stage is not None:
            self.stage.report.absorb(report)
            self.noted.emit(self.stage)

    # ---- settings, camera, materials, lights ----------------------------------------------------

    def set_camera(self, pose: Pose, *, moving: bool = False) -> None:
        """Moves the camera.

        Args:
            pose: New pose. Its ``path`` must be None unless a camera prim has exactly this pose.
            moving: Whether further movements follow immediately. Images are reduced until
                ``settle``.
        """
        self.pose = pose
        self.edit_all(Edit(camera=pose.options()), moving=moving)
        self.camera_changed.emit(pose)

    def _lives(self) -> tuple[Live, ...]:
        return (self, *self.twins)

    def edit_all(self, edit: Edit, *, moving: bool = False) -> None:
        """Edits the scene, also of the twins."""
        for live in self._lives():
            live.edit(edit.copied(), moving=moving)

    def settle(self) -> None:
        """Ends a movement of the camera or scene, in the session's render and in its twins."""
        super().settle()
        for live in self.twins:
            live.settle()

    @property
    def source(self) -> Source | None:
        """The open stage and its loading options, or None."""
        return None if self._request is None else self._request.source

    def use_camera(self, path: str | None) -> None:
        """Views through a camera prim; None changes to a free camera with the current pose."""
        if self.pose is None:
            return
        if path is None:
            self.pose = replace(self.pose, path=None)
            self.camera_changed.emit(self.pose)
        elif (pose := self._pose_of(path)) is not None:
            self.set_camera(pose)
        else:
            self.failed.emit(f"camera {path}: is not a supported camera; choose another")

    def _pose_of(self, path: str) -> Pose | None:
        if self.usd is None or self._request is None:
            return None
        origin = WORLD if self.stage is None else self.stage.origin
        return camera_pose(self.usd, path, self._request.source.time, origin)

    def edit_material(self, material: int, *, moving: bool = False, **values: Any) -> None:
        """Changes a material by index, with keyword arguments of ``add_material``."""
        if self.scene is None:
            return
        self.material_edits.setdefault(self.scene.materials[material][0], {}).update(values)
        self.edit_all(Edit(materials={material: values}), moving=moving)

    def edit_light(self, light: int, *, moving: bool = False, **values: Any) -> None:
        """Changes a light by index, with keyword arguments of ``add_light``."""
        if self.scene is None:
            return
        self.light_edits.setdefault(light_key(self.scene, light), {}).update(values)
        self.edit_all(Edit(lights={light: values}), moving=moving)

    # ---- the render ------------------------------------------------------------------------------

    def pick(self, x: float, y: float) -> dict[str, Any] | None:
        """Returns the visible object at pixel (x, y) of the full-size image, or None."""
        at = float(x), float(y), self.setup.width, self.setup.height
        return None if self.renderer is None else self.renderer.pick(*at)

    def learned(self, x: float, y: float) -> dict[str, Any] | None:
        """Returns the result of ``Renderer.learned`` for the surface at pixel (x, y), or None."""
        at = float(x), float(y), self.setup.width, self.setup.height
        return None if self.renderer is None else self.renderer.learned(*at)

    def select(self, path: str | None) -> None:
        """Selects a prim by its path; None clears the selection."""
        if path != self.selection:
            self.selection = path
            self.selected.emit(path)

    def selected_bounds(self) -> NDArray[np.float64] | None:
        """Returns the bounds (2, 3) of the selected prim in scene space, or None."""
        if self.selection is None or self.stage is None or self.usd is None:
            return None
        return prim_bounds(self.usd, self.stage, self.selection, self.scene)

    def pause(self) -> None:
        """Pauses the session's render and its twins."""
        super().pause()
        for live in self.twins:
            live.pause()

    def resume(self) -> None:
        """Resumes paused renders of the session, and restarts stopped ones."""
        super().resume()
        for live in self.twins:
            live.resume()

    def restart(self) -> None:
        """Restarts the session's render from the first sample, at full size."""
        self._playing = False
        if self.stage is not None:
            super().restart()

    def save(self, path: str | os.PathLike[str], look: Look | None = None, **options: Any) -> None:
        """Writes all layers (.exr) or the displayed image (.png); emits ``saved`` or ``failed``.

        Args:
            path: File name that ends in .exr or .png.
            look: Display settings; None means the beauty with default settings.
            **options: Arguments of ``Picture.save``.
        """
        frame = self.last_frame
        if frame is None or self.scene is None:
            self.failed.emit("there is no picture to save yet: open a stage first")
            return
        scene, stage, name = self.scene, self.stage, os.fspath(path)
        work = partial(save_frame, frame, name, scene, stage, look or Look(), options)
        self.run(f"writing {Path(name).name}", work, lambda: self.saved.emit(name))

    def twin(self, setup: Setup) -> Live:
        """Starts a twin: a live render of the same scene and camera with separate settings.

        The twin follows all edits of the scene and the camera. ``drop_twin`` ends the twin.
        """
        live = Live(setup, self)
        self.twins.append(live)
        if self.renderer is not None:
            edit = Edit(camera=self.pose.options() if self.pose is not None else None)
            live.begin(self.renderer.twin, self.stage, edit)
        return live

    def drop_twin(self, live: Live) -> None:
        """Ends a twin."""
        if live in self.twins:
            self.twins.remove(live)
            live.shutdown()
            live.deleteLater()

    def run(
        self, what: str, work: Callable[[], object], then: Callable[[], None] | None = None
    ) -> None:
        """Runs ``work`` on another thread, and then ``then`` on the UI thread.

        See ``Tasks.run``.
        """
        self._tasks.run(what, work, then)

    @property
    def _jobs(self) -> list[tuple[str, str]]:
        return self._tasks.jobs

    def shutdown(self) -> None:
        """Ends all threads of the session."""
        if self._closed:
            return
        self._closed = True
        while self.twins:
            self.twins.pop().shutdown()
        super().shutdown()
        self._loader.close(0.5)
        self._tasks.close()
        self.stage = self.usd = None
