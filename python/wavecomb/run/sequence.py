# SPDX-License-Identifier: Apache-2.0
"""Frames of one stage, which stays open between them."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wavecomb import _core
from wavecomb.api import check_memory, picture_of, prepare
from wavecomb.run.boxed.reader import Reader, is_wanted
from wavecomb.run.frame_names import parse_frames
from wavecomb.run.stats import make_stats

if TYPE_CHECKING:
    from wavecomb._core import Result, Settings
    from wavecomb.api import Picture
    from wavecomb.run.frame_reader import FrameReader
    from wavecomb.usd import LoadedStage


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
        isolate: bool | None = None,
        **options: Any,
    ) -> None:
        """Opens the stage.

        Args:
            path: .usd, .usda, .usdc or .usdz.
            variants: As of ``wavecomb.load``, like what follows.
            mask: Likewise.
            session_layer: Likewise.
            threads: Likewise.
            isolate: Likewise.
            **options: Of ``load_stage``.

        Raises:
            WavecombError: It cannot be opened.
        """
        self._path = Path(path)
        self._options = options
        self._threads = threads
        self._renderer: _core.Renderer | None = None
        self._loaded: LoadedStage | None = None
        self._is_built = False
        layer = None if session_layer is None else os.fspath(session_layer)
        opening = {**options, "variants": dict(variants or {}), "mask": tuple(mask),
                   "session_layer": layer, "threads": threads}  # fmt: skip
        started = time.perf_counter()
        self._boxed: Reader | None = None
        self._here: FrameReader | None = None
        if is_wanted(isolate):
            self._boxed = Reader(self._path)
            try:
                self._boxed.open(opening)
            except BaseException:
                self._boxed.close()
                raise
        else:
            from wavecomb.run.frame_reader import FrameReader

            self._here = FrameReader(self._path, **opening)
        self._opening_s = time.perf_counter() - started

    def close(self) -> None:
        """Ends the process that reads the stage, if there is one; what was loaded stays."""
        if self._boxed is not None:
            self._boxed.close()

    def __enter__(self) -> Frames:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

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
        progress = options.pop("progress", None)
        loaded = None if self._renderer is None else self._seen_anew(frame, options)
        if loaded is None:
            # Let go of first: two hierarchies at a time would be twice the memory.
            self._renderer, self._loaded = None, None
            options["threads"] = self._threads
            if self._here is None:
                assert self._boxed is not None
                loaded = self._boxed.frame(frame, options, progress)
            else:
                loaded = self._here.read(frame, {**options, "progress": progress})
        seconds = time.perf_counter() - started + self._opening_s
        self._opening_s = 0.0
        self._loaded = replace(loaded, seconds=seconds, stage_path=self._path)
        return self._loaded

    def _seen_anew(self, frame: float | None, options: dict[str, Any]) -> LoadedStage | None:
        """The scene that is there with its camera at a frame; None where more may be other."""
        before, renderer = self._loaded, self._renderer
        assert before is not None and renderer is not None
        if self._here is None:
            assert self._boxed is not None
            found = self._boxed.look(frame, options)
        else:
            seen = self._here.look(frame, options)
            found = None if seen is None else seen.as_dict()
        if found is None:
            return None
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
    isolate: bool | None = None,
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
        isolate: As in ``load``; one process reads all frames, and ends after the last.
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
        isolate=isolate,
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
    with shots:
        for frame in frames:
            scene = shots.load(frame).scene
            if "light_groups" in names:
                check_memory(settings, names, len(scene.light_groups))
            result = shots.render(settings, progress, policy, profile)
            yield frame, picture_of(result, shots.stats(result), scene=scene, aovs=names)
