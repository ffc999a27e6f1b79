# SPDX-License-Identifier: Apache-2.0
"""Python functions that load and render stages."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeGuard

from wavecomb.arguments import check_arguments, check_source
from wavecomb.errors import WavecombError
from wavecomb.image.rendered import Picture, picture_of
from wavecomb.load_options import LoadOptions, split
from wavecomb.run import aovs as aov_names
from wavecomb.run import catchers, live_view
from wavecomb.run.callbacks import CheckpointSink, Sink, Watcher
from wavecomb.run.checkpoint import check_fits, load_checkpoint, make_header
from wavecomb.run.guiding_file import check_trains_field, learned_of
from wavecomb.run.settings import DEFAULT_SIZE, check_memory, check_options, prepare

if TYPE_CHECKING:
    from pxr import Usd
    from typing_extensions import Unpack

    from wavecomb._core import Result, Scene, Settings
    from wavecomb.keywords import LoadKeywords, RenderKeywords
    from wavecomb.run.live_view import ProgressDisplays
    from wavecomb.scheduling import SchedulingPolicy
    from wavecomb.usd import LoadedStage

Progress = Callable[[int, int], "bool | None"]


def load(
    path: str | os.PathLike[str] | Usd.Stage,
    options: LoadOptions | None = None,
    *,
    progress: Callable[[int, int], None] | None = None,
    isolate: bool | None = None,
    load_limit: float | None = None,
    memory_limit: float | None = None,
    **changes: Unpack[LoadKeywords],
) -> LoadedStage:
    """Reads a USD stage.

    Args:
        path: .usd, .usda, .usdc or .usdz; or a ``Usd.Stage``, which may be in memory or have
            unsaved edits. A given ``Usd.Stage`` stays unchanged, except for its session layer if
            ``variants`` are given.
        options: Load options.
        progress: Called as progress(prims read, prims found so far) at intervals.
        isolate: Deprecated and without effect: a stage is read in the calling process.
        load_limit: Deprecated and without effect.
        memory_limit: Deprecated and without effect.
        **changes: Fields of ``LoadOptions`` (camera, frame, purposes, variants, subdivision ...)
            that replace those of ``options``.

    Returns:
        The scene with a report: `.scene`, `.report`, `.camera_path`, `.seconds`.

    >>> stage = wavecomb.load("mixed.usdc")  # doctest: +SKIP
    >>> stage.scene.instanced_triangles  # doctest: +SKIP
    11547184

    Raises:
        WavecombError: The stage cannot be rendered; the one-line message names the file or prim.
    """
    check_source(path)
    chosen = LoadOptions.of(options, changes)
    chosen.check()
    warn_deprecated(isolate=isolate, load_limit=load_limit, memory_limit=memory_limit)
    import_usd()
    from wavecomb.usd import load_stage

    source = Path(path) if isinstance(path, (str, os.PathLike)) else path
    return load_stage(source, chosen, progress=progress)


def warn_deprecated(**given: object) -> None:
    """Warns about deprecated arguments, which configured a child process in earlier versions."""
    import warnings

    for name in (name for name, value in given.items() if value is not None):
        warnings.warn(
            f"{name} has no effect any more: stages are read in the calling process "
            "(docs/decisions/sandbox.md)",
            DeprecationWarning,
            stacklevel=3,
        )


def import_usd() -> None:
    """Imports USD's modules.

    Defers a Ctrl-C until the modules are loaded, since USD's loader swallows an exception that is
    raised inside it and leaves a partially loaded library.
    """
    from wavecomb.run.progress import Interrupt

    with Interrupt() as interrupt:
        from wavecomb.usd import load_stage  # noqa: F401
    if interrupt.signal is not None:
        signal.raise_signal(interrupt.signal)


def render(
    source: str | os.PathLike[str] | Usd.Stage | LoadedStage | Scene,
    *,
    size: tuple[int, int] | None = None,
    spp: int = 64,
    progress: Progress | bool | None = None,
    policy: str | SchedulingPolicy | None = None,
    costs: str | Mapping[str, Mapping[str, float]] | None = None,
    aovs: Iterable[str] | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    every: float = 120.0,
    resume: str | os.PathLike[str] | None = None,
    learn_from: str | os.PathLike[str] | bytes | Picture | None = None,
    isolate: bool | None = None,
    **options: Unpack[RenderKeywords],
) -> Picture:
    """Renders a stage, given as a file or an open ``Usd.Stage``, or a scene from ``SceneBuilder``.

    Args:
        source: A path, a ``Usd.Stage``, a result of ``load``, or a ``Scene``.
        size: Width and height in pixels; by default those in the render settings of a stage that
            this function loads, else 600 x 600.
        spp: Samples per pixel; with ``adaptive`` or ``noise``, the maximum number.
        progress: Called as progress(samples_done, samples_total) about ten times per second; return
            False to stop and keep the finished samples. In a notebook, None shows a bar and the
            current image; False shows nothing, and True shows a bar on a terminal as well.
        policy: Order of shading: the name of a policy, or an object of a ``SchedulingPolicy``
            subclass. Scheduling policies never change the image.
        costs: "auto", "measured", "model", or the ``Picture.costs`` of another render as initial
            values.
        aovs: Layers besides beauty: names of docs/aovs.md, "light_NAME" for a light group,
            "lpe:NAME=EXPRESSION", "crypto", "all"; by default the render vars of a stage that this
            function loads, else albedo, normal and depth.
        checkpoint: File for the state of the render, written at intervals and at the end.
        every: Seconds between checkpoints.
        resume: Checkpoint to continue, from a render with the same stage and settings. The image is
            bit-identical to that of an uninterrupted render.
        learn_from: With ``guiding``, a ``Picture``, or a file from ``Picture.save_learned``, whose
            guiding field this render uses without further training.
        isolate: Deprecated and without effect, as in ``load``.
        **options: Fields of ``wavecomb.Settings``: max_depth, integrator, threads, seed, adaptive,
            noise, min_spp, time_limit ...; for a stage that this function loads, also fields of
            ``LoadOptions``: camera, frame, subdivision ...

    >>> picture = wavecomb.render("mixed.usdc", size=(960, 540), spp=16)  # doctest: +SKIP
    >>> picture.beauty.shape  # doctest: +SKIP
    (540, 960, 3)

    To render a stage several times, load it once; it then keeps its acceleration structures and
    light statistics between renders:

    >>> stage = wavecomb.load("mixed.usdc")  # doctest: +SKIP
    >>> for seed in range(4):  # doctest: +SKIP
    ...     wavecomb.render(stage, spp=4, seed=seed).save(f"mixed{seed}.exr")

    Raises:
        wavecomb.Error: The stage cannot be rendered, or an argument is invalid.
    """
    warn_deprecated(isolate=isolate)
    check_source(source, also=("scene", "instanced_triangles"))
    check_arguments(size, spp, aovs, options)
    loading, settings = split(options, without=("size", "threads"))
    check_options(size, spp, settings)
    if is_unread(source):
        size, aovs = _asked_for(source, size, aovs, settings, loading)
    own, profile, names, chosen = prepare(size or DEFAULT_SIZE, spp, policy, costs, aovs, settings)
    scene, loaded, stage = _resolve(source, loading, chosen)
    if "light_groups" in names:
        check_memory(chosen, names, len(scene.light_groups))
    if has_catchers := loaded is not None and bool(loaded.catchers):
        kept = {"checkpoint": checkpoint, "resume": resume, "deep": aov_names.DEEP in names}
        catchers.check(chosen, kept)
        if stage is None or loaded is source:
            raise WavecombError(
                "the stage has shadow catchers, which take three renders: give render() its path"
            )
        chosen = catchers.with_alpha(chosen)
        names = aov_names.with_others(names, [catchers.LAYER])
    learned = learned_of(learn_from)
    if learned is not None:
        check_trains_field(chosen, "learn_from")
    told, asked = (progress, False) if callable(progress) else (None, progress)
    space = "rec709" if loaded is None else loaded.working_space
    with live_view.watching(asked, space) as shown:
        watcher, state = _keeping(
            checkpoint, every, resume, shown,
            lambda: make_header(scene, chosen, stage=stage, source={}, aovs=names),
        )  # fmt: skip
        result, is_built = _render(
            scene, loaded if loaded is source else None, chosen, progress=told, policy=own,
            costs=profile, watcher=watcher, state=state, learned=learned,
        )  # fmt: skip
    picture = picture_from(result, names, scene, loaded=loaded, stage=stage, is_built=is_built)
    if not has_catchers or picture.cancelled:
        return picture

    def render_catchers(how: Mapping[str, str]) -> Result:
        size = chosen.width, chosen.height
        options = LoadOptions.of(None, {**loading, "size": size, "threads": chosen.threads, **how})
        settings = catchers.catcher_settings(chosen)
        return _render(load(source, options).scene, None, settings, policy=own, learned=learned)[0]

    return catchers.with_catcher_shadows(picture, render_catchers)


def picture_from(
    result: Result, aovs: Sequence[str], scene: Scene, *, loaded: LoadedStage | None, **more: Any
) -> Picture:
    """Returns the image of a render with its statistics.

    Args:
        result: Render result of the native core.
        aovs: Expanded AOVs.
        scene: The scene.
        loaded: The loaded stage; None for a scene of ``SceneBuilder``.
        more: Further arguments of ``make_stats``.
    """
    from wavecomb.run.stats import make_stats

    return picture_of(result, make_stats(result, loaded=loaded, **more), scene=scene, aovs=aovs)


def is_unread(source: Any) -> TypeGuard[str | os.PathLike[str] | Usd.Stage]:
    """Returns whether a source is a path or an open ``Usd.Stage``, and not a scene."""
    return not (hasattr(source, "scene") or hasattr(source, "instanced_triangles"))


def _asked_for(
    path: str | os.PathLike[str] | Usd.Stage,
    size: tuple[int, int] | None,
    aovs: Iterable[str] | None,
    settings: dict[str, Any],
    loading: Mapping[str, Any],
) -> tuple[tuple[int, int], Iterable[str] | None]:
    """Returns the image size and AOVs, by default those of the first render product.

    Also sets ``region`` in ``settings`` if the render product restricts the pixels to render.
    """
    names = ("render_settings", "product", "session_layer")
    asked = {name: loading[name] for name in names if loading.get(name) is not None}
    import_usd()
    from wavecomb.usd import peek_products

    unread = os.fspath(path) if isinstance(path, (str, os.PathLike)) else path
    choice = peek_products(unread, **asked)[0][0]
    chosen = size or choice.resolution or DEFAULT_SIZE
    region = choice.region(*chosen)
    if region is not None and "region" not in settings:
        settings["region"] = region
        # Files get the data window that the stage's render settings define.
        settings.setdefault("crop", True)
    return chosen, choice.aovs if aovs is None else aovs


def _keeping(
    checkpoint: str | os.PathLike[str] | None,
    every: float,
    resume: str | os.PathLike[str] | None,
    shown: ProgressDisplays | None,
    header: Callable[[], dict[str, Any]],
) -> tuple[Watcher | None, dict[str, Any] | None]:
    """Returns a watcher for checkpoints and progress, and the state from which to continue."""
    sinks: list[Sink] = [] if shown is None else list(shown.sinks)
    reporter = None if shown is None else shown.reporter
    if checkpoint is None and resume is None:
        return (None if shown is None else Watcher(sinks, reporter=reporter)), None
    own = header()
    before = load_checkpoint(resume) if resume is not None else None
    if before is not None:
        check_fits(before, own)
    seconds = before.seconds if before is not None else 0.0
    if checkpoint is not None:
        sinks.append(CheckpointSink(checkpoint, every, own, seconds))
    watcher = Watcher(sinks, reporter=reporter, warn=_warn)
    return watcher, before.state if before is not None else None


def _warn(line: str) -> None:
    import warnings

    warnings.warn(line, RuntimeWarning, stacklevel=2)


def _resolve(
    source: str | os.PathLike[str] | Usd.Stage | LoadedStage | Scene,
    loading: Mapping[str, Any],
    settings: Settings,
) -> tuple[Scene, LoadedStage | None, str | None]:
    if is_unread(source):
        size = settings.width, settings.height
        options = LoadOptions.of(None, {**loading, "size": size, "threads": settings.threads})
        loaded = load(source, options)
        is_path = isinstance(source, (str, os.PathLike))
        return loaded.scene, loaded, os.fspath(source) if is_path else str(loaded.stage_path)
    if loading:
        raise TypeError(f"{', '.join(loading)}: give this to load(): the stage is loaded already")
    loaded_scene: Any = getattr(source, "scene", None)
    if loaded_scene is not None:
        stage: Any = source
        return loaded_scene, stage, str(stage.stage_path)
    scene: Any = source
    return scene, None, None


def _render(
    scene: Scene, again: LoadedStage | None, settings: Settings, **named: Any
) -> tuple[Result, bool]:
    """Renders a scene; also returns whether acceleration structures were built.

    ``again`` is a loaded stage whose renderer is reused, or None. ``named`` are arguments of
    ``_core.render``.
    """
    from wavecomb import _core

    if again is None:
        return _core.render(scene, settings, **named), True
    with again.renderer(settings.threads) as (renderer, is_new):
        return renderer.render(settings, **named), is_new
