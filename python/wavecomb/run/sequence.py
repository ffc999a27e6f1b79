# SPDX-License-Identifier: Apache-2.0
"""Renders frames of a stage that stays open between frames."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wavecomb import _core
from wavecomb.image.rendered import picture_of
from wavecomb.load_options import LoadOptions, split
from wavecomb.run.aovs import DEEP, with_others
from wavecomb.run.catchers import LAYER, catcher_settings, with_alpha, with_catcher_shadows
from wavecomb.run.catchers import check as check_catchers
from wavecomb.run.frame_names import parse_frames
from wavecomb.run.settings import check_memory, prepare
from wavecomb.run.stats import make_stats

if TYPE_CHECKING:
    from wavecomb._core import Result, Settings
    from wavecomb.image.rendered import Picture
    from wavecomb.usd import LoadedStage


class Frames:
    """Renders frames of an open stage, bit-identical to separate renders of the frames.

    If only the camera changes between frames, the scene and its acceleration structures are kept.
    Otherwise the stage is traversed again, and unchanged meshes and textures of the previous frame
    are reused.

    Contract: the stage's layers must not change on disk while it is open; its images may.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        options: LoadOptions | None = None,
        **changes: Any,
    ) -> None:
        """Opens the stage.

        Args:
            path: USD file with ending .usd, .usda, .usdc or .usdz.
            options: Load options.
            **changes: Fields of ``LoadOptions`` that replace the fields of ``options``.

        Raises:
            WavecombError: The stage cannot be opened.
        """
        self._path = Path(path)
        self._options = LoadOptions.of(options, changes)
        self._renderer: _core.Renderer | None = None
        self._loaded: LoadedStage | None = None
        self._is_built = False
        self._caught = self._options.catch
        started = time.perf_counter()
        from wavecomb.run.frame_reader import FrameReader

        self._reader = FrameReader(self._path, self._options)
        self._opening_s = time.perf_counter() - started

    def load(self, frame: float | None, *, progress: Any = None, **changes: Any) -> LoadedStage:
        """Loads the stage at a frame.

        Args:
            frame: Time code; None means the start time code of the stage, or default values
                if the stage has none.
            progress: Progress callback as in ``wavecomb.load``.
            **changes: Fields of ``LoadOptions`` that replace the options given to the constructor.

        Raises:
            WavecombError: The stage cannot be rendered.
        """
        started = time.perf_counter()
        options = LoadOptions.of(self._options, {**changes, "frame": frame})
        # A stage with shadow catchers is rendered several times per frame, with different sets of
        # prims.
        is_same = self._renderer is not None and options.catch == self._caught
        self._caught = options.catch
        loaded = self._with_camera(options) if is_same else None
        if loaded is None:
            # Release the old acceleration structures before building new ones, since both together
            # would double the memory.
            self._renderer, self._loaded = None, None
            loaded = self._reader.read(options, progress=progress)
        seconds = time.perf_counter() - started + self._opening_s
        self._opening_s = 0.0
        self._loaded = replace(loaded, seconds=seconds, stage_path=self._path)
        return self._loaded

    def _with_camera(self, options: LoadOptions) -> LoadedStage | None:
        """Returns the current scene with its camera at a frame.

        The result is None if anything besides the camera differs at the frame.
        """
        before, renderer = self._loaded, self._renderer
        assert before is not None and renderer is not None
        update = self._reader.read_camera(options)
        if update is None:
            return None
        found = update.as_dict()
        camera = found.pop("camera")
        if camera is not None:
            renderer.edit(camera=camera)
        return replace(before, scene=renderer.scene, **found)

    def render(
        self,
        settings: Settings,
        progress: Any = None,
        policy: Any = None,
        costs: Any = None,
        *,
        watcher: Any = None,
        state: Any = None,
        learned: bytes | None = None,
    ) -> Result:
        """Renders the loaded frame; the arguments are the same as for ``_core.render``."""
        assert self._loaded is not None
        self._is_built = self._renderer is None
        if self._renderer is None:
            self._renderer = _core.Renderer(self._loaded.scene, settings.threads)
        return self._renderer.render(
            settings, progress, policy, costs, watcher, state, learned=learned
        )

    def stats(self, result: Result, **options: Any) -> dict[str, Any]:
        """Returns statistics of the last render; ``options`` are passed to ``make_stats``."""
        options |= {"loaded": self._loaded, "is_built": self._is_built}
        return make_stats(result, stage=os.fspath(self._path), **options)


def render_frames(
    path: str | os.PathLike[str],
    frames: str | Iterable[float],
    *,
    size: tuple[int, int] = (600, 600),
    spp: int = 64,
    progress: Any = None,
    policy: Any = None,
    costs: Any = None,
    aovs: Iterable[str] | None = None,
    isolate: bool | None = None,
    **options: Any,
) -> Iterator[tuple[float, Picture]]:
    """Renders frames of a stage one after another and shares unchanged data between them.

    Each image is bit-identical to the image of ``render(path, frame=...)``.

    Args:
        path: USD file with ending .usd, .usda, .usdc or .usdz.
        frames: "1-48", "1-48x2", "1,5,9", or numbers.
        size: Width and height in pixels, as in ``render``.
        spp: Samples per pixel, as in ``render``.
        progress: Progress callback of each frame, as in ``render``.
        policy: Scheduling policy, as in ``render``.
        costs: Cost profile, as in ``render``; every frame starts from the same profile.
        aovs: AOVs, as in ``render``.
        isolate: Deprecated and without effect, as in ``load``.
        **options: Fields of ``LoadOptions`` except the frame, and of ``wavecomb.Settings``.

    Returns:
        An iterator of (frame, picture); each frame is rendered when the iterator advances.

    >>> for frame, picture in wavecomb.render_frames("shot.usd", "1-48"):  # doctest: +SKIP
    ...     picture.save(f"shot.{int(frame):04d}.exr")

    Raises:
        WavecombError: Frames, options or the stage are invalid.
    """
    from wavecomb.api import warn_deprecated

    warn_deprecated(isolate=isolate)
    numbers = parse_frames(frames)
    loading, settings = split(options, without=("size", "threads", "frame"))
    own, profile, names, chosen = prepare(size, spp, policy, costs, aovs, settings)
    size = chosen.width, chosen.height
    shots = Frames(path, size=size, threads=chosen.threads, **loading)
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
        loaded = shots.load(frame)
        scene = loaded.scene
        if "light_groups" in names:
            check_memory(settings, names, len(scene.light_groups))
        if loaded.catchers:
            check_catchers(settings, {"deep": DEEP in names})
            settings, names = with_alpha(settings), with_others(names, [LAYER])
        result = shots.render(settings, progress, policy, profile)
        picture = picture_of(result, shots.stats(result), scene=scene, aovs=names)
        if loaded.catchers and not picture.cancelled:
            picture = _with_catcher_shadows(shots, frame, settings, picture)
        yield frame, picture


def _with_catcher_shadows(
    shots: Frames, frame: float, settings: Settings, picture: Picture
) -> Picture:
    def render(how: Mapping[str, str]) -> Result:
        shots.load(frame, **how)
        return shots.render(catcher_settings(settings))

    return with_catcher_shadows(picture, render)
