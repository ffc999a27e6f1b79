# SPDX-License-Identifier: Apache-2.0
"""Stages in, pictures out, from Python."""

from __future__ import annotations

import contextlib
import os
import signal
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavecomb.load_options import LoadOptions, split
from wavecomb.run import aovs as aov_names
from wavecomb.run.isolate.memory import machine_limit

if TYPE_CHECKING:
    from wavecomb._core import Result, Scene, Settings
    from wavecomb.picture.exr import Compression
    from wavecomb.picture.image import Transfer
    from wavecomb.run.boxed.reader import Reader
    from wavecomb.run.watcher import Watcher
    from wavecomb.scheduling import SchedulingPolicy
    from wavecomb.usd import LoadedStage

Progress = Callable[[int, int], "bool | None"]

DEFAULT_SIZE = (600, 600)
MAX_EDGE = 65536
MAX_SPP = 1 << 24
# Of an adaptive render: sums and layers of errors, and what measuring them takes.
_ERROR_BYTES_PER_PIXEL = 100


@dataclass(frozen=True)
class Picture:
    """A rendered picture. Row 0 is the top.

    Attributes:
        beauty: (height, width, 3), linear Rec.709, or in the working space of the stage.
        albedo: (height, width, 3). Like normal and depth, None where it was not asked for.
        normal: (height, width, 3), world space.
        depth: (height, width), along the camera's axis; infinite where nothing was hit.
        samples: (height, width), samples that each pixel got.
        error: (height, width), what adaptive sampling goes by (docs/render.md); infinite where
            there are too few samples. None unless the render was adaptive or had error=True.
        variance: (height, width, 3), of each pixel's mean, as if its samples were independent;
            None likewise.
        denoised: (height, width, 3), the beauty without its noise; None unless asked for.
        stats: What was done and how long it took; docs/statistics.md has the schema.
        cancelled: Progress asked to stop; the picture holds what was done.
        costs: What shading took, by name of material and texture: a profile that another render
            can start from.
        aovs: Further AOVs by name, (height, width) or (height, width, channels): docs/aovs.md.
            Cryptomatte levels are pairs of id and coverage, as `wavecomb.cryptomatte` reads them.
        manifests: Cryptomatte level -> name -> id, of what the picture holds.
        metadata: For the header of a file, beside what the statistics say.
        chosen: Names of the layers that are saved; all that there are where it is empty.
    """

    beauty: NDArray[np.float32]
    albedo: NDArray[np.float32] | None
    normal: NDArray[np.float32] | None
    depth: NDArray[np.float32] | None
    samples: NDArray[np.uint32]
    error: NDArray[np.float32] | None = None
    variance: NDArray[np.float32] | None = None
    denoised: NDArray[np.float32] | None = None
    stats: dict[str, Any] = field(default_factory=dict, repr=False)
    cancelled: bool = False
    costs: dict[str, dict[str, float]] = field(default_factory=dict, repr=False)
    aovs: dict[str, NDArray[np.float32]] = field(default_factory=dict, repr=False)
    manifests: dict[str, dict[str, int]] = field(default_factory=dict, repr=False)
    metadata: dict[str, Any] = field(default_factory=dict, repr=False)
    chosen: tuple[str, ...] = ()

    def layers(self) -> dict[str, NDArray[Any]]:
        """The layers of an EXR file by name and in order; a Cryptomatte is several there."""
        from wavecomb.picture import cryptomatte

        arrays = {
            "beauty": self.beauty,
            "denoised": self.denoised,
            "albedo": self.albedo,
            "normal": self.normal,
            "depth": self.depth,
            "samples": self.samples,
            "error": self.error,
            "variance": self.variance,
        }
        out: dict[str, NDArray[Any]] = {}
        wanted = set(self.chosen or {**arrays, **self.aovs}) | {"denoised"}
        if self.chosen == aov_names.DEFAULT:
            wanted |= {"error", "variance"}
        for name, array in {**arrays, **self.aovs}.items():
            may_be_kept_only = name in arrays or name in aov_names.GUIDES
            if array is None or (may_be_kept_only and name not in wanted):
                continue
            out.update(
                cryptomatte.layers(name, array) if name in cryptomatte.LEVELS else {name: array}
            )
        return out

    def with_denoised(self, *, threads: int = 0) -> Picture:
        """The picture with its layer ``denoised``, by Open Image Denoise; the beauty stays.

        Guided by the AOVs guide_albedo and guide_normal, which see through mirrors and clear glass,
        or else by albedo and normal.

        Raises:
            WavecombError: The extra ``denoise`` is missing; says how to install it.
        """
        from wavecomb.errors import WavecombError
        from wavecomb.picture.denoise import denoise

        albedo = self.aovs.get("guide_albedo", self.albedo)
        normal = self.aovs.get("guide_normal", self.normal)
        if albedo is None or normal is None:
            raise WavecombError(
                "denoising needs the AOVs guide_albedo and guide_normal: render with them, too"
            )
        start = time.perf_counter()
        denoised = denoise(self.beauty, albedo, normal, threads=threads)
        seconds = {**self.stats.get("seconds", {}), "denoise": time.perf_counter() - start}
        return replace(self, denoised=denoised, stats={**self.stats, "seconds": seconds})

    def save(
        self,
        path: str | os.PathLike[str],
        *,
        half: bool = False,
        compression: Compression = "zip",
        tile: int = 0,
        split: bool = False,
        exposure: float = 0.0,
        tone_map: Transfer = "clamp",
    ) -> list[Path]:
        """Writes all layers (.exr) or the picture for display (.png), whole or not at all.

        A .png is of the denoised picture where there is one.

        Args:
            path: By its ending .exr or .png.
            half: EXR: 16 bit colours and normals.
            compression: EXR: none, rle, zips, zip, piz, pxr24, b44, b44a, dwaa or dwab.
            tile: EXR: edge of tiles in pixels, a multiple of 16; 0: scanlines.
            split: EXR: a file for each AOV, path.NAME.exr, the beauty in ``path`` itself.
            exposure: PNG: in stops.
            tone_map: PNG: "clamp" or "neutral".

        Returns:
            The files that were written.

        >>> picture = wavecomb.render("mixed.usdc")  # doctest: +SKIP
        >>> picture.save("mixed.exr", half=True)  # doctest: +SKIP
        >>> picture.save("mixed.png", exposure=0.5)  # doctest: +SKIP
        """
        from wavecomb.picture.image import write_png
        from wavecomb.picture.output import save_layers
        from wavecomb.picture.working_space import to_rec709

        kind = Path(path).suffix.lower()
        if kind == ".exr":
            return save_layers(
                path,
                self.layers(),
                self.file_metadata(),
                self.manifests,
                half=half,
                compression=compression,
                tile=tile,
                split=split,
            )
        if kind == ".png":
            shown = self.beauty if self.denoised is None else self.denoised
            shown = to_rec709(shown, self.stats.get("working_space", "rec709"))
            write_png(path, shown, exposure=exposure, tone_map=tone_map)
            return [Path(path)]
        raise ValueError(f"{os.fspath(path)}: pictures are saved as .exr or .png")

    def file_metadata(self) -> dict[str, Any]:
        """Attributes of an EXR file: version, stage, camera, settings, times, matrices."""
        from wavecomb.run.stats import picture_metadata

        return {**picture_metadata(self.stats), **self.metadata}


def load(
    path: str | os.PathLike[str],
    options: LoadOptions | None = None,
    *,
    progress: Callable[[int, int], None] | None = None,
    isolate: bool | None = None,
    load_limit: float | None = None,
    memory_limit: float | None = None,
    **changes: Any,
) -> LoadedStage:
    """Reads a USD stage.

    Args:
        path: .usd, .usda, .usdc or .usdz.
        options: How it is read.
        progress: Called now and then as progress(prims read, prims found so far).
        isolate: Whether a process of its own reads the stage, in a sandbox, and this one builds the
            scene of what comes out of it. Where USD or an image library crashes on a broken file,
            that process dies, and this one gets the exception. By default it does, on Linux,
            unless WAVECOMB_ISOLATE=0. What this process alone has is not there: layers that were
            changed and not saved, plugins and resolvers that were registered from Python. For
            these: False. (docs/decisions/reading-in-a-box.md)
        load_limit: Of that process: seconds that USD may compose the stage, 0: any; None: 6, and 1
            for each MB of layers.
        memory_limit: Of that process, and of what comes out of it: MB; None: what the machine has.
        **changes: Fields of ``LoadOptions`` (camera, frame, purposes, variants, subdivision ...),
            in place of those of ``options``.

    Returns:
        The scene with a report: `.scene`, `.report`, `.camera_path`, `.seconds`.

    >>> stage = wavecomb.load("mixed.usdc")  # doctest: +SKIP
    >>> stage.scene.instanced_triangles  # doctest: +SKIP
    11547184

    Raises:
        WavecombError: The stage cannot be rendered; one line that names the file or prim.
    """
    chosen = LoadOptions.of(options, changes)
    chosen.check()
    from wavecomb.run.boxed.reader import Reader, is_wanted

    if is_wanted(isolate):
        with Reader(path, load_limit=load_limit, memory_limit=memory_limit) as reader:
            return reader.load(chosen.as_dict(), progress=progress)
    import_usd()
    from wavecomb.usd import load_stage

    return load_stage(Path(path), chosen, progress=progress)


def import_usd() -> None:
    """Loads USD's modules.

    A Ctrl-C meanwhile comes when they are loaded: their loader swallows what it raises within it,
    and leaves half a library.
    """
    from wavecomb.run.progress import Interrupt

    with Interrupt() as interrupt:
        from wavecomb.usd import load_stage  # noqa: F401
    if interrupt.signal is not None:
        signal.raise_signal(interrupt.signal)


def render(
    source: str | os.PathLike[str] | LoadedStage | Scene,
    *,
    size: tuple[int, int] | None = None,
    spp: int = 64,
    progress: Progress | None = None,
    policy: str | SchedulingPolicy | None = None,
    costs: str | Mapping[str, Mapping[str, float]] | None = None,
    aovs: Iterable[str] | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    every: float = 120.0,
    resume: str | os.PathLike[str] | None = None,
    isolate: bool | None = None,
    **options: Any,
) -> Picture:
    """Renders a stage file, a loaded stage or a scene of ``SceneBuilder``.

    Args:
        source: A path, what ``load`` gave, or a ``Scene``.
        size: Width and height, pixels; by default of a path's render settings, else 600 x 600.
        spp: Samples per pixel; with ``adaptive`` or ``noise`` the most of them.
        progress: Called as progress(samples_done, samples_total) about ten times a second; return
            False to stop and keep what is done.
        policy: Order of shading: a name, or an object of a ``SchedulingPolicy`` of your own. No
            policy changes the picture.
        costs: "auto", "measured", "model", or the ``Picture.costs`` of another render to start
            from.
        aovs: What to keep beside the beauty: names of docs/aovs.md, "light_NAME" for a light group,
            "crypto", "all"; by default a path's render vars, else albedo, normal and depth.
        checkpoint: File that the state of the render is saved to, now and then and at the end.
        every: Seconds between checkpoints.
        resume: Checkpoint to go on from, of a render with the same stage and settings. The picture
            is, bit for bit, that of a render that nothing stopped.
        isolate: As in ``load``; for a path only.
        **options: Fields of ``wavecomb.Settings``: max_depth, integrator, threads, seed, adaptive,
            noise, min_spp, time_limit ...; for a path also those of ``LoadOptions``: camera,
            frame, subdivision ...

    >>> picture = wavecomb.render("mixed.usdc", size=(960, 540), spp=16)  # doctest: +SKIP
    >>> picture.beauty.shape  # doctest: +SKIP
    (540, 960, 3)

    A stage that is rendered more than once is best loaded once:

    >>> stage = wavecomb.load("mixed.usdc")  # doctest: +SKIP
    >>> for seed in range(4):  # doctest: +SKIP
    ...     wavecomb.render(stage, spp=4, seed=seed).save(f"mixed{seed}.exr")

    Raises:
        WavecombError: The stage cannot be rendered; the policy, the costs or the checkpoint are no
            good.
        wavecomb._core.Error: A setting is no good.
    """
    from wavecomb.run.stats import make_stats

    loading, settings = split(options, without=("size", "threads"))
    with contextlib.ExitStack() as while_reading:
        reader: Reader | None = None
        if isinstance(source, (str, os.PathLike)):
            from wavecomb.run.boxed.reader import Reader, is_wanted

            if is_wanted(isolate):
                reader = while_reading.enter_context(Reader(source))
            size, aovs = _asked_for(source, size, aovs, settings, loading, reader)
        own, profile, names, chosen = prepare(
            size or DEFAULT_SIZE, spp, policy, costs, aovs, settings
        )
        scene, loaded, stage = _resolve(source, loading, isolate, chosen, reader)
    if "light_groups" in names:
        check_memory(chosen, names, len(scene.light_groups))
    watcher, state = _keeping(scene, chosen, names, stage, checkpoint, every, resume)
    result = _render(scene, chosen, progress, own, profile, watcher, state)
    stats = make_stats(result, stage=stage, loaded=loaded)
    return picture_of(result, stats, scene=scene, aovs=names)


def _asked_for(
    path: str | os.PathLike[str],
    size: tuple[int, int] | None,
    aovs: Iterable[str] | None,
    settings: dict[str, Any],
    loading: Mapping[str, Any],
    reader: Reader | None,
) -> tuple[tuple[int, int], Iterable[str] | None]:
    """Size and AOVs, and the region in ``settings``: as the first render product says, if none."""
    names = ("render_settings", "product", "session_layer")
    asked = {name: loading[name] for name in names if loading.get(name) is not None}
    if reader is None:
        import_usd()
        from wavecomb.usd import peek_products

        choice = peek_products(os.fspath(path), **asked)[0][0]
    else:
        choice = reader.peek(**asked)[0]
    chosen = size or choice.resolution or DEFAULT_SIZE
    region = choice.region(*chosen)
    if region is not None:
        settings.setdefault("region", region)
    return chosen, choice.aovs if aovs is None else aovs


def prepare(
    size: tuple[int, int],
    spp: int,
    policy: str | SchedulingPolicy | None,
    costs: str | Mapping[str, Mapping[str, float]] | None,
    aovs: Iterable[str] | None,
    settings: dict[str, Any],
) -> tuple[Any, dict[str, dict[str, float]] | None, tuple[str, ...], Settings]:
    """Checked arguments of ``render``: a policy of the caller's, a profile, AOVs, settings."""
    own: Any = None
    if isinstance(policy, str):
        settings["policy"] = policy
    elif policy is not None:
        from wavecomb.scheduling import check_policy

        check_policy(policy)
        own = policy
    profile: dict[str, dict[str, float]] | None = None
    if isinstance(costs, str):
        settings["costs"] = costs
    elif costs is not None:
        from wavecomb.run.costs import check_costs

        profile = check_costs(costs)
    names = aov_names.DEFAULT if aovs is None else aov_names.expand(aovs)
    chosen = make_settings(size, spp, aovs=names, **settings)
    return own, profile, tuple(names), chosen


def picture_of(
    result: Result,
    stats: dict[str, Any],
    *,
    scene: Scene | None = None,
    aovs: Sequence[str] = aov_names.DEFAULT,
) -> Picture:
    """A result of the core as a picture.

    Args:
        result: Of ``_core.render``.
        stats: Of ``make_stats``.
        scene: What was rendered, for the camera's matrices.
        aovs: Names as ``aovs.expand`` gives them.
    """
    from wavecomb.picture.output import scene_metadata

    height, width = result.beauty.shape[:2]
    return Picture(
        beauty=result.beauty,
        albedo=result.albedo,
        normal=result.normal,
        depth=result.depth,
        samples=result.samples,
        error=result.error,
        variance=result.variance,
        stats=stats,
        cancelled=result.cancelled,
        costs=result.costs,
        aovs=result.aovs,
        manifests=result.manifests,
        metadata={} if scene is None else scene_metadata(scene, width, height),
        chosen=tuple(aovs),
    )


def make_settings(
    size: tuple[int, int],
    spp: int,
    *,
    aovs: Sequence[str] = aov_names.DEFAULT,
    **settings: Any,
) -> Settings:
    """Checked settings; raises WavecombError or _core.Error in one line. aovs: as expanded.

    Checks what the core cannot know: whether the picture fits in the memory of this machine.
    """
    from wavecomb import _core
    from wavecomb.errors import WavecombError

    width, height = (int(edge) for edge in size)
    if not (1 <= width <= MAX_EDGE and 1 <= height <= MAX_EDGE):
        raise WavecombError(
            f"size {width} x {height}: each edge must be from 1 to {MAX_EDGE} pixels"
        )
    if not 1 <= int(spp) <= MAX_SPP:
        raise WavecombError(f"{spp} samples per pixel: must be from 1 to {MAX_SPP}")
    if tuple(aovs) != aov_names.DEFAULT:
        settings["aovs"] = aov_names.for_core(aovs)
        settings["error"] = settings.get("error", False) or bool({"error", "variance"} & {*aovs})
    chosen = _core.Settings(width=width, height=height, spp=int(spp), **settings)
    check_memory(chosen, aovs)
    chosen.check()
    return chosen


def check_memory(settings: Settings, aovs: Sequence[str], light_groups: int = 1) -> None:
    """Raises WavecombError unless the film and the picture fit in the memory of this machine.

    Args:
        settings: Of the render.
        aovs: As expanded.
        light_groups: Of the scene; to be checked again once that is known.
    """
    from wavecomb.errors import WavecombError

    others = [name for name in aovs if name not in aov_names.ERRORS]
    each = aov_names.bytes_per_pixel(others, light_groups)
    each += _ERROR_BYTES_PER_PIXEL * keeps_error(settings)
    needed, there = settings.width * settings.height * each, machine_limit()
    if there is not None and needed > 0.8 * there:
        raise WavecombError(
            f"size {settings.width} x {settings.height}: needs about {needed / 2**30:.0f} GiB of "
            f"memory, this machine has {there / 2**30:.0f}; choose a smaller size or fewer AOVs"
        )


def keeps_error(settings: Settings) -> bool:
    """Whether a render with these settings has the layers error and variance."""
    return bool(settings.adaptive or settings.noise or settings.error)


def _keeping(
    scene: Scene,
    settings: Settings,
    aovs: Sequence[str],
    stage: str | None,
    checkpoint: str | os.PathLike[str] | None,
    every: float,
    resume: str | os.PathLike[str] | None,
) -> tuple[Watcher | None, dict[str, Any] | None]:
    """Who saves checkpoints, and the state to go on from."""
    if checkpoint is None and resume is None:
        return None, None
    from wavecomb.run.checkpoint import check_fits, load_checkpoint, make_header
    from wavecomb.run.watcher import CheckpointSink, Watcher

    header = make_header(scene, settings, stage=stage, source={}, aovs=aovs)
    before = load_checkpoint(resume) if resume is not None else None
    if before is not None:
        check_fits(before, header)
    seconds = before.seconds if before is not None else 0.0
    sinks = [CheckpointSink(checkpoint, every, header, seconds)] if checkpoint is not None else []
    return Watcher(sinks, warn=_warn), before.state if before is not None else None


def _warn(line: str) -> None:
    import warnings

    warnings.warn(line, RuntimeWarning, stacklevel=2)


def _resolve(
    source: str | os.PathLike[str] | LoadedStage | Scene,
    loading: Mapping[str, Any],
    isolate: bool | None,
    settings: Settings,
    reader: Reader | None,
) -> tuple[Scene, LoadedStage | None, str | None]:
    if isinstance(source, (str, os.PathLike)):
        size = settings.width, settings.height
        options = LoadOptions.of(None, {**loading, "size": size, "threads": settings.threads})
        if reader is None:
            loaded = load(source, options, isolate=False)
        else:
            options.check()
            loaded = reader.load(options.as_dict())
        return loaded.scene, loaded, os.fspath(source)
    if isolate or loading:
        raise TypeError(
            f"{', '.join(loading) or 'isolate'}: how a stage is read is chosen when it is loaded: "
            "give it to load()"
        )
    loaded_scene: Any = getattr(source, "scene", None)
    if loaded_scene is not None:
        stage: Any = source
        return loaded_scene, stage, str(stage.stage_path)
    scene: Any = source
    return scene, None, None


def _render(
    scene: Scene,
    settings: Settings,
    progress: Progress | None,
    policy: SchedulingPolicy | None,
    costs: dict[str, dict[str, float]] | None,
    watcher: Watcher | None,
    state: dict[str, Any] | None,
) -> Result:
    from wavecomb import _core

    return _core.render(scene, settings, progress, policy, costs, watcher=watcher, state=state)
